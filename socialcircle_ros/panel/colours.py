"""Colours of heights and outliers, the same in the scene and in the pictures.

Heights run through blues and greens from dark to light; outliers are vermilion. The two stay apart for every
kind of colour blindness (held by a test).
"""

import functools
from typing import Any

import numpy as np
import numpy.typing as npt

HEIGHTS = 'YlGnBu_r'
"""A sequential map of ColorBrewer, as Matplotlib names it."""
_DARKEST, _LIGHTEST = 0.12, 0.97  # of the map: its darkest blue is lost on a dark page

OUTLIER = (255, 77, 26)
KEPT = (46, 52, 64)
NOT_MEASURED = (120, 124, 132)
ONLY_A, ONLY_B, BOTH = (230, 159, 0), (86, 180, 233), (204, 121, 167)
"""Okabe and Ito's orange, sky blue and purple: outliers of one setting, of the other, and of both."""


@functools.cache
def height_table() -> npt.NDArray[np.uint8]:
    """(256, 3): the colours from the lowest to the highest."""
    from matplotlib import colormaps  # noqa: PLC0415 - an extra

    table: npt.NDArray[np.uint8] = colormaps[HEIGHTS](np.linspace(_DARKEST, _LIGHTEST, 256), bytes=True)[:, :3]
    return table


def coloured(heights: npt.NDArray[Any], span: tuple[float, float]) -> npt.NDArray[np.uint8]:
    """The colours of heights of any shape, (..., 3); what lies beyond the span gets the colour of its end.

    Args:
        heights: finite where the colour matters; elsewhere it is that of the lowest.
        span: the lowest and the highest height that are told apart.
    """
    low, high = span
    share = (heights - low) / (high - low if high > low else 1.0)
    with np.errstate(invalid='ignore'):
        index = np.nan_to_num(np.clip(share, 0, 1) * 255).astype(np.uint8)
    return height_table()[index]
