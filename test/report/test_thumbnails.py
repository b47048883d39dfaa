"""Small pictures of clouds."""

import io

import numpy as np
import pytest
from examples import surface
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.report import thumbnails as panels

Image = pytest.importorskip('PIL.Image')

NOTHING, KEPT, RED, BLACK, AMBER, WHITE = (
    (255, 217, 179), (222, 222, 222), (214, 0, 0), (20, 20, 20), (240, 150, 0), (255, 255, 255),
)  # fmt: skip


def pixels(png):
    with Image.open(io.BytesIO(png)) as image:
        return np.asarray(image.convert('RGB'))


def where(png, colour):
    return (pixels(png) == colour).all(axis=2)


@given(
    shape=st.tuples(st.integers(1, 40), st.integers(1, 2 * panels.PIXELS + 30)),
    place=st.tuples(st.floats(0, 0.999), st.floats(0, 0.999)),
)
def test_a_single_outlier_is_seen_in_the_mask_however_much_is_skipped(shape, place):
    outliers = np.zeros(shape, bool)
    outliers[tuple(int(share * size) for share, size in zip(place, shape, strict=True))] = True
    assert where(panels.mask(np.ones(shape, bool), outliers), RED).sum() == 1


def test_a_single_spike_is_seen_among_the_heights_however_much_is_skipped():
    heights, outliers = np.zeros((30, 1500)), np.zeros((30, 1500), bool)
    heights[:, 800:] = 1.0
    outliers[7, 701] = True
    heights[7, 701] = 99.0
    scale = panels.colour_range(heights, outliers)
    assert (scale.low, scale.high) == (0, 1)
    plain = pixels(panels.as_measured(heights, np.zeros_like(outliers), scale))
    shown = pixels(panels.as_measured(heights, outliers, scale))
    assert (plain != shown).any(axis=2).sum() <= 1
    assert where(panels.as_measured(np.where(outliers, 99.0, 0.0), outliers, scale), (253, 231, 36)).sum() == 1


def test_what_was_removed_and_what_was_not_measured_have_the_colour_of_nothing():
    heights = surface()[..., 2]
    outliers = np.zeros(heights.shape, bool)
    outliers[10, 12] = True
    scale = panels.colour_range(heights, outliers)
    assert (where(panels.cleaned(heights, outliers, scale), NOTHING) == (outliers | np.isnan(heights))).all()
    assert (where(panels.as_measured(heights, outliers, scale), NOTHING) == np.isnan(heights)).all()
    mask = panels.mask(np.isfinite(heights), outliers)
    assert (where(mask, RED) == outliers).all()
    assert (where(mask, NOTHING) == np.isnan(heights)).all()


def test_right_and_wrong_are_told_apart():
    found, truth, counted, measured = (np.zeros((1, 6), bool) for _ in range(4))
    measured[0, 1:] = counted[0, 1:5] = True
    found[0, [2, 3]] = truth[0, [3, 4]] = True
    (row,) = pixels(panels.judged(found, truth, counted, measured)).tolist()
    assert [tuple(pixel) for pixel in row] == [NOTHING, KEPT, BLACK, RED, AMBER, WHITE]


@pytest.mark.parametrize(
    'heights', [np.full((3, 4), np.nan), np.full((3, 4), 5.0), np.array([[-3e38, 3e38]], 'f4')]
)
def test_any_heights_can_be_drawn(heights):
    none = np.zeros(heights.shape, bool)
    for outliers in (none, np.isfinite(heights)):
        scale = panels.colour_range(heights, outliers)
        assert pixels(panels.as_measured(heights, outliers, scale)).shape == (*heights.shape, 3)
        assert pixels(panels.cleaned(heights, outliers, scale)).shape == (*heights.shape, 3)
