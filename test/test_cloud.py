# SPDX-License-Identifier: Apache-2.0
"""What is taken as an organized cloud."""

from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros import CircleSettings, SocialCircleError, remove_outliers
from socialcircle_ros.cloud import NearestGrid, nearest_grid, organized_from
from socialcircle_ros.errors import CloudError

DATES = np.arange('2026-01-01', 64, dtype='M8[D]')
HEIGHTS = np.random.default_rng(0).normal(0, 1, (64, 70))


class Coordinate(np.ndarray):
    """An array with attributes, as an xarray coordinate has them."""


def coordinate(values, unit=None):
    array = np.asarray(values).view(Coordinate)
    array.attrs = {} if unit is None else {'units': unit}
    return array


class DataArray(np.ndarray):
    """What xarray's DataArray offers, as far as it is read here."""


def data_array(heights, y, x, unit=None, coordinate_unit=None):
    array = np.asarray(heights).view(DataArray)
    array.dims = ('y', 'x')
    array.coords = {'y': coordinate(y, coordinate_unit), 'x': coordinate(x, coordinate_unit)}
    array.attrs = {} if unit is None else {'units': unit}
    return array


@pytest.mark.parametrize('kind', [np.float32, np.float64, '>f4', '>f8'])
def test_heights_with_a_pitch_are_a_cloud(kind):
    z = HEIGHTS.astype(kind)
    cloud = organized_from(z, (0.5, 2.0))
    assert cloud.dtype == np.dtype(kind).newbyteorder('=')
    assert cloud[3, 5].tolist() == [2.5, 6.0, z[3, 5]]
    np.testing.assert_array_equal(cloud[..., 2], z)


def test_heights_give_the_result_of_their_cloud():
    y, x = np.mgrid[:64, :70].astype(float)
    cloud = np.dstack([0.5 * x, 2.0 * y, HEIGHTS])
    found, expected = remove_outliers(HEIGHTS, pitch=(0.5, 2.0)), remove_outliers(cloud)
    np.testing.assert_array_equal(found.outliers, expected.outliers)
    assert (found.seed, found.radius) == (expected.seed, expected.radius)


def test_what_is_masked_is_not_measured():
    masked = np.ma.masked_array(HEIGHTS.copy(), np.zeros(HEIGHTS.shape, bool))
    masked[10:20, 5:9] = np.ma.masked
    masked.data[10:20, 5:9] = 1e20
    result = remove_outliers(masked, pitch=(1, 1))
    assert not (result.inliers | result.outliers)[10:20, 5:9].any()
    with_nan = np.where(masked.mask, np.nan, HEIGHTS)
    np.testing.assert_array_equal(result.outliers, remove_outliers(with_nan, pitch=(1, 1)).outliers)


def test_a_masked_coordinate_makes_its_point_not_measured():
    y, x = np.mgrid[:64, :70].astype(float)
    cloud = np.ma.masked_array(np.dstack([x, y, HEIGHTS]), False)
    cloud[4, 6, 0] = np.ma.masked
    result = remove_outliers(cloud)
    assert not result.inliers[4, 6]
    assert not result.outliers[4, 6]


def test_a_data_array_brings_its_pitch():
    z = data_array(HEIGHTS, np.arange(64) * 2.0 + 7, np.arange(70) * 0.5, 'µm', 'µm')
    np.testing.assert_allclose(organized_from(z, None)[3, 5], [2.5, 6.0, HEIGHTS[3, 5]])


