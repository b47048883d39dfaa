# SPDX-License-Identifier: Apache-2.0
"""Areal surface texture: Sa, Sq, Sz, Ssk, Sku and Sdr."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.metrics.areal import areal_texture, texture

ROWS, COLUMNS = np.mgrid[:48, :64].astype(float)


def test_a_sine_wave_has_the_values_of_the_textbook():
    wave = 3.0 * np.sin(2 * np.pi * np.mgrid[:4, :3200][1] / 16)  # 200 periods leave no tilt
    found = texture(wave)
    assert found.sq == pytest.approx(3 / math.sqrt(2), rel=0.01)
    assert found.sa == pytest.approx(3 * 2 / math.pi, rel=0.02)
    assert found.sz == pytest.approx(6, rel=0.02)


def test_a_tilted_plane_has_no_texture():
    found = texture(5e3 + 0.3 * COLUMNS - 0.2 * ROWS)
    assert (found.sa, found.sq, found.sz) == pytest.approx((0, 0, 0), abs=1e-6)


def test_the_plane_is_fitted_to_the_measured_points_only():
    rough = np.random.default_rng(1).normal(size=ROWS.shape)
    holes = np.random.default_rng(2).random(ROWS.shape) < 0.3
    heights = np.where(holes, np.nan, rough + 0.5 * COLUMNS)
    measured = ~holes
    terms = np.stack([np.ones(measured.sum()), ROWS[measured], COLUMNS[measured]], axis=1)
    rest = heights[measured] - terms @ np.linalg.lstsq(terms, heights[measured], rcond=None)[0]
    found = texture(heights)
    assert found.sa == pytest.approx(np.abs(rest).mean())
    assert found.sq == pytest.approx(np.sqrt((rest**2).mean()))
    assert found.sz == pytest.approx(rest.max() - rest.min())


def test_the_texture_is_nan_where_nothing_is_measured():
    assert math.isnan(texture(np.full((3, 3), np.nan)).sz)


@pytest.mark.parametrize('kept', [np.s_[7:8, :], np.s_[:, 9:10]])
def test_a_single_row_or_column_has_no_slope_in_the_other_direction(kept):
    heights = np.full(ROWS.shape, np.nan)
    heights[kept] = (2 * ROWS + 3 * COLUMNS)[kept]
    found = texture(heights)
    assert (found.sa, found.sq, found.sz) == pytest.approx((0, 0, 0), abs=1e-9)


def test_skewness_kurtosis_and_area_of_a_sine_wave_are_those_of_the_textbook():
    found = areal_texture(WAVE := 0.4 * np.sin(2 * np.pi * np.mgrid[:5, :6400][1] / 64), (0.5, 2.0))
    assert (found.ssk, found.sku) == pytest.approx((0.0, 1.5), abs=0.01)
    slope = 0.4 * 2 * np.pi / 32 * np.cos(np.linspace(0, 2 * np.pi, 1000))
    assert found.sdr == pytest.approx(np.mean(np.sqrt(1 + slope**2)) - 1, rel=0.01)
    assert (found.sa, found.sq, found.sz) == dataclasses.astuple(texture(WAVE))


@given(
    slopes=st.tuples(st.floats(0.1, 2), st.floats(0.1, 2)), pitch=st.tuples(st.floats(0.1, 9), st.floats(0.1, 9))
)
def test_the_area_of_pyramids_follows_from_their_slopes(slopes, pitch):
    """A surface of ramps up and down has the same slopes everywhere, and no tilt."""
    rows, columns = (np.abs(np.arange(41) % 8 - 4.0) for _ in range(2))
    heights = slopes[1] * pitch[1] * rows[:, None] + slopes[0] * pitch[0] * columns
    expected = math.sqrt(1 + slopes[0] ** 2 + slopes[1] ** 2) - 1
    assert areal_texture(heights, pitch).sdr == pytest.approx(expected)


@given(scale=st.sampled_from([1e-9, 1.0, 1e9]), offset=st.sampled_from([0.0, -7.0]))
def test_the_shape_of_the_heights_does_not_depend_on_their_unit(scale, offset):
    rough = np.random.default_rng(3).exponential(size=ROWS.shape)
    one, other = areal_texture(rough, (1, 2)), areal_texture((rough + offset) * scale, (scale, 2 * scale))
    assert (other.ssk, other.sku, other.sdr) == pytest.approx((one.ssk, one.sku, one.sdr), rel=1e-6)
    assert one.ssk > 1


def test_points_that_are_not_measured_have_no_area():
    wave = np.sin(COLUMNS)
    holes = wave.copy()
    holes[10:20, 3:9] = np.nan
    assert areal_texture(holes, (1.0, 3.0)).sdr == pytest.approx(areal_texture(wave, (1.0, 3.0)).sdr, rel=0.1)


def test_what_a_surface_does_not_have_is_nan():
    assert math.isnan(areal_texture(COLUMNS, None).sdr)
    assert math.isnan(areal_texture(np.zeros((3, 4)), (1, 1)).sku)
    assert math.isnan(areal_texture(np.full((3, 3), np.nan), (1, 1)).ssk)
    assert math.isnan(areal_texture(ROWS[:, :1], (1, 1)).sdr)
