# SPDX-License-Identifier: Apache-2.0
"""The cloud at reduced resolution."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.circle.adaptive.pyramid import halved, mark_expanded, raise_expanded


def halved_naively(heights):
    rows, columns = heights.shape[0] // 2, heights.shape[1] // 2
    half = np.full((rows, columns), np.nan, np.float32)
    for row, column in np.ndindex(rows, columns):
        four = heights[2 * row : 2 * row + 2, 2 * column : 2 * column + 2]
        known = sorted(four[~np.isnan(four)])
        if known:
            half[row, column] = np.mean(known[1:-1] if len(known) > 2 else known)
    return half


@given(st.integers(1, 9), st.integers(1, 9), st.integers(0, 2**32), st.sampled_from([0.0, 0.3, 0.7]))
def test_a_reduced_point_is_the_mean_of_the_middle_two_of_four(rows, columns, random, missing):
    generator = np.random.default_rng(random)
    heights = (generator.integers(-40, 40, (rows, columns)) / 4).astype(np.float32)  # exact sums
    heights[generator.random(heights.shape) < missing] = np.nan

    np.testing.assert_allclose(halved(heights), halved_naively(heights), rtol=1e-6)


def test_points_of_a_reduced_point_are_marked_and_others_left_alone():
    mask = np.zeros((5, 7), bool)
    mask[4, 6] = True

    mark_expanded(np.array([[False, True, False], [False, False, False]]), 2, mask)

    assert np.argwhere(mask).tolist() == [[0, 2], [0, 3], [1, 2], [1, 3], [4, 6]]


def test_steepness_is_raised_and_never_lowered():
    steepness = np.full((4, 4), 0.5, np.float32)

    raise_expanded(np.array([[0.25, 0.75], [0.0, 1.0]], np.float32), 2, steepness)

    np.testing.assert_array_equal(steepness, np.kron([[0.5, 0.75], [0.5, 1.0]], np.ones((2, 2))))
