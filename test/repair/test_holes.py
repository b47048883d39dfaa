# SPDX-License-Identifier: Apache-2.0
"""The search for holes, against its slow reference."""

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis.extra import numpy as npst
from naive import repair as naive

from socialcircle_ros.repair.holes import find_holes


@given(npst.arrays(np.bool_, npst.array_shapes(min_dims=2, max_dims=2, max_side=12)))
def test_holes_are_found_in_the_order_of_their_first_points(mask):
    points, starts = find_holes(mask)
    found = [[tuple(p) for p in points[a:b].tolist()] for a, b in pairwise(starts)]
    assert found == naive.find_holes(mask)
