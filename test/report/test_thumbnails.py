"""Thumbnails of clouds."""

import io

import numpy as np
import pytest
from examples import surface
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.report import thumbnails

Image = pytest.importorskip('PIL.Image')

NO_POINT, KEPT, RED, BLACK, AMBER, WHITE = (
    (255, 217, 179), (222, 222, 222), (214, 0, 0), (20, 20, 20), (240, 150, 0), (255, 255, 255),
)  # fmt: skip


def pixels(png):
    with Image.open(io.BytesIO(png)) as image:
        return np.asarray(image.convert('RGB'))


def where(png, colour):
    return (pixels(png) == colour).all(axis=2)


@given(
    shape=st.tuples(st.integers(1, 40), st.integers(1, 2 * thumbnails.PIXELS + 30)),
    place=st.tuples(st.floats(0, 0.999), st.floats(0, 0.999)),
)
def test_a_thinned_mask_still_shows_a_single_outlier(shape, place):
    outliers = np.zeros(shape, bool)
    outliers[tuple(int(share * size) for share, size in zip(place, shape, strict=True))] = True
    assert where(thumbnails.mask(np.ones(shape, bool), outliers), RED).sum() == 1


def test_a_thinned_height_map_still_shows_a_single_spike():
    heights, outliers = np.zeros((30, 1500)), np.zeros((30, 1500), bool)
    heights[:, 800:] = 1.0
    outliers[7, 701] = True
    heights[7, 701] = 99.0
    colours = thumbnails.colour_range(heights, outliers)
    assert (colours.low, colours.high) == (0, 1)
    plain = pixels(thumbnails.as_measured(heights, np.zeros_like(outliers), colours))
    shown = pixels(thumbnails.as_measured(heights, outliers, colours))
    assert (plain != shown).any(axis=2).sum() <= 1
    assert (
        where(thumbnails.as_measured(np.where(outliers, 99.0, 0.0), outliers, colours), (253, 231, 36)).sum() == 1
    )


def test_removed_and_unmeasured_points_share_one_colour():
    heights = surface()[..., 2]
    outliers = np.zeros(heights.shape, bool)
    outliers[10, 12] = True
    colours = thumbnails.colour_range(heights, outliers)
    assert (
        where(thumbnails.filtered(heights, outliers, colours), NO_POINT) == (outliers | np.isnan(heights))
    ).all()
    assert (where(thumbnails.as_measured(heights, outliers, colours), NO_POINT) == np.isnan(heights)).all()
    mask = thumbnails.mask(np.isfinite(heights), outliers)
    assert (where(mask, RED) == outliers).all()
    assert (where(mask, NO_POINT) == np.isnan(heights)).all()


def test_true_and_false_positives_and_negatives_have_their_own_colours():
    found, truth, counted, measured = (np.zeros((1, 6), bool) for _ in range(4))
    measured[0, 1:] = counted[0, 1:5] = True
    found[0, [2, 3]] = truth[0, [3, 4]] = True
    (row,) = pixels(thumbnails.against_truth(found, truth, counted, measured)).tolist()
    assert [tuple(pixel) for pixel in row] == [NO_POINT, KEPT, BLACK, RED, AMBER, WHITE]


@pytest.mark.parametrize(
    'heights', [np.full((3, 4), np.nan), np.full((3, 4), 5.0), np.array([[-3e38, 3e38]], 'f4')]
)
def test_any_finite_heights_can_be_drawn(heights):
    nothing = np.zeros(heights.shape, bool)
    for outliers in (nothing, np.isfinite(heights)):
        colours = thumbnails.colour_range(heights, outliers)
        assert pixels(thumbnails.as_measured(heights, outliers, colours)).shape == (*heights.shape, 3)
        assert pixels(thumbnails.filtered(heights, outliers, colours)).shape == (*heights.shape, 3)
