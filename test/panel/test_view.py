"""A cloud for display: kept points are thinned, outliers are not."""

import numpy as np
import pytest
from examples import surface
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.errors import CloudError
from socialcircle_ros.messages.image import KEPT, NOT_MEASURED, OUTLIER
from socialcircle_ros.panel import colours
from socialcircle_ros.panel.view import SIDE, height_picture, mask_picture, view_of


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
    drawn = view_of(xyz, mask, most)
    outliers = np.count_nonzero(mask == OUTLIER)
    assert len(drawn.outliers) == outliers
    assert drawn.kept_total == np.count_nonzero(mask == KEPT)
    rounding = (1 + rows) * (1 + columns) - rows * columns  # each side is divided by a whole number, rounded up
    assert len(drawn.kept) <= max(most - outliers, most // 3) + rounding
    assert len(drawn.kept_colours) == len(drawn.kept)


def test_a_million_points_are_thinned_and_the_caption_says_how():
    xyz = np.dstack([*np.mgrid[:960, :1280].astype(np.float32)[::-1], np.zeros((960, 1280), np.float32)])
    drawn = view_of(xyz, masked(xyz, [(1, 1), (501, 77), (959, 1279)]))
    assert len(drawn.kept) <= 150_000
    assert len(drawn.outliers) == 3
    assert drawn.caption == (
        f'Showing {len(drawn.kept):,} of 1,228,797 kept points (1 of {drawn.step}), and all 3 outliers.'
    )


def test_a_small_cloud_is_drawn_completely():
    xyz = surface()
    drawn = view_of(xyz, masked(xyz, [(10, 12)]))
    assert drawn.step == 1
    assert drawn.caption == 'Showing all 5,593 kept points and all 1 outliers.'


@pytest.mark.parametrize('unit', [1e-6, 1.0, 1e3])
def test_the_scene_is_the_same_in_every_unit(unit):
    xyz = surface().astype(np.float64)
    mask = masked(xyz, [(10, 12)])
    drawn, scaled = view_of(xyz, mask), view_of(xyz * unit, mask)
    np.testing.assert_allclose(scaled.kept, drawn.kept, atol=1e-4)
    np.testing.assert_allclose(scaled.outliers, drawn.outliers, atol=1e-4)
    assert scaled.stretch() == drawn.stretch()
    assert np.ptp(drawn.kept[:, 0]) == pytest.approx(SIDE)


def test_flat_surfaces_are_stretched_until_their_heights_are_visible():
    xyz = surface().astype(np.float64)
    assert view_of(xyz, masked(xyz)).stretch() > 1
    xyz[..., 2] *= 1e-3
    flat = view_of(xyz, masked(xyz))
    assert 0.05 < flat.stretch() * flat.height / min(flat.size) <= 0.25
    xyz[..., 2] = 0
    assert view_of(xyz, masked(xyz)).stretch() == 1


def test_an_outlier_outside_the_scene_is_drawn_at_its_edge_and_counted():
    xyz = surface().astype(np.float64)
    xyz[3, 4, 2] = 1e9
    drawn = view_of(xyz, masked(xyz, [(3, 4), (10, 12)]))
    points, far = drawn.stretched_outliers(1.0)
    assert far == 1
    assert points[:, 2].max() == SIDE


def test_few_outliers_have_larger_marks_than_many():
    xyz = surface(200, 300)
    few = view_of(xyz, masked(xyz, [(1, 1)]))
    many = view_of(xyz, masked(xyz, [(row, column) for row in range(50) for column in range(50)]))
    assert few.outlier_size > many.outlier_size >= many.pitch


def test_a_single_measured_point_is_drawn_in_the_middle():
    xyz = np.full((4, 5, 3), np.nan)
    xyz[1, 2] = 7, 8, 9
    assert view_of(xyz, masked(xyz)).kept.tolist() == [[0, 0, 0]]


def test_a_mask_of_another_cloud_is_refused():
    with pytest.raises(CloudError, match='must be of one measurement'):
        view_of(surface(), np.zeros((3, 4), np.uint8))


def test_a_cloud_without_a_measured_point_is_refused():
    xyz = np.full((4, 5, 3), np.nan)
    with pytest.raises(CloudError, match='no measured point'):
        view_of(xyz, masked(xyz))


def test_outliers_are_drawn_where_no_point_is_kept():
    xyz = surface(20, 60)[:10]
    mask = np.full(xyz.shape[:2], OUTLIER, np.uint8)
    drawn = view_of(xyz, mask)
    assert len(drawn.outliers) == np.isfinite(xyz).all(axis=2).sum()
    assert len(drawn.kept) == 0


def test_the_pictures_show_heights_gaps_and_outliers():
    xyz = surface()
    mask = masked(xyz, [(10, 12)])
    heights, marks = height_picture(xyz, mask, (-1.0, 1.0)), mask_picture(mask)
    assert tuple(marks[10, 12]) == colours.OUTLIER
    assert tuple(marks[30, 30]) == colours.KEPT
    for picture in (heights, marks):
        assert tuple(picture[21, 1]) == colours.NOT_MEASURED
    assert tuple(heights[10, 12]) == colours.NOT_MEASURED


def test_a_single_outlier_is_visible_in_the_picture_of_a_large_mask():
    mask = np.zeros((961, 1283), np.uint8)
    mask[500, 777] = OUTLIER
    picture = mask_picture(mask)
    assert max(picture.shape[:2]) <= 400
    assert (picture == colours.OUTLIER).all(axis=2).sum() == 1