@pytest.mark.parametrize(
    ('value', 'sentence'),
    [
        (HEIGHTS, r'need the pitch: remove_outliers\(z, pitch=\(dx, dy\)\)'),
        (data_array(HEIGHTS, np.arange(64) ** 2, np.arange(70)), "'y' is not evenly spaced; give pitch"),
        (data_array(HEIGHTS, np.arange(64), np.arange(70), 'µm', 'mm'), "units: 'mm', 'µm'; convert them to one"),
        (data_array(HEIGHTS[:1], [0], np.arange(70)), "'y' has one value, which tells no pitch; give pitch"),
        (data_array(HEIGHTS, DATES, np.arange(70)), r"'y' has datetime64\[D\], not numbers; give pitch"),
        (data_array(HEIGHTS, list(map(str, range(64))), np.arange(70)), "'y' has <U2, not numbers; give pitch"),
        (np.zeros((4, 5, 3), int), r'convert them with np.asarray\(xyz, dtype=np.float64\)'),
        ([[[1, 2, 3]]], 'must be float32 or float64, not int64'),
        (np.zeros((4, 5, 2)), r'not \(4, 5, 2\)'),
        (np.zeros(4), r'not \(4,\)'),
        (np.zeros((0, 5, 3)), 'has no point'),
    ],
)
def test_what_is_no_cloud_is_refused_with_what_to_do(value, sentence):
    with pytest.raises(CloudError, match=sentence):
        remove_outliers(value)


@pytest.mark.parametrize(
    ('pitch', 'sentence'),
    [
        ((0, 1), 'both distances must be above 0'),
        ((1, -1), 'both distances must be above 0'),
        ((1, float('nan')), 'both distances must be above 0'),
        (3.0, 'give two numbers'),
        (('a', 'b'), 'give two numbers'),
        (0, 'give two numbers'),
        ((), 'give two numbers'),
        (np.zeros(2), 'both distances must be above 0'),
        ('12', "The pitch is '12'; give two numbers"),
        (b'12', 'give two numbers'),
        (bytearray(b'12'), 'give two numbers'),
        (('1', '2'), 'give two numbers'),
        (np.array(['1', '2']), 'give two numbers'),
        ({1.0, 2.0}, 'give two numbers'),
        ({1.0: 'x', 2.0: 'y'}, 'give two numbers'),
        ((True, True), 'give two numbers'),
        ((np.timedelta64(5), 1), 'give two numbers'),
        pytest.param((10**5000, 1), 'The pitch is a value of thousands of digits; give two numbers', id='5000'),
        pytest.param((10**400, 1), r'The pitch is \(10{1,60}…; give two numbers', id='400'),
        (np.ones((2, 1)), r'The pitch is array\(\[\[1.\], \[1.\]\]\); give two numbers'),
    ],
)
def test_another_pitch_is_refused(pitch, sentence):
    with pytest.raises(CloudError, match=sentence):
        remove_outliers(HEIGHTS, pitch=pitch)


@pytest.mark.parametrize(
    'pitch', [np.array([0.5, 2.0]), [0.5, 2], (np.float32(0.5), np.int64(2)), (Fraction(1, 2), Decimal(2))]
)
def test_the_pitch_may_be_any_two_numbers(pitch):
    found, expected = remove_outliers(HEIGHTS, pitch=pitch), remove_outliers(HEIGHTS, pitch=(0.5, 2.0))
    np.testing.assert_array_equal(found.outliers, expected.outliers)


@pytest.mark.parametrize('pitch', [(1e300, 1.0), (1.0, 1e37)])
def test_a_pitch_whose_coordinates_the_data_type_does_not_hold_is_refused(pitch):
    with pytest.raises(CloudError, match='float32 does not hold the coordinates of .* points with the pitch'):
        remove_outliers(HEIGHTS.astype(np.float32), pitch=pitch)
    assert remove_outliers(HEIGHTS.astype(np.float64), pitch=pitch).inliers.any()


def test_a_cloud_with_a_pitch_is_refused():
    with pytest.raises(CloudError, match='has x and y of its own'):
        remove_outliers(np.zeros((4, 5, 3)), pitch=(1, 1))


def test_a_list_of_numbers_is_a_cloud():
    assert organized_from([[[0.0, 0.0, 1.0], [1.0, 0.0, 1.0]]], None).shape == (1, 2, 3)


def spiked():
    z = HEIGHTS.copy()
    z[20, 30] = 99.0
    z[:2, :3] = np.nan
    return remove_outliers(z, CircleSettings(mode='adaptive'), pitch=(1, 1))


def test_a_result_says_its_counts():
    assert '64 rows × 70 columns: 4473 kept, 1 outliers, 6 not measured; seed (32, 35)' in repr(spiked())


