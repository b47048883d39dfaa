"""Areal surface texture: Sa, Sq and Sz."""

import math

import numpy as np
import pytest

from socialcircle_ros.metrics.areal import texture

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
