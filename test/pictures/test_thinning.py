# SPDX-License-Identifier: Apache-2.0
"""Fewer points for display."""

import numpy as np

from socialcircle_ros.pictures.thinning import grown


def test_a_value_spreads_to_its_neighbours_and_keeps_those_that_have_one():
    values = np.full((5, 7), np.nan)
    values[2, 2], values[2, 3], values[4, 6] = -1.0, 3.0, 2.0
    found = grown(values, 1)
    assert (found[2, 2], found[2, 3]) == (-1.0, 3.0)
    assert (found[1, 1], found[1, 2], found[3, 4]) == (-1.0, 3.0, 3.0)  # the farther from 0 of two neighbours
    assert found[3, 5] == 2.0
    assert np.isnan(found[0]).all()
    assert np.array_equal(grown(values, 0), values, equal_nan=True)
