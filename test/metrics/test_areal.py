# SPDX-License-Identifier: Apache-2.0
"""Areal surface texture: Sa, Sq, Sz, Ssk, Sku and Sdr."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from naive import areal as naive

from socialcircle_ros.cloud import organized_from
from socialcircle_ros.metrics.areal import areal_texture, levelled_heights, texture

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


@pytest.mark.parametrize('x', [COLUMNS, COLUMNS**1.5], ids=['even', 'uneven'])
def test_levelled_heights_are_those_of_the_texture_and_outliers_have_theirs(x):
    rough = np.random.default_rng(1).normal(size=ROWS.shape)
    plane = 5e3 + 0.3 * x - 0.2 * ROWS
    kept = np.random.default_rng(2).random(ROWS.shape) < 0.9
    xyz = np.dstack([x, ROWS, plane + np.where(kept, rough, 40.0)])
    xyz[3, 4, 0] = np.inf
    xyz[5, 6, 2] = np.nan
    found = levelled_heights(xyz, kept)
    measured = np.isfinite(xyz).all(axis=2)
    np.testing.assert_array_equal(np.isfinite(found), measured)
    assert np.abs(found[kept & measured]).mean() == pytest.approx(texture(xyz, kept).sa, rel=1e-9)
    np.testing.assert_allclose(found[measured & ~kept], 40, atol=0.3)  # the plane through the noise


def test_heights_of_two_points_have_no_plane():
    xyz = np.dstack([COLUMNS, ROWS, ROWS])
    kept = np.zeros(ROWS.shape, bool)
    kept[0, :2] = True
    np.testing.assert_array_equal(levelled_heights(xyz, kept), ROWS)


def test_what_is_masked_does_not_count():
    rough = np.random.default_rng(1).normal(size=ROWS.shape)
    spikes = np.random.default_rng(2).random(ROWS.shape) < 0.1
    heights = np.where(spikes, 99.0, rough)
    expected = texture(np.where(spikes, np.nan, rough))
    assert texture(np.ma.masked_array(heights, spikes)) == expected
    assert texture(heights, np.ma.masked_array(np.ones(ROWS.shape, bool), spikes)) == expected
    xyz = np.dstack([COLUMNS, ROWS, heights])
    assert texture(np.ma.masked_array(xyz, spikes[..., None].repeat(3, axis=2))) == expected


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


@pytest.mark.parametrize('coordinate', [0, 1, 2])
def test_a_point_without_one_of_its_coordinates_is_not_measured(coordinate):
    xyz = np.dstack([COLUMNS, ROWS, np.random.default_rng(1).normal(size=ROWS.shape)])
    without = xyz.copy()
    xyz[20, 30, coordinate], without[20, 30] = np.nan, np.nan
    assert areal_texture(xyz) == areal_texture(without)


def test_the_texture_is_nan_where_nothing_is_measured():
    assert math.isnan(texture(np.full((3, 3), np.nan)).sz)


@pytest.mark.parametrize('kept', [np.s_[7:8, :], np.s_[:, 9:10]])
def test_a_single_row_or_column_has_no_slope_in_the_other_direction(kept):
    heights = np.full(ROWS.shape, np.nan)
    heights[kept] = (2 * ROWS + 3 * COLUMNS)[kept]
    found = texture(heights)
    assert (found.sa, found.sq, found.sz) == pytest.approx((0, 0, 0), abs=1e-9)


def test_skewness_kurtosis_and_area_of_a_sine_wave_are_those_of_the_textbook():
    found = on_grid(WAVE := 0.4 * np.sin(2 * np.pi * np.mgrid[:5, :6400][1] / 64), (0.5, 2.0))
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
    assert on_grid(heights, pitch).sdr == pytest.approx(expected)


@given(scale=st.sampled_from([1e-9, 1.0, 1e9]), offset=st.sampled_from([0.0, -7.0]))
def test_the_shape_of_the_heights_does_not_depend_on_their_unit(scale, offset):
    rough = np.random.default_rng(3).exponential(size=ROWS.shape)
    one, other = on_grid(rough, (1, 2)), on_grid((rough + offset) * scale, (scale, 2 * scale))
    assert (other.ssk, other.sku, other.sdr) == pytest.approx((one.ssk, one.sku, one.sdr), rel=1e-6)
    assert one.ssk > 1


def test_points_that_are_not_measured_have_no_area():
    wave = np.sin(COLUMNS)
    holes = wave.copy()
    holes[10:20, 3:9] = np.nan
    assert on_grid(holes, (1.0, 3.0)).sdr == pytest.approx(on_grid(wave, (1.0, 3.0)).sdr, rel=0.1)


def test_what_a_surface_does_not_have_is_nan():
    assert math.isnan(areal_texture(COLUMNS).sdr)
    assert math.isnan(on_grid(np.zeros((3, 4)), (1, 1)).sku)
    assert math.isnan(on_grid(np.full((3, 3), np.nan), (1, 1)).ssk)
    assert math.isnan(on_grid(ROWS[:, :1], (1, 1)).sdr)


def clouds(*, regular):
    """A rough, tilted cloud with holes; x and y are uneven, or a grid that may be turned or oblique."""

    @st.composite
    def cloud(draw):
        rows, columns = np.mgrid[: draw(st.integers(4, 12)), : draw(st.integers(4, 12))].astype(float)
        random = np.random.default_rng(draw(st.integers(0, 2**32)))
        steps = st.floats(0.2, 5), st.floats(0.2, 5)
        if not regular:
            columns, rows = (values**1.5 + random.normal(0, 0.1, rows.shape) for values in (columns, rows))
        turn, oblique = draw(st.floats(-3, 3)), draw(st.floats(-0.5, 0.5))
        along, down = draw(steps[0]) * columns, draw(steps[1]) * rows
        along += oblique * down
        x, y = along * np.cos(turn) - down * np.sin(turn), along * np.sin(turn) + down * np.cos(turn)
        z = draw(st.floats(-1, 1)) * x + draw(st.floats(-1, 1)) * y + random.normal(size=x.shape)
        offset = draw(st.sampled_from([0.0, -300.0]))
        xyz = np.dstack([x + offset, y - offset, z]).astype(draw(st.sampled_from([np.float32, np.float64])))
        xyz[random.random(x.shape) < draw(st.sampled_from([0.0, 0.2]))] = np.nan
        return xyz, random.random(x.shape) < 0.9

    return cloud()


@given(clouds(regular=False) | clouds(regular=True))
def test_plane_and_area_are_those_over_x_and_y_of_the_kept_points(case):
    xyz, kept = case
    found = areal_texture(xyz, kept)
    expected = naive.areal_texture(xyz.astype(float), kept)
    assert dataclasses.astuple(found) == pytest.approx(expected, rel=2e-3, abs=2e-4, nan_ok=True)
    assert dataclasses.astuple(texture(xyz, kept)) == (found.sa, found.sq, found.sz)


@given(clouds(regular=True))
def test_on_a_regular_grid_the_plane_is_bit_for_bit_that_over_rows_and_columns(case):
    xyz, kept = case
    assert texture(xyz, kept) == texture(np.where(kept, xyz[..., 2], np.nan))


@pytest.mark.parametrize('dtype', [np.float32, np.float64])
def test_a_turn_or_a_far_origin_changes_no_value(dtype):
    rough = np.random.default_rng(4).normal(size=ROWS.shape) + COLUMNS
    expected = dataclasses.astuple(on_grid(rough, (1, 2)))
    for angle in (0.3, math.pi / 4, math.pi / 2, 3.0):
        for far in (0.0, 1e6):
            x = COLUMNS * np.cos(angle) - 2 * ROWS * np.sin(angle) + far
            y = COLUMNS * np.sin(angle) + 2 * ROWS * np.cos(angle) - far
            xyz = np.dstack([x, y, rough]).astype(dtype)
            assert dataclasses.astuple(areal_texture(xyz)) == pytest.approx(expected, rel=1e-3, abs=1e-4)


def test_an_uneven_pitch_makes_no_roughness_of_a_tilt_far_from_the_origin():
    x = COLUMNS**1.5
    for dtype, error in ((np.float32, 0.1), (np.float64, 1e-8)):
        found = texture(np.dstack([x + 1e6, ROWS, 0.2 * x]).astype(dtype))
        assert found.sz < error  # rounding of x in float32 is 0.03


@pytest.mark.parametrize('y', [ROWS, 2 * ROWS + COLUMNS, ROWS**2 + 0.1 * COLUMNS, np.zeros(ROWS.shape)])
def test_where_all_x_are_equal_the_plane_is_that_over_rows_and_columns(y):
    rough = np.random.default_rng(5).normal(size=ROWS.shape) + 0.5 * COLUMNS
    xyz = np.dstack([np.full(ROWS.shape, 7.1), y, rough])
    found = areal_texture(xyz)
    assert (found.sa, found.sq, found.sz) == dataclasses.astuple(texture(rough))
    assert math.isnan(found.sdr)


def test_an_uneven_row_alone_is_levelled_over_its_own_x():
    kept = ROWS == 7
    x = COLUMNS**1.5
    found = areal_texture(np.dstack([x, ROWS, 3 * x]), kept)
    assert found.sz == pytest.approx(0, abs=1e-9)
    assert math.isnan(found.sdr)


def on_grid(heights, pitch):
    return areal_texture(organized_from(heights, pitch))
