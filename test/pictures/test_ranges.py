# SPDX-License-Identifier: Apache-2.0
"""The ranges of colours."""

import numpy as np
import pytest

from socialcircle_ros.pictures.ranges import deviation_range, height_range

FLAT = np.full((4, 5), 3e-7)
NONE, ALL = np.zeros((4, 5), bool), np.ones((4, 5), bool)


def test_heights_span_those_that_are_kept():
    heights = np.linspace(0, 1, 20).reshape(4, 5)
    heights[0, 0] = 99
    low, high = height_range(heights, heights == 99, 1.0)
    assert 0 < low < high <= 1


def test_where_one_point_is_kept_the_measured_heights_are_taken():
    heights = np.linspace(-4e-7, 4e-7, 20).reshape(4, 5)
    kept_one = ALL.copy()
    kept_one[2, 2] = False
    assert height_range(heights, kept_one, 1.0) == height_range(heights, NONE, 1.0) != (0.0, 1.0)


def test_a_plane_has_a_span_of_its_own_size():
    low, high = height_range(FLAT, NONE, 1.0)
    assert (low, high) == pytest.approx((1.5e-7, 4.5e-7))
    assert height_range(0 * FLAT, NONE, 1e-6) == (-5e-7, 5e-7)
    assert height_range(np.full((4, 5), np.nan), NONE, 1.0) == (0.0, 1.0)


def test_differences_span_the_deviations_and_not_the_form():
    found = np.full((4, 5), np.nan)
    found[0, :3] = -2e-9, 1e-9, 0.5e-9
    low, high = deviation_range(found, 1e-3)
    assert -low == high == pytest.approx(2e-9, rel=0.1)
    assert deviation_range(found * np.nan, 1e-3) == (-5e-4, 5e-4)
    assert deviation_range(np.array([[0.0] * 99 + [3.0]]), 1.0) == (-3.0, 3.0)
