# SPDX-License-Identifier: Apache-2.0
"""A cloud for display: kept points are thinned, outliers are not."""

import re

import numpy as np
import pytest
from examples import surface
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.errors import CloudError
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.image import KEPT, NOT_MEASURED, OUTLIER
from socialcircle_ros.messages.point_cloud import PointCloud, encode_point_cloud
from socialcircle_ros.panel.display import Display, drawing_of
from socialcircle_ros.panel.view import MOST_POINTS, SIDE, view_of


def drawing(xyz, mask, **display):
    cloud = PointCloud.decode(encode_point_cloud(Header.at(1, 'part'), xyz))
    return drawing_of(cloud, mask, Display(**display), 'm')


def view(xyz, mask, most=MOST_POINTS):
    return view_of(drawing(xyz, mask), most)


def masked(xyz, outliers=()):
    mask = np.where(np.isfinite(xyz).all(axis=2), KEPT, NOT_MEASURED).astype(np.uint8)
    for row, column in outliers:
        mask[row, column] = OUTLIER
    return mask


@given(
    rows=st.integers(2, 90),
    columns=st.integers(2, 90),
    share=st.floats(0, 1),
    most=st.integers(3, 3000),
    seed=st.integers(0, 9),
)
def test_outliers_are_never_thinned_and_the_number_of_kept_points_is_limited(rows, columns, share, most, seed):
    xyz = surface(rows, columns, seed=seed) if rows > 45 and columns > 55 else np.dstack(
        [*np.mgrid[:rows, :columns], np.random.default_rng(seed).random((rows, columns))]
    )  # fmt: skip
    mask = masked(xyz)
    mask[(np.random.default_rng(seed).random(mask.shape) < share) & (mask == KEPT)] = OUTLIER
    drawn = view(xyz, mask, most)
    outliers = np.count_nonzero(mask == OUTLIER)
    assert len(drawn.outliers) == outliers
    assert drawn.kept_total == np.count_nonzero(mask == KEPT)
    rounding = (1 + rows) * (1 + columns) - rows * columns  # each side is divided by a whole number, rounded up
    assert len(drawn.kept) <= max(most - outliers, most // 3) + rounding
    assert len(drawn.kept_colours) == len(drawn.kept)


def test_a_million_points_are_thinned_and_the_caption_says_how():
    xyz = np.dstack([*np.mgrid[:960, :1280].astype(np.float32)[::-1], np.zeros((960, 1280), np.float32)])
    drawn = view(xyz, masked(xyz, [(1, 1), (501, 77), (959, 1279)]))
    assert len(drawn.kept) <= 150_000
    assert len(drawn.outliers) == 3
    assert drawn.caption == (
        f'Showing {len(drawn.kept):,} of 1,228,797 kept points (1 of {drawn.step}), and all 3 outliers.'
    )


def test_a_small_cloud_is_drawn_completely():
    xyz = surface()
    drawn = view(xyz, masked(xyz, [(10, 12)]))
    assert drawn.step == 1
    assert drawn.caption == 'Showing all 5,593 kept points and all 1 outliers.'


@pytest.mark.parametrize('unit', [1e-6, 1.0, 1e3])
def test_the_scene_is_the_same_in_every_unit(unit):
    xyz = surface().astype(np.float64)
    mask = masked(xyz, [(10, 12)])
    drawn, scaled = view(xyz, mask), view(xyz * unit, mask)
    np.testing.assert_allclose(scaled.kept, drawn.kept, atol=1e-4)
    np.testing.assert_allclose(scaled.outliers, drawn.outliers, atol=1e-4)
    assert scaled.stretch() == drawn.stretch()
    assert np.ptp(drawn.kept[:, 0]) == pytest.approx(SIDE * 79 / 80)


def test_flat_surfaces_are_stretched_until_their_heights_are_visible():
    xyz = surface().astype(np.float64)
    assert view(xyz, masked(xyz)).stretch() > 1
    xyz[..., 2] *= 1e-3
    flat = view(xyz, masked(xyz))
    assert 0.05 < flat.stretch() * flat.height / min(flat.size) <= 0.25
    xyz[..., 2] = 0
    assert view(xyz, masked(xyz)).stretch() == 1


def test_an_outlier_outside_the_scene_is_drawn_at_its_edge_and_counted():
    xyz = surface().astype(np.float64)
    xyz[3, 4, 2] = 1e9
    drawn = view(xyz, masked(xyz, [(3, 4), (10, 12)]))
    points, far = drawn.stretched_outliers(1.0)
    assert far == 1
    assert points[:, 2].max() == SIDE


def test_few_outliers_have_larger_marks_than_many():
    xyz = surface(200, 300)
    few = view(xyz, masked(xyz, [(1, 1)]))
    many = view(xyz, masked(xyz, [(row, column) for row in range(50) for column in range(50)]))
    assert few.outlier_size > many.outlier_size >= many.pitch


def test_a_single_measured_point_is_drawn_in_the_middle():
    xyz = np.full((4, 5, 3), np.nan)
    xyz[1, 2] = 7, 8, 9
    assert view(xyz, masked(xyz)).kept.tolist() == [[0, 0, 0]]


def test_a_mask_of_another_cloud_is_refused():
    with pytest.raises(CloudError, match='must be of one measurement'):
        view(surface(), np.zeros((3, 4), np.uint8))


def test_a_cloud_without_a_measured_point_is_refused():
    xyz = np.full((4, 5, 3), np.nan)
    with pytest.raises(CloudError, match='no measured point'):
        view(xyz, masked(xyz))


def test_outliers_are_drawn_where_no_point_is_kept():
    xyz = surface(20, 60)[:10]
    mask = np.full(xyz.shape[:2], OUTLIER, np.uint8)
    drawn = view(xyz, mask)
    assert len(drawn.outliers) == np.isfinite(xyz).all(axis=2).sum()
    assert len(drawn.kept) == 0


@pytest.mark.parametrize('swapped', [False, True])
@pytest.mark.parametrize(('x_sign', 'y_sign'), [(1, 1), (-1, 1), (1, -1), (-1, -1)])
def test_row_0_is_at_the_top_and_column_0_at_the_left_whatever_the_coordinates(swapped, x_sign, y_sign):
    y, x = np.mgrid[:30, :50].astype(np.float64)
    xyz = np.dstack([x_sign * 2e-6 * x + 5, y_sign * 3e-6 * y - 7, np.sin(x + y)])
    if swapped:
        xyz = xyz[..., [1, 0, 2]]
    seen = view(xyz, masked(xyz, [(0, 0), (0, 49), (29, 0)]))
    first, right, below = seen.outliers[:, :2]
    assert first[0] < right[0]
    assert first[1] > below[1]
    assert first[1] == pytest.approx(right[1], abs=1e-3)
    assert seen.drawing.across.name == ('y' if swapped else 'x')
    for place, position in zip(seen.outlier_places, seen.outliers, strict=True):
        height = seen.drawing.heights[tuple(place)]
        np.testing.assert_allclose(seen.position(*place, height, 1.0), position, atol=1e-3)
        np.testing.assert_allclose(seen.place(*position[:2]), place, atol=1e-2)
    assert seen.drawing.across.at(0) == pytest.approx(xyz[3, 0, 1 if swapped else 0], abs=1e-8)
    assert seen.drawing.down.at(29) == pytest.approx(xyz[29, 4, 0 if swapped else 1], abs=1e-8)


@pytest.mark.parametrize('turn', [0.02, 0.5, 0.8, np.pi / 4, 1.2, 2.5, -0.4])
@pytest.mark.parametrize('mirrored', [False, True])
def test_a_cloud_turned_about_z_lies_straight_with_the_lengths_of_its_rows_and_columns(turn, mirrored):
    y, x = 3.0 * np.mgrid[:30, :50][0], 2.0 * np.mgrid[:30, :50][1]
    xyz = np.dstack([x * np.cos(turn) - y * np.sin(turn) + 5, x * np.sin(turn) + y * np.cos(turn), np.sin(x + y)])
    if mirrored:
        xyz[..., 0] *= -1
    xyz[3:9, 20:30] = np.nan
    seen = view(xyz, masked(xyz, [(0, 0), (0, 49), (29, 0), (12, 33)]))
    across, down = seen.drawing.across, seen.drawing.down
    assert (across.name, down.name) == ('along a row', 'along a column')
    assert (across.length, down.length) == pytest.approx((100.0, 90.0))
    assert (across.at(0), across.at(49), down.at(29)) == pytest.approx((0.0, 98.0, 87.0))
    first, right, _, below = seen.outliers[:, :2]
    assert first[1] == pytest.approx(right[1], abs=1e-3)
    assert first[0] == pytest.approx(below[0], abs=1e-3)
    for place, position in zip(seen.outlier_places, seen.outliers, strict=True):
        height = seen.drawing.heights[tuple(place)]
        np.testing.assert_allclose(seen.position(*place, height, 1.0), position, atol=1e-3)
        np.testing.assert_allclose(seen.place(*position[:2]), place, atol=1e-2)


@given(row=st.integers(0, 69), column=st.integers(0, 79), stretch=st.sampled_from((1.0, 5.0)))
def test_a_ray_to_a_drawn_point_from_above_finds_it(row, column, stretch):
    xyz = surface()
    seen = view(xyz, masked(xyz))
    if not np.isfinite(xyz[row, column]).all():
        return
    target = np.array(seen.position(row, column, float(xyz[row, column, 2]), stretch))
    camera = np.array([target[0], target[1], 100.0])
    found = seen.nearest(camera, target - camera, stretch)
    assert max(abs(found[0] - row), abs(found[1] - column)) <= 2


def test_a_ray_beside_an_outlier_finds_the_outlier_and_one_into_nothing_finds_nothing():
    xyz = surface()
    seen = view(xyz, masked(xyz, [(10, 12)]))
    near = np.array(seen.position(10.5, 12.5, 30.0, 1.0))
    assert seen.nearest(near + np.array([0, 0, 50]), np.array([0.0, 0.0, -1.0]), 1.0) == (10, 12)
    assert seen.nearest(np.array([0.0, 0.0, 50.0]), np.array([0.0, 0.0, 1.0]), 1.0) is None


def test_levelled_heights_have_no_tilt_and_the_outliers_do_not_tilt_them():
    y, x = np.mgrid[:40, :60].astype(np.float64)
    xyz = np.dstack([x, y, 1e6 + 3 * x - 2 * y])
    xyz[5, 7, 2] += 1000
    level = drawing(xyz, masked(xyz, [(5, 7)]), levelled=True)
    np.testing.assert_allclose(level.heights[level.kept], 0, atol=1e-6)
    assert level.heights[5, 7] == pytest.approx(1000)
    # What rounding leaves of a plane has whatever prefix.
    assert re.fullmatch(r'height of kept points \[\w?m\], 0\.5 to 99\.5 %', level.range_sentence)


def test_the_plane_of_levelled_heights_is_over_x_and_y_where_these_are_uneven():
    y, x = np.mgrid[:40, :60].astype(np.float64)
    level = drawing(xyz := np.dstack([x**1.5, y, 3 * x**1.5 - 2 * y]), masked(xyz), levelled=True)
    np.testing.assert_allclose(level.heights, 0, atol=1e-9)


def test_the_colours_span_99_percent_of_the_kept_points_or_all_of_them():
    y, x = np.mgrid[:100, :100].astype(np.float64)
    xyz = np.dstack([x, y, 100 * x + y])
    xyz[3, 4, 2] = 1e9
    mask = masked(xyz, [(3, 4)])
    robust, full = drawing(xyz, mask), drawing(xyz, mask, full_range=True)
    assert full.span == (0, 9999)
    assert robust.span == pytest.approx((50, 9949), abs=2)
    assert full.range_sentence.endswith('full range')
