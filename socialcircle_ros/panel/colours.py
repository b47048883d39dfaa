# SPDX-License-Identifier: Apache-2.0
"""Colours of heights and outliers, the same in the scene and in the pictures.

Heights have one of the colour maps of `MAPS`; outliers are red. A test checks that all can be told apart
with every kind of colour blindness.
"""

import functools

import numpy as np
import numpy.typing as npt

from socialcircle_ros.pictures.style import COLOUR_MAPS

MAPS = COLOUR_MAPS
"""Matplotlib's names of the colour maps for heights; the first is the default."""
_DARKEST, _LIGHTEST = 0.12, 1.0  # part of the map that is used: its darkest end vanishes on a dark page

OUTLIER = (214, 0, 0)
KEPT = (46, 52, 64)
NOT_MEASURED = (120, 124, 132)
ONLY_A, ONLY_B, BOTH = (230, 159, 0), (86, 180, 233), (204, 121, 167)
"""Outliers of A, of B, and of both: orange, sky blue and reddish purple of the palette of Okabe and Ito."""


@functools.cache
def height_table(name: str = MAPS[0]) -> npt.NDArray[np.uint8]:
    """The colours (256, 3) uint8 of a colour map, from the lowest to the highest height."""
    from matplotlib import colormaps  # noqa: PLC0415 - an extra

    table: npt.NDArray[np.uint8] = colormaps[name](np.linspace(_DARKEST, _LIGHTEST, 256), bytes=True)[:, :3]
    return table


def coloured(
    heights: npt.NDArray[np.floating], span: tuple[float, float], name: str = MAPS[0]
) -> npt.NDArray[np.uint8]:
    """Colour heights.

    Args:
        heights: (...) of any shape. A NaN gets the colour of the lowest height.
        span: the heights at the two ends of the colours. A height outside the span gets the colour of its end.
        name: of the colour map.

    Returns:
        (..., 3) uint8.
    """
    low, high = span
    share = (heights - low) / (high - low if high > low else 1.0)
    with np.errstate(invalid='ignore'):
        index = np.nan_to_num(np.clip(share, 0, 1) * 255).astype(np.uint8)
    rgb: npt.NDArray[np.uint8] = height_table(name)[index]
    return rgb
