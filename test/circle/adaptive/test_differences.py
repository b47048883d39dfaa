# SPDX-License-Identifier: Apache-2.0
"""Normalised differences."""

import numpy as np
import pytest
from circle.adaptive.surfaces import float32_heights
from clouds import recipes
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import adaptive as naive

from socialcircle_ros.circle.adaptive.differences import MISSING, STEPS_PER_SPREAD, Spread, normalised_differences
from socialcircle_ros.circle.adaptive.spread import estimate_spread


@settings(max_examples=150)
@given(recipes(36, 40), st.sampled_from([10, 16]), st.booleans())
def test_differences_equal_the_reference_bit_for_bit(recipe, tile, may_predict):
    with np.errstate(all='ignore'):
        heights = float32_heights(recipe)
        spread = naive.estimate_spread(heights, tile, may_predict)
        given_spread = Spread(spread.slopes, spread.by_direction, spread.by_tile, tile, bool(spread.predicted))

        np.testing.assert_array_equal(
            normalised_differences(heights, given_spread), naive.normalised_differences(heights, spread, tile)
        )


@pytest.mark.parametrize('level', [0.0, 3.0, -1e-30])
def test_neighbours_on_a_plane_differ_by_0_and_a_point_off_it_by_the_most(level):
    heights = np.full((20, 24), level, np.float32)
    heights[9, 11] += 5

    differences = normalised_differences(heights, estimate_spread(heights, 16, may_predict=True))

    assert (differences[:, 9, 11] == -127).all()
    assert (differences[0, :9, :-1] == 0).all()
    assert (differences[0, :, -1] == MISSING).all()


def test_a_slope_makes_no_difference():
    row, column = np.mgrid[:60, :70]
    noise = np.random.default_rng(3).normal(0, 1, (60, 70))
    sloped = (noise + 20 * column - 9 * row).astype(np.float32)

    level, slope = (
        normalised_differences(heights, estimate_spread(heights, 16, may_predict=False))
        for heights in (noise.astype(np.float32), sloped)
    )

    assert np.abs(slope.astype(int) - level)[level != MISSING].mean() < STEPS_PER_SPREAD / 4
