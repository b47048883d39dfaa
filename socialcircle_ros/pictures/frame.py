# SPDX-License-Identifier: Apache-2.0
"""Where a cloud lies: the extent of its picture, its axes and its scale bar."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Cloud, HeightMap, Mask
from socialcircle_ros.lengths import NOT_KNOWN, LengthScale, length_scale

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MapExtent = tuple[float, float, float, float]
"""Left, right, bottom and top of a picture in the unit of the cloud; the first row is at the top."""

_MOST_STRETCHED = 6.0  # longer clouds are stretched to this ratio, so that they can be seen
_BAR_SHARE = 0.25  # of the width: the longest scale bar


@dataclass(frozen=True)
class MapFrame:
    """The place of a cloud in its pictures.

    Attributes:
        extent: of the picture; in points where the cloud has no x and y that grow along its rows and columns.
        scale: of x and y; None: the axes count points.
    """

    extent: MapExtent
    scale: LengthScale | None

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
        """Whether x and y are drawn with the same scale."""
        return self.scale is not None and 1 / _MOST_STRETCHED <= self.ratio <= _MOST_STRETCHED

    def put_on(self, axes: 'Axes') -> None:
        """Label the axes, and draw a scale bar where x and y have the same scale."""
        if self.scale is None:
            axes.set(xlabel='column', ylabel='row')
        else:
            self.scale.label_axis(axes.xaxis, 'x')
            self.scale.label_axis(axes.yaxis, 'y')
        axes.locator_params(nbins=6)
        if self.is_to_scale:
            axes.set_aspect('equal')
            self._draw_bar(axes)
        else:
            axes.set_aspect('auto')
            write_on_map(axes, 0.02, 0.03, 'x and y not to the same scale', fontsize=6)

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

    Args:
        xyz: (H, W, 3).
        measured: (H, W) the measured points.
        unit: of the coordinates; None: not known.
    """
    height, width, _ = xyz.shape
    x = _edges(np.where(measured, xyz[..., 0], np.nan), axis=0)
    y = _edges(np.where(measured, xyz[..., 1], np.nan), axis=1)
    if x is None or y is None:
        return MapFrame((-0.5, width - 0.5, height - 0.5, -0.5), None)
    return MapFrame((*x, y[1], y[0]), length_scale([x[1] - x[0], y[1] - y[0]], unit))


def _edges(values: HeightMap, axis: int) -> tuple[float, float] | None:
    """The coordinate at the outer edges of the first and the last column (axis 0) or row (axis 1).

    None if the coordinate does not change from column to column, or from row to row.
    """
    some = values[:: max(1, values.shape[0] // 64)] if axis == 0 else values[:, :: max(1, values.shape[1] // 64)]
    found = np.isfinite(some)
    counts = found.sum(axis=axis)
    places = np.flatnonzero(counts)
    if len(places) < 2:
        return None
    sums = np.where(found, some, 0.0).astype(np.float64).sum(axis=axis)
    means: npt.NDArray[np.float64] = sums[places] / counts[places]
    pitch, start = np.polyfit(places, means - means[0], 1)
    # A cloud whose x changes along its columns as much as along its rows is not drawn in its coordinates.
    if abs(pitch) * (len(counts) - 1) <= 1e-9 * max(1e-300, float(np.abs(means).max())):
        return None
    first = float(start + means[0])
    return first - 0.5 * float(pitch), first + (len(counts) - 0.5) * float(pitch)


def _round_number(most: float) -> float:
    """The largest of 1, 2, 5, 10, … that is not above a number."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(max(digit * power for digit in (1, 2, 5) if digit * power <= most * (1 + 1e-9)))
