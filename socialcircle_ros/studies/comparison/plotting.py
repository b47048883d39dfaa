# SPDX-License-Identifier: Apache-2.0
"""What the pictures of all experiments share: PNG output, value ranges, extents, and marks on height maps."""

import io
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import HeightMap, Mask

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PlotRegion = tuple[slice, slice]
"""A rectangular part of a cloud: its rows and its columns."""
FilterMasks = list[tuple[str, Mask]]
"""Names of filters, and the points (H, W) that each removes."""

_MARK_COLOUR = '#d00000'


def as_png(figure: 'Figure') -> bytes:
    """The figure as a PNG of 256 colours.

    It has a third of the size of a full-colour PNG; the page embeds all pictures.
    """
    from PIL import Image  # noqa: PLC0415 - comes with matplotlib

    drawn, out = io.BytesIO(), io.BytesIO()
    figure.savefig(drawn, format='png')
    with Image.open(drawn) as image:
        image.convert('RGB').quantize(256, dither=Image.Dither.NONE).save(out, format='png', optimize=True)
    return out.getvalue()


def colour_range(heights: HeightMap) -> tuple[float, float]:
    """The 0.5 % and 99.5 % quantiles of the heights."""
    low, high = np.nanpercentile(heights, [0.5, 99.5])
    return float(low), float(high)


def extent_of(shape: tuple[int, ...], pitch: float) -> tuple[float, float, float, float]:
    """Left, right, bottom and top of a whole cloud, with row 0 on top."""
    return 0.0, shape[1] * pitch, shape[0] * pitch, 0.0


def box_extent(box: PlotRegion, pitch: float) -> tuple[float, float, float, float]:
    """Left, right, bottom and top of a part of a cloud."""
    rows, columns = box
    return columns.start * pitch, columns.stop * pitch, rows.stop * pitch, rows.start * pitch


def outline(axis: 'Axes', box: PlotRegion, pitch: float) -> None:
    """Draw a rectangle round the part that is shown enlarged."""
    left, right, bottom, top = box_extent(box, pitch)
    axis.plot([left, right, right, left, left], [top, top, bottom, bottom, top], color=_MARK_COLOUR, linewidth=1.5)


def red_where(mask: Mask) -> npt.NDArray[np.float64]:
    """(H, W, 4): an opaque red where the mask is True, transparent elsewhere."""
    red = np.zeros((*mask.shape, 4))
    red[mask] = (0.85, 0, 0, 1)
    return red


def densest_box(outlier: Mask, share: float = 0.18) -> PlotRegion:
    """The part of the cloud that holds most outliers; its sides are `share` of the cloud's."""
    rows, columns = (max(24, round(share * extent)) for extent in outlier.shape)
    starts = [
        (top, left)
        for top in range(0, outlier.shape[0] - rows + 1, max(1, rows // 2))
        for left in range(0, outlier.shape[1] - columns + 1, max(1, columns // 2))
    ]
    top, left = max(
        starts, key=lambda at: np.count_nonzero(outlier[at[0] : at[0] + rows, at[1] : at[1] + columns])
    )
    return slice(top, top + rows), slice(left, left + columns)
