"""Differences: differences of neighbours in the surface's own spread."""

import numpy as np
import pytest
from clouds import recipes
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import adaptive as naive

from socialcircle_ros.circle.adaptive.differences import NONE, UNIT, estimate_spread, normalised_differences


def heights_of(recipe):
    """Float32 heights, NaN where not measured."""
    xyz = recipe.cloud().astype(np.float32)
    return np.where(np.isfinite(xyz).all(axis=2), xyz[..., 2], np.float32(np.nan))


@settings(max_examples=150)
@given(recipes(36, 40), st.sampled_from([10, 16]), st.booleans())
def test_scale_and_jumps_are_those_of_the_reference_bit_for_bit(recipe, tile, may_predict):
    with np.errstate(all='ignore'):
        heights = heights_of(recipe)
        expected = naive.estimate_spread(heights, tile, may_predict)
        scale = estimate_spread(heights, tile, may_predict=may_predict)

        assert scale.predicted == expected.predicted
        np.testing.assert_array_equal(scale.slopes, expected.slopes)
        np.testing.assert_array_equal(scale.spreads, expected.spreads)
        np.testing.assert_array_equal(scale.tiles, expected.tiles)
        np.testing.assert_array_equal(
            normalised_differences(heights, scale), naive.normalised_differences(heights, expected, tile)
        )


@pytest.mark.parametrize('level', [0.0, 3.0, -1e-30])
def test_neighbours_on_a_plane_are_0_apart_and_what_is_off_it_is_far(level):
    heights = np.full((20, 24), level, np.float32)
    heights[9, 11] += 5

    differences = normalised_differences(heights, estimate_spread(heights, 16, may_predict=True))

    assert (differences[:, 9, 11] == -127).all()
    assert (differences[0, :9, :-1] == 0).all()
    assert (differences[0, :, -1] == NONE).all()


def test_the_spread_of_white_noise_is_that_of_its_differences_whatever_the_outliers():
    generator = np.random.default_rng(7)
    heights = generator.normal(0, 1, (200, 210)).astype(np.float32)
    heights[generator.random(heights.shape) < 0.1] += 30

    spreads = estimate_spread(heights, 16, may_predict=False).spreads

    np.testing.assert_allclose(spreads, np.sqrt(2), rtol=0.1)


def test_a_slope_is_no_jump():
    row, column = np.mgrid[:60, :70]
    noise = np.random.default_rng(3).normal(0, 1, (60, 70))
    sloped = (noise + 20 * column - 9 * row).astype(np.float32)

    level, slope = (
        normalised_differences(heights, estimate_spread(heights, 16, may_predict=False))
        for heights in (noise.astype(np.float32), sloped)
    )

    assert np.abs(slope.astype(int) - level)[level != NONE].mean() < UNIT / 4


def test_a_smooth_surface_s_differences_foretell_each_other_and_noise_does_not():
    row, column = np.mgrid[:60, :70].astype(np.float32)
    noise = np.random.default_rng(3).normal(0, 1, (60, 70)).astype(np.float32)

    assert estimate_spread(np.sin(row / 5) * np.cos(column / 6), 16, may_predict=True).predicted
    assert not estimate_spread(noise, 16, may_predict=True).predicted
