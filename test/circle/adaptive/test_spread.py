# SPDX-License-Identifier: Apache-2.0
"""The spread of the differences between neighbours."""

import numpy as np
import pytest
from circle.adaptive.surfaces import float32_heights
from clouds import recipes
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import adaptive as naive

from socialcircle_ros.circle.adaptive.spread import estimate_spread


@settings(max_examples=150)
@given(recipes(36, 40), st.sampled_from([10, 16]), st.booleans())
def test_the_spread_equals_the_reference_bit_for_bit(recipe, tile, may_predict):
    with np.errstate(all='ignore'):
        heights = float32_heights(recipe)
        expected = naive.estimate_spread(heights, tile, may_predict)
        spread = estimate_spread(heights, tile, may_predict=may_predict)

        assert spread.predicted == expected.predicted
        np.testing.assert_array_equal(spread.slopes, expected.slopes)
        np.testing.assert_array_equal(spread.by_direction, expected.by_direction)
        np.testing.assert_array_equal(spread.by_tile, expected.by_tile)


def test_outliers_do_not_widen_the_spread_of_white_noise():
    generator = np.random.default_rng(7)
    heights = generator.normal(0, 1, (200, 210)).astype(np.float32)
    heights[generator.random(heights.shape) < 0.1] += 30

    spread = estimate_spread(heights, 16, may_predict=False)

    np.testing.assert_allclose(spread.by_direction, np.sqrt(2), rtol=0.1)


def test_differences_of_a_smooth_surface_are_predicted_and_those_of_noise_are_not():
    row, column = np.mgrid[:60, :70].astype(np.float32)
    noise = np.random.default_rng(3).normal(0, 1, (60, 70)).astype(np.float32)

    assert estimate_spread(np.sin(row / 5) * np.cos(column / 6), 16, may_predict=True).predicted
    assert not estimate_spread(noise, 16, may_predict=True).predicted


@pytest.mark.parametrize('period', [4, 5, 6, 8, 10])
@pytest.mark.parametrize('shape', [(480, 640), (960, 1280), (301, 2000)])
def test_where_a_ruling_begins_changes_no_spread(period, shape):
    noise = np.random.default_rng(1).normal(size=shape)
    spreads = []
    for first in range(period):
        ruling = 20.0 * ((np.arange(shape[0]) + first) % period < period // 2)
        heights = (noise + ruling[:, np.newaxis]).astype(np.float32)
        spreads.append(estimate_spread(heights, 16, may_predict=False).by_direction)
    assert (np.max(spreads, axis=0) < 1.2 * np.min(spreads, axis=0)).all()


@pytest.mark.parametrize(
    'shape', [(2, 200_000), (3, 500_000), (59, 100_000), (100, 60_000), (61, 2100), (9000, 30)]
)
def test_the_rows_of_a_cloud_of_any_shape_have_differences_in_each_direction(shape):
    heights = np.random.default_rng(2).normal(size=shape).astype(np.float32)
    spread = estimate_spread(heights, 16, may_predict=False)
    np.testing.assert_allclose(spread.by_direction, np.sqrt(2), rtol=0.1)
