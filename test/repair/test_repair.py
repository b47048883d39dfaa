# SPDX-License-Identifier: Apache-2.0
"""The behaviour of repair_holes, and each of its methods against its slow reference."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from naive import repair as naive
from repair.surfaces import cloud, fractal, scattered_and_clustered, step_distance

from socialcircle_ros.errors import CloudError, SettingError
from socialcircle_ros.repair import repair_holes
from socialcircle_ros.settings import RepairSettings
from socialcircle_ros.settings import groups as package_settings

METHODS = ['biharmonic', 'spline']


@st.composite
def clouds_with_holes(draw, most=12):
    """A cloud in either data type, and its holes. Some points inside and outside the holes are not measured."""
    shape = draw(st.tuples(st.integers(1, most), st.integers(1, most)))
    z = draw(npst.arrays(np.int8, shape)) / 8
    step = draw(st.sampled_from([0, 64]))
    z[:, draw(st.integers(0, shape[1])) :] += step * 8
    kinds = draw(npst.arrays(np.int8, shape, elements=st.integers(0, 9)))
    xyz = cloud(z, draw(st.sampled_from([np.float32, np.float64])))
    holes = kinds < 4
    xyz[(kinds == 0) | (kinds == 4)] = np.nan
    xyz[kinds == 1, 2] = np.inf
    return xyz, holes


@st.composite
def clouds_with_flanks(draw):
    """A rough surface with a step or a groove at any angle, sharp or blurred, and holes on it and beside it."""
    height, width = draw(st.tuples(st.integers(10, 20), st.integers(10, 20)))
    distance = step_distance(height, width, draw(st.floats(0, 3.1)))
    groove, blur = draw(st.sampled_from([0, 5])), draw(st.floats(0.05, 2))
    side = groove / 2 - abs(distance) if groove else distance
    random = np.random.default_rng(draw(st.integers(0, 2**32)))
    z = 4.0 * np.tanh(side / blur) + random.normal(0, draw(st.sampled_from([0.1, 1.0])), side.shape)
    holes = random.random(side.shape) < draw(st.sampled_from([0.02, 0.1, 0.3]))
    pitch = draw(st.sampled_from([(1.25, 0.75), (2.0, 2.0), (1.0, 5.0), (3.0, 0.1)]))
    return cloud(z, draw(st.sampled_from([np.float32, np.float64])), pitch), holes


@given(
    clouds_with_holes(),
    st.sampled_from(METHODS),
    st.sampled_from([1, 2, 5, 1000]),
    st.integers(2, 4),
    st.sampled_from([0, 5, 30]),
)
def test_exactly_the_points_within_the_limits_are_filled(case, method, largest, sides, heights_agree):
    xyz, holes = case
    limits = {'largest': largest, 'sides': sides, 'heights_agree': heights_agree}
    result = repair_holes(xyz, holes, RepairSettings(method=method, **limits))
    np.testing.assert_array_equal(result.filled, naive.chosen_points(xyz, holes, **limits))
    assert np.isfinite(result.xyz[result.filled]).all()
    assert np.isnan(result.xyz[holes & ~result.filled]).all()


@given(clouds_with_holes() | clouds_with_flanks(), st.sampled_from(METHODS))
def test_heights_equal_the_reference(case, method):
    xyz, holes = case
    result = repair_holes(xyz, holes, RepairSettings(method=method, sides=2))
    expected = {'biharmonic': naive.biharmonic, 'spline': naive.spline}[method](xyz, holes)
    assert result.filled.sum() == len(expected)
    heights = [result.xyz[point][2] for point in expected]
    close = 1e-4 if xyz.dtype == np.float32 else 1e-7
    np.testing.assert_allclose(heights, list(expected.values()), rtol=close, atol=close)


@given(clouds_with_holes(), st.sampled_from(METHODS))
def test_points_outside_the_holes_are_unchanged(case, method):
    xyz, holes = case
    before = xyz.tobytes()
    result = repair_holes(xyz, holes, RepairSettings(method=method))
    assert result.xyz.dtype == xyz.dtype
    assert result.xyz[~holes].tobytes() == xyz[~holes].tobytes()
    assert not (result.filled & ~holes).any()
    assert xyz.tobytes() == before
    assert not np.shares_memory(result.xyz, xyz)


@given(clouds_with_holes(), st.sampled_from(METHODS))
def test_x_and_y_are_on_the_grid(case, method):
    xyz, holes = case
    result = repair_holes(xyz, holes, RepairSettings(method=method))
    grid = cloud(np.zeros(holes.shape))
    close = 1e-6 if xyz.dtype == np.float32 else 1e-14
    np.testing.assert_allclose(result.xyz[result.filled][:, :2], grid[result.filled][:, :2], rtol=close, atol=0)


@given(clouds_with_holes())
def test_heights_stay_within_the_stated_bound(case):
    """The bound is the span of the heights at the rim of a hole, widened by half of it on both sides."""
    xyz, holes = case
    result = repair_holes(xyz, holes)
    measured = naive.measured_heights(xyz, holes)
    for hole in naive.find_holes(holes):
        filled = [result.xyz[point][2] for point in hole if result.filled[point]]
        if filled:
            rim = naive.heights_at_rim(hole, measured)
            margin = (max(rim) - min(rim)) * 0.5 + 1e-3
            assert min(rim) - margin <= min(filled)
            assert max(filled) <= max(rim) + margin


def test_a_dome_is_filled_up_to_the_stated_bound():
    row, column = np.mgrid[-20:21, -20:21]
    holes = np.hypot(row, column) < 6
    dome = cloud(-(row**2.0 + column**2))
    result = repair_holes(dome, holes)
    rim = naive.heights_at_rim(naive.find_holes(holes)[0], naive.measured_heights(dome, holes))
    bound = max(rim) + 0.5 * (max(rim) - min(rim))
    assert bound < -1
    assert result.xyz[holes][:, 2].max() == pytest.approx(bound)


def beside_a_step():
    """A step from 0 to 10, and a wide hole next to it."""
    xyz = cloud(np.where(np.arange(80) < 30, 0.0, 10.0) * np.ones((60, 1)))
    holes = np.zeros((60, 80), bool)
    holes[2:58, 31:47] = True
    return xyz, holes


def test_a_spline_that_invents_heights_says_so():
    xyz, holes = beside_a_step()
    result = repair_holes(xyz, holes, RepairSettings(method='spline'))
    heights = result.xyz[..., 2]
    assert heights[holes].max() > 30  # the method of the paper, as it is
    np.testing.assert_array_equal(result.beyond, result.filled & (heights > 15))
    (warning,) = result.warnings
    assert f'{result.beyond.sum()} of 896 filled points are far above or below' in warning
    assert "set repair.method to 'biharmonic'" in warning


def test_a_smooth_surface_and_the_biharmonic_surface_give_no_warning():
    xyz, holes = beside_a_step()
    smooth = xyz.copy()
    smooth[..., 2] = np.sin(xyz[..., 0] / 20) + np.random.default_rng(0).normal(0, 0.01, holes.shape)
    in_steps = smooth.copy()
    in_steps[..., 2] = smooth[..., 2].round(1)  # many holes have one height all round
    scattered = scattered_and_clustered(60, 80, 1)
    for result in (
        repair_holes(xyz, holes),
        repair_holes(smooth, scattered, RepairSettings(method='spline')),
        repair_holes(in_steps, scattered, RepairSettings(method='spline')),
    ):
        assert result.filled.sum() > 100
        assert not result.beyond.any()
        assert result.warnings == ()


@given(clouds_with_holes(), st.sampled_from(METHODS))
def test_exactly_the_heights_beyond_the_stated_bounds_are_marked(case, method):
    xyz, holes = case
    result = repair_holes(xyz, holes, RepairSettings(method=method, sides=2))
    expected = naive.beyond(result.xyz, result.filled, naive.measured_heights(xyz, holes), holes)
    clear = ~np.isnan(expected)  # not within rounding of a bound
    np.testing.assert_array_equal(result.beyond[clear], expected[clear] > 0)
    assert bool(result.warnings) == bool(result.beyond.any())


@pytest.mark.parametrize('method', METHODS)
@given(holes=npst.arrays(np.bool_, (9, 11)), slopes=st.tuples(*[st.floats(-100, 100)] * 3))
def test_planes_are_reproduced(method, holes, slopes):
    rows, columns = np.mgrid[:9, :11]
    xyz = cloud(slopes[0] + slopes[1] * rows + slopes[2] * columns)
    result = repair_holes(xyz, holes, RepairSettings(method=method))
    np.testing.assert_allclose(result.xyz[result.filled], xyz[result.filled], rtol=1e-9, atol=1e-7)


@given(clouds_with_holes() | clouds_with_flanks(), st.sampled_from(METHODS))
def test_transposed_and_flipped_clouds_give_the_same_heights(case, method):
    xyz, holes = case
    limits = RepairSettings(method=method)
    result = repair_holes(xyz, holes, limits)
    turned = repair_holes(xyz.transpose(1, 0, 2), holes.T, limits)
    flipped = repair_holes(xyz[::-1, ::-1], holes[::-1, ::-1], limits)
    np.testing.assert_array_equal(turned.filled.T, result.filled)
    np.testing.assert_array_equal(flipped.filled[::-1, ::-1], result.filled)
    close = 1e-4 if xyz.dtype == np.float32 else 1e-7
    np.testing.assert_allclose(turned.xyz.transpose(1, 0, 2)[holes], result.xyz[holes], rtol=close, atol=close)
    np.testing.assert_allclose(flipped.xyz[::-1, ::-1][holes], result.xyz[holes], rtol=close, atol=close)


@pytest.mark.parametrize('method', METHODS)
def test_holes_are_filled_independently(method):
    z = fractal(30, 40, 0.8, 1.0, 5)
    first, second = np.zeros((2, 30, 40), bool)
    first[5:8, 5:9] = True
    second[5:8, 12:15] = True
    both = repair_holes(cloud(z), first | second, RepairSettings(method=method))
    alone = repair_holes(cloud(np.where(second, np.nan, z)), first, RepairSettings(method=method))
    np.testing.assert_array_equal(both.xyz[first], alone.xyz[first])


@pytest.mark.parametrize('angle', [0.0, 0.4, np.pi / 4, 1.2])
@pytest.mark.parametrize('blur', [0.5, 1.0, 2.0])
def test_blurred_groove_keeps_its_walls(angle, blur):
    z = 8.0 * np.tanh((abs(step_distance(40, 40, angle)) - 4) / blur)
    holes = step_distance(40, 40, 0) ** 2 + step_distance(40, 40, np.pi / 2) ** 2 < 5**2
    filled = repair_holes(cloud(z), holes).xyz[..., 2]
    assert np.sqrt(((filled - z)[holes] ** 2).mean()) <= 1.0  # the walls are 16 high


@pytest.mark.parametrize('angle', [0.0, 0.4, np.pi / 4, 1.2])
def test_straight_step_stays_sharp(angle):
    rows, columns = np.mgrid[:40, :40]
    side = (columns - 20) * np.cos(angle) + (rows - 20) * np.sin(angle) > 0
    z = 8.0 * side
    holes = (rows - 20) ** 2 + (columns - 20) ** 2 < 5**2
    filled = repair_holes(cloud(z), holes).xyz[..., 2]
    wrong = abs(filled - z) > 1
    assert wrong.sum() <= 0.15 * holes.sum()


@pytest.mark.parametrize('method', METHODS)
def test_hole_at_the_border_is_not_extrapolated(method):
    xyz = cloud(fractal(20, 20, 0.8, 1.0, 1))
    holes = np.zeros((20, 20), bool)
    holes[8:11, :3] = True  # open to the left: three sides, two of them opposite
    holes[:2, :2] = True  # in a corner: two sides, not opposite
    result = repair_holes(xyz, holes, RepairSettings(method=method, sides=2))
    assert result.filled[8:11, :3].all()
    assert not result.filled[:2, :2].any()
    assert not repair_holes(xyz, holes, RepairSettings(method=method, sides=4)).filled.any()


@pytest.mark.parametrize('method', METHODS)
def test_holes_without_a_rim_stay_empty(method):
    limits = RepairSettings(method=method)
    everything = repair_holes(cloud(np.ones((9, 8))), np.ones((9, 8), bool), limits)
    nothing_measured = repair_holes(np.full((9, 8, 3), np.nan), np.eye(9, 8, dtype=bool), limits)
    for result in (everything, nothing_measured):
        assert not result.filled.any()
        assert np.isnan(result.xyz).all()


@pytest.mark.parametrize('method', METHODS)
def test_cloud_of_one_row_is_filled_with_two_sides(method):
    xyz = cloud(np.array([[1.0, 9.0, 3.0, 4.0]]))
    holes = np.array([[False, True, False, False]])
    assert not repair_holes(xyz, holes, RepairSettings(method=method)).filled.any()
    result = repair_holes(xyz, holes, RepairSettings(method=method, sides=2))
    assert result.xyz[0, 1, 2] == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize('method', METHODS)
def test_cloud_of_one_point_is_not_filled(method):
    assert np.isnan(
        repair_holes(np.zeros((1, 1, 3)), np.ones((1, 1), bool), RepairSettings(method=method)).xyz
    ).all()
    assert (
        repair_holes(np.zeros((1, 1, 3)), np.zeros((1, 1), bool), RepairSettings(method=method)).xyz == 0
    ).all()


def test_finite_x_and_y_are_kept():
    xyz = cloud(np.zeros((5, 5)))
    xyz[2, 2] = 2.6, 1.4, 99
    holes = np.zeros((5, 5), bool)
    holes[2, 2] = True
    np.testing.assert_allclose(repair_holes(xyz, holes).xyz[2, 2], [2.6, 1.4, 0], atol=1e-12)


def test_largest_allowed_hole_is_filled():
    z = fractal(150, 160, 1.0, 5.0, 2)
    holes = np.zeros(z.shape, bool)
    holes[25:125, 30:130] = True
    filled = repair_holes(cloud(z), holes, RepairSettings(largest=10000))
    assert filled.filled.sum() == 10000
    assert not repair_holes(cloud(z), holes, RepairSettings(largest=9999)).filled.any()


def test_mask_of_another_shape_or_type_is_refused():
    with pytest.raises(CloudError, match=r'bool mask of the shape of the cloud \(4, 5\)'):
        repair_holes(np.zeros((4, 5, 3)), np.zeros((5, 4), bool))
    with pytest.raises(CloudError, match='not uint8'):
        repair_holes(np.zeros((4, 5, 3)), np.zeros((4, 5), np.uint8))


def test_what_is_masked_is_not_in_a_hole():
    y, x = np.mgrid[:9, :11].astype(np.float64)
    xyz, holes = np.dstack([x, y, x + y]), (y == 4) & ((x == 3) | (x == 7))
    partly = np.ma.masked_array(holes, (x == 7) | (x == 9))
    expected = repair_holes(xyz, holes & (x == 3))
    found = repair_holes(xyz, partly)
    np.testing.assert_array_equal(found.filled, expected.filled)
    np.testing.assert_array_equal(found.xyz, expected.xyz)
    assert found.filled.any()


def test_bad_settings_are_refused_with_the_allowed_values():
    with pytest.raises(SettingError, match='use one of: biharmonic, spline'):
        RepairSettings(method='bspline')
    with pytest.raises(SettingError, match='between 2 and 4'):
        RepairSettings(sides=5)
    assert all(row.sentence for row in package_settings.RepairSettings.parameters())


@pytest.mark.parametrize('dtype', [np.float32, np.float64])
def test_memory_layout_does_not_change_the_result(dtype):
    z = fractal(40, 50, 0.8, 1.0, 3)
    holes = scattered_and_clustered(40, 50, 3)
    xyz = cloud(z, dtype)
    wide = np.zeros((40, 50, 5), dtype)
    wide[..., 1:4] = xyz
    expected = repair_holes(xyz, holes)
    result = repair_holes(wide[..., 1:4], holes)
    np.testing.assert_array_equal(result.xyz, expected.xyz)
    swapped = repair_holes(xyz.astype(xyz.dtype.newbyteorder()), np.asfortranarray(holes))
    np.testing.assert_array_equal(swapped.xyz, expected.xyz)


@pytest.mark.parametrize('method', ['biharmonic', 'spline'])
def test_coordinates_whose_sums_no_float_holds_are_refused(method):
    y, x = np.mgrid[:20, :30] * 5e306
    holes = np.zeros((20, 30), bool)
    holes[8:11, 9:13] = True
    with pytest.raises(CloudError, match='x and y reach so far that float64 does not hold their sums'):
        repair_holes(np.dstack([x, y, np.zeros_like(x)]), holes, RepairSettings(method=method))