def test_a_result_can_be_drawn():
    pytest.importorskip('matplotlib')
    figure = spiked().plot()
    drawn = figure.axes[0].images[0].get_array()
    assert (drawn[20, 30], drawn[0, 0], drawn[40, 40]) == (2, 0, 1)


def test_the_version_is_that_of_the_package():
    from importlib.metadata import version

    import socialcircle_ros

    assert socialcircle_ros.__version__ == version('socialcircle_ros')
    assert issubclass(CloudError, SocialCircleError)


STEPS = st.tuples(st.floats(-3, 3), st.floats(-3, 3))
ROWS, COLUMNS = np.mgrid[:48, :64].astype(float)


def grid_cloud(origin, column_step, row_step):
    x, y = (
        start + COLUMNS * column + ROWS * row
        for start, column, row in zip(origin, column_step, row_step, strict=True)
    )
    return np.dstack([x, y, np.zeros_like(x)])


@given(STEPS, STEPS, st.sampled_from([0.0, 1e6]), st.sampled_from([np.float32, np.float64]))
def test_the_steps_of_a_regular_grid_are_found_however_it_lies(column_step, row_step, far, kind):
    if abs(np.linalg.det([column_step, row_step])) < 0.1:
        return
    xyz = grid_cloud((far, -far), column_step, row_step).astype(kind)
    found = nearest_grid(xyz, (ROWS + COLUMNS) % 3 > 0)
    rounding = 0.01 if far and kind == np.float32 else 1e-5
    assert found.column_step == pytest.approx(column_step, abs=rounding)
    assert found.row_step == pytest.approx(row_step, abs=rounding)
    assert found.pitch == pytest.approx((np.hypot(*column_step), np.hypot(*row_step)), abs=rounding)
    assert found.holds(xyz, np.ones(ROWS.shape, bool))


def test_points_off_a_grid_are_told_from_rounding_and_from_points_that_are_not_measured():
    xyz = grid_cloud((5.0, 6.0), (1.0, 0.0), (0.0, 2.0))
    measured = np.ones(ROWS.shape, bool)
    measured[7, 9] = False
    xyz[7, 9] = np.nan
    assert nearest_grid(xyz, measured).holds(xyz, measured)
    xyz[40, 50, 0] += 1e-6
    assert not nearest_grid(xyz, measured).holds(xyz, measured)


@pytest.mark.parametrize('shape', [(30_000, 2), (2, 30_000), (30_000, 1), (200, 300)])
def test_a_grid_is_compared_with_each_point_once_whatever_the_shape(monkeypatch, shape):
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    xyz, measured = np.dstack([x, 2 * y, x]), np.ones(shape, bool)
    grid, count, numbers = NearestGrid((0.0, 0.0), (1.0, 0.0), (0.0, 2.0), is_flat=False), np.arange, []

    def counted(*args, **options):
        made = count(*args, **options)
        numbers.append(made.size)
        return made

    monkeypatch.setattr(np, 'arange', counted)
    assert grid.holds(xyz, measured)
    assert sum(numbers) <= 3 * sum(shape)
    assert len(numbers) <= 20  # blocks of many points, so that their number costs nothing
    for place in [(0, 0), (-1, -1), (shape[0] // 2, 0)]:
        moved = xyz.copy()
        moved[(*place, 1)] += 1e-3
        assert not grid.holds(moved, measured)


@pytest.mark.parametrize('axis', [0, 1])
def test_a_cloud_on_which_a_coordinate_does_not_change_has_no_grid(axis):
    xyz = grid_cloud((5.0, 6.0), (1.0, 0.0), (0.0, 2.0))
    xyz[..., axis] = 0.1
    assert nearest_grid(xyz, np.ones(ROWS.shape, bool)) is None


def test_a_single_row_has_a_step_but_no_pitch_and_a_point_has_none():
    xyz = grid_cloud((5.0, 6.0), (1.0, 0.5), (0.0, 2.0))
    row = nearest_grid(xyz, ROWS == 3)
    assert row.column_step == pytest.approx((1.0, 0.5))
    assert row.pitch is None
    assert nearest_grid(xyz, (ROWS == 3) & (COLUMNS == 4)) is None
