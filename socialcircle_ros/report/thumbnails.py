"""Small height maps and masks for pages of many measurements: drawn point by point, in milliseconds, without axes.

What one cloud takes here, a drawn figure takes a hundredfold; `pictures` has those.
"""

import io
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask
from socialcircle_ros.errors import SocialCircleError

from .pictures import NEEDED, any_in_tile, over_tiles, thinned

PIXELS = 480
"""Most pixels along the longer side; what does not fit is skipped, except outliers."""

_LEVELS = 120  # of heights: as many as the eye tells apart, and half the size of 256
_NOTHING, _KEPT, _RED, _GOOD_LOST, _MISSED, _UNCOUNTED = range(_LEVELS, _LEVELS + 6)
_COLOURS = {
    _NOTHING: (255, 217, 179),
    _KEPT: (222, 222, 222),
    _RED: (214, 0, 0),
    _GOOD_LOST: (20, 20, 20),
    _MISSED: (240, 150, 0),
    _UNCOUNTED: (255, 255, 255),
}


@dataclass(frozen=True)
class ColourRange:
    """The heights between which the colours run."""

    low: float
    high: float


def colour_range(heights: npt.NDArray[Any], outliers: Mask) -> ColourRange:
    """The range of the kept heights but for the outer hundredth, so that outliers do not flatten the rest.

    Args:
        heights: (H, W), NaN where not measured.
        outliers: (H, W) what was removed.
    """
    there = thinned(heights, PIXELS)
    kept = there[np.isfinite(there) & ~thinned(outliers, PIXELS)]
    if not kept.size:
        kept = there[np.isfinite(there)]
    if not kept.size:
        return ColourRange(0.0, 1.0)
    # In double precision: heights near the limits of float32 have differences beyond them.
    low, high = np.percentile(kept.astype(np.float64), [0.5, 99.5])
    return ColourRange(float(low), float(high))


def as_measured(heights: npt.NDArray[Any], outliers: Mask, scale: ColourRange) -> bytes:
    """A PNG of the heights; of a tile that holds outliers the highest of them is shown.

    Args:
        heights: (H, W), NaN where not measured.
        outliers: (H, W) what was removed.
        scale: of the colours.
    """
    shown = thinned(heights, PIXELS)
    highest = over_tiles(np.maximum, np.where(outliers, heights, -np.inf), PIXELS)
    return _png(_levels(np.where(np.isfinite(highest), highest, shown), scale))


def cleaned(heights: npt.NDArray[Any], outliers: Mask, scale: ColourRange) -> bytes:
    """A PNG of the heights that were kept; what was removed has the colour of what is not measured."""
    return _png(_levels(np.where(thinned(outliers, PIXELS), np.nan, thinned(heights, PIXELS)), scale))


def mask(measured: Mask, outliers: Mask) -> bytes:
    """A PNG of the outlier mask: kept gray, removed red, not measured in orange."""
    pixels = np.where(thinned(measured, PIXELS), np.uint8(_KEPT), np.uint8(_NOTHING))
    pixels[any_in_tile(outliers, PIXELS)] = _RED
    return _png(pixels)


def judged(found: Mask, truth: Mask, counted: Mask, measured: Mask) -> bytes:
    """A PNG of a mask against the truth: kept gray, removed rightly red, wrongly black, missed amber.

    Args:
        found: (H, W) what was removed.
        truth: (H, W) the outliers.
        counted: (H, W) the points whose truth is certain; others white where they were kept.
        measured: (H, W) the points that are measured.
    """
    pixels = np.where(thinned(measured, PIXELS), np.uint8(_KEPT), np.uint8(_NOTHING))
    pixels[thinned(measured & ~counted, PIXELS)] = _UNCOUNTED
    # What is wrong comes last: it is what one looks for.
    for where, colour in (
        (found & truth, _RED),
        (counted & ~found & truth, _MISSED),
        (counted & found & ~truth, _GOOD_LOST),
    ):
        pixels[any_in_tile(where, PIXELS)] = colour
    return _png(pixels)


def colour_bar() -> bytes:
    """A PNG of the colours from low to high, for beside the pictures."""
    return _png(np.tile(np.arange(_LEVELS, dtype=np.uint8), (8, 1)))


def _levels(heights: npt.NDArray[Any], scale: ColourRange) -> npt.NDArray[np.uint8]:
    """Heights as indices of colours."""
    span = scale.high - scale.low or 1.0
    there = np.isfinite(heights)
    share = (np.where(there, heights, scale.low).astype(np.float64) - scale.low) / span
    level = np.clip(share * _LEVELS, 0, _LEVELS - 1).astype(np.uint8)
    return np.where(there, level, np.uint8(_NOTHING))


@cache
def _palette() -> bytes:
    """Red, green and blue of each index.

    Raises:
        SocialCircleError: matplotlib is not installed.
    """
    try:
        from matplotlib import colormaps  # noqa: PLC0415 - an extra
    except ImportError:
        raise SocialCircleError(NEEDED) from None
    heights = colormaps['viridis'](np.linspace(0, 1, _LEVELS), bytes=True)[:, :3]
    return bytes(heights.ravel().tolist()) + bytes(value for colour in _COLOURS.values() for value in colour)


def _png(indices: npt.NDArray[np.uint8]) -> bytes:
    palette = _palette()
    from PIL import Image  # noqa: PLC0415 - comes with matplotlib

    image, out = Image.fromarray(indices), io.BytesIO()
    image.putpalette(palette)
    image.save(out, format='png', compress_level=3)
    return out.getvalue()
