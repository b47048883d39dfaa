# SPDX-License-Identifier: Apache-2.0
"""Where a cloud lies: the extent of its picture, its axes and its scale bar."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from socialcircle_ros.cloud import Cloud, Mask, nearest_grid
from socialcircle_ros.lengths import NOT_KNOWN, LengthScale, length_scale

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MapExtent = tuple[float, float, float, float]
"""Left, right, bottom and top of a picture in the unit of the cloud; the first row is at the top."""

_MOST_STRETCHED = 6.0  # longer clouds are stretched to this ratio, so that they can be seen
_STRAIGHT = 0.01  # sine of the turn about z up to which x and y are the axes: lengths differ by less than 0.01 %
_X_AND_Y = ('x', 'y')
_BAR_SHARE = 0.25  # of the width: the longest scale bar


@dataclass(frozen=True)
class MapFrame:
    """The place of a cloud in its pictures.

    Attributes:
        extent: of the picture; in points where the cloud has no x and y that tell its rows and columns apart.
        scale: of the axes; None: they count points.
        names: of the two axes, if they have a scale.
    """

    extent: MapExtent
    scale: LengthScale | None
    names: tuple[str, str] = _X_AND_Y

    @property
    def ratio(self) -> float:
        """Width divided by height."""
        left, right, bottom, top = self.extent
        return abs(right - left) / abs(bottom - top)

    @property
    def ratio_drawn(self) -> float:
        """Width divided by height of the picture."""
        return min(max(self.ratio, 1 / _MOST_STRETCHED), _MOST_STRETCHED)

    @property
    def is_to_scale(self) -> bool:
        """Whether both axes are drawn with the same scale."""
        return self.scale is not None and 1 / _MOST_STRETCHED <= self.ratio <= _MOST_STRETCHED

    def put_on(self, axes: 'Axes') -> None:
        """Label the axes, and draw a scale bar where both axes have the same scale."""
        if self.scale is None:
            axes.set(xlabel='column', ylabel='row')
        else:
            self.scale.label_axis(axes.xaxis, self.names[0])
            self.scale.label_axis(axes.yaxis, self.names[1])
        axes.locator_params(nbins=6)
        if self.is_to_scale:
            axes.set_aspect('equal')
            self._draw_bar(axes)
        else:
            axes.set_aspect('auto')
            write_on_map(axes, 0.02, 0.03, 'axes not to the same scale', fontsize=6)

    def _draw_bar(self, axes: 'Axes') -> None:
        if self.scale is None:
            return
        left, right, _, _ = self.extent
        width = abs(right - left) * self.scale.factor
        length = _round_number(_BAR_SHARE * width)
        share = length / width
        axes.plot([0.04, 0.04 + share], [0.06, 0.06], transform=axes.transAxes, color='white', lw=4, zorder=5)
        axes.plot([0.04, 0.04 + share], [0.06, 0.06], transform=axes.transAxes, color='black', lw=2, zorder=6)
        text = f'{length:g}' if self.scale.name.endswith(NOT_KNOWN) else f'{length:g} {self.scale.name}'
        write_on_map(axes, 0.04, 0.085, text, fontsize=7)


def write_on_map(axes: 'Axes', across: float, up: float, text: str, *, fontsize: float) -> None:
    """Write on a map, at shares of its width and height, on a light ground."""
    ground = {'facecolor': 'white', 'alpha': 0.75, 'edgecolor': 'none', 'pad': 1.0}
    axes.text(across, up, text, transform=axes.transAxes, fontsize=fontsize, va='bottom', zorder=6, bbox=ground)


def frame_of(xyz: Cloud, measured: Mask, unit: str | None) -> MapFrame:
    """Find the place of a cloud.

    The axes are x and y where x grows along rows and y along columns. Where the cloud is turned about z, they are
    the distances along a row and along a column, so that lengths are right. Uneven points have a mean distance.

    Args:
        xyz: (H, W, 3).
        measured: (H, W) the measured points.
        unit: of the coordinates; None: not known.
    """
    height, width, _ = xyz.shape
    grid = nearest_grid(xyz, measured)
    pitch = None if grid is None else grid.pitch
    if grid is None or pitch is None:
        return MapFrame((-0.5, width - 0.5, height - 0.5, -0.5), None)
    (column_x, column_y), (row_x, row_y) = grid.column_step, grid.row_step
    if abs(column_y) <= _STRAIGHT * abs(column_x) and abs(row_x) <= _STRAIGHT * abs(row_y):
        names, starts, steps = _X_AND_Y, grid.origin, (column_x, row_y)
    else:
        names, starts, steps = ('along a row', 'along a column'), (0.0, 0.0), pitch
    (left, right), (top, bottom) = (
        (start - 0.5 * step, start + (count - 0.5) * step)
        for start, step, count in zip(starts, steps, (width, height), strict=True)
    )
    return MapFrame((left, right, bottom, top), length_scale([right - left, bottom - top], unit), names)


def _round_number(most: float) -> float:
    """The largest of 1, 2, 5, 10, … that is not above a number."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(max(digit * power for digit in (1, 2, 5) if digit * power <= most * (1 + 1e-9)))
