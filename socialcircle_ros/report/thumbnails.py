"""Small height maps and masks for pages with many clouds, without axes.

Each is one palette PNG and takes milliseconds, about a hundredth of a matplotlib figure (see `pictures`).
"""

import io
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import HeightMap, Mask

from .pictures import any_in_tile, no_matplotlib, over_tiles, thinned

PIXELS = 480
"""Most pixels along the longer side. Larger clouds are thinned; outliers are always drawn."""

_LEVELS = 120  # of heights: more cannot be told apart by eye, and 256 would double the size of the page
_NO_POINT, _KEPT, _OUTLIER, _FALSE_POSITIVE, _FALSE_NEGATIVE, _NOT_COUNTED = range(_LEVELS, _LEVELS + 6)
_COLOURS = {
    _NO_POINT: (255, 217, 179),
    _KEPT: (222, 222, 222),
    _OUTLIER: (214, 0, 0),
    _FALSE_POSITIVE: (20, 20, 20),
    _FALSE_NEGATIVE: (240, 150, 0),
    _NOT_COUNTED: (255, 255, 255),
}


@dataclass(frozen=True)
class ColourRange:
    """The heights of the first and the last colour, in the unit of the cloud."""

    low: float
    high: float


def colour_range(heights: HeightMap, outliers: Mask) -> ColourRange:
    """Choose the colour range of a cloud: the kept heights without their outer 1 %.

    Outliers do not count, because they would leave few colours for the surface.

    Args:
        heights: (H, W), NaN where not measured.
        outliers: (H, W) the removed points.
    """
    few = thinned(heights, PIXELS)
    kept = few[np.isfinite(few) & ~thinned(outliers, PIXELS)]
    if not kept.size:
        kept = few[np.isfinite(few)]
    if not kept.size:
        return ColourRange(0.0, 1.0)
    # In double precision, because differences of heights near the limits of float32 overflow.
    low, high = np.percentile(kept.astype(np.float64), [0.5, 99.5])
    return ColourRange(float(low), float(high))


def as_measured(heights: HeightMap, outliers: Mask, colours: ColourRange) -> bytes:
    """Draw the heights with all outliers; a thinned tile shows its highest outlier.

    Args:
        heights: (H, W), NaN where not measured.
        outliers: (H, W) the removed points.
        colours: the range of the colours.

    Returns:
        A PNG.
    """
    highest = over_tiles(np.maximum, np.where(outliers, heights, -np.inf), PIXELS)
    return _png(_levels(np.where(np.isfinite(highest), highest, thinned(heights, PIXELS)), colours))


def filtered(heights: HeightMap, outliers: Mask, colours: ColourRange) -> bytes:
    """Draw the kept heights; removed points look like points that are not measured.

    Args:
        heights: (H, W), NaN where not measured.
        outliers: (H, W) the removed points.
        colours: the range of the colours.

    Returns:
        A PNG.
    """
    return _png(_levels(np.where(thinned(outliers, PIXELS), np.nan, thinned(heights, PIXELS)), colours))


def mask(measured: Mask, outliers: Mask) -> bytes:
    """Draw an outlier mask: kept gray, outliers red, not measured orange.

    Args:
        measured: (H, W) the measured points.
        outliers: (H, W) the removed points.

    Returns:
        A PNG.
    """
    pixels = np.where(thinned(measured, PIXELS), np.uint8(_KEPT), np.uint8(_NO_POINT))
    pixels[any_in_tile(outliers, PIXELS)] = _OUTLIER
    return _png(pixels)


def against_truth(found: Mask, truth: Mask, counted: Mask, measured: Mask) -> bytes:
    """Draw an outlier mask against the truth.

    True positives are red, false positives black, false negatives amber, other kept points gray. Kept points
    without a certain truth are white.

    Args:
        found: (H, W) the removed points.
        truth: (H, W) the outliers.
        counted: (H, W) the points with a certain truth.
        measured: (H, W) the measured points.

    Returns:
        A PNG.
    """
    pixels = np.where(thinned(measured, PIXELS), np.uint8(_KEPT), np.uint8(_NO_POINT))
    pixels[thinned(measured & ~counted, PIXELS)] = _NOT_COUNTED
    # Errors are drawn last, because a thinned tile shows what was drawn last, and readers look for errors.
    for where, colour in (
        (found & truth, _OUTLIER),
        (counted & ~found & truth, _FALSE_NEGATIVE),
        (counted & found & ~truth, _FALSE_POSITIVE),
    ):
        pixels[any_in_tile(where, PIXELS)] = colour
    return _png(pixels)


def colour_bar() -> bytes:
    """Draw the colours from low to high, as a PNG.

    Raises:
        SocialCircleError: matplotlib is not installed.
    """
    return _png(np.tile(np.arange(_LEVELS, dtype=np.uint8), (8, 1)))


def _levels(heights: HeightMap, colours: ColourRange) -> npt.NDArray[np.uint8]:
    """Heights as indices into the palette."""
    span = colours.high - colours.low or 1.0
    finite = np.isfinite(heights)
    share = (np.where(finite, heights, colours.low).astype(np.float64) - colours.low) / span
    level = np.clip(share * _LEVELS, 0, _LEVELS - 1).astype(np.uint8)
    return np.where(finite, level, np.uint8(_NO_POINT))


@cache
def _palette() -> bytes:
    """Red, green and blue of each index.

    Raises:
        SocialCircleError: matplotlib is not installed.
    """
    try:
        from matplotlib import colormaps  # noqa: PLC0415 - an extra
    except ImportError:
        raise no_matplotlib() from None
    heights = colormaps['viridis'](np.linspace(0, 1, _LEVELS), bytes=True)[:, :3]
    return bytes(heights.ravel().tolist()) + bytes(value for colour in _COLOURS.values() for value in colour)


def _png(indices: npt.NDArray[np.uint8]) -> bytes:
    palette = _palette()
    from PIL import Image  # noqa: PLC0415 - comes with matplotlib

    image, out = Image.fromarray(indices), io.BytesIO()
    image.putpalette(palette)
    image.save(out, format='png', compress_level=3)
    return out.getvalue()
