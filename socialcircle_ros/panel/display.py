# SPDX-License-Identifier: Apache-2.0
"""How a cloud is displayed: which values the colours show, in which range, and how rows and columns lie. No viser.

Scene and map agree: columns go to the right and rows go down, as in the picture of the camera, seen from above. A
cloud that is turned about z lies straight in both.
"""

import contextlib
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Cloud, Floats, Mask, NearestGrid, nearest_grid
from socialcircle_ros.errors import CloudError, MessageError
from socialcircle_ros.lengths import LengthScale, length_scale
from socialcircle_ros.messages.image import NOT_MEASURED, OUTLIER
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.metrics.areal import levelled_heights

from . import colours

Quantity = Literal['heights', 'picture in focus', 'quality']
"""What the colours show."""

Along = Literal['row', 'column']
"""What a profile follows."""

ALONG: tuple[Along, ...] = get_args(Along)
QUANTITIES: tuple[Quantity, ...] = get_args(Quantity)
_FIELDS: dict[Quantity, str] = {'picture in focus': 'intensity', 'quality': 'quality'}
_STRAIGHT = 0.01
"""Sine of the turn about z up to which x and y are the sides: lengths differ by less than 0.01 %."""
ROBUST = (0.5, 99.5)
"""Percentiles of the kept heights at the two ends of the colours, unless the full range is wanted."""


@dataclass(frozen=True)
class Display:
    """What a visitor has chosen for the display; the node does not see it.

    Attributes:
        values: what the colours show.
        colour_map: one of `colours.MAPS`.
        full_range: whether the colours span all kept values, or those between two percentiles.
        levelled: whether heights are relative to the plane through the kept points.
        along: whether the profile is that of a row or a column.
    """

    values: Quantity = 'heights'
    colour_map: str = colours.MAPS[0]
    full_range: bool = False
    levelled: bool = False
    along: Along = 'row'


@dataclass(frozen=True)
class MapSide:
    """A side of the map.

    Attributes:
        name: of its coordinate.
        shares: of x and of y in the coordinate.
        origin: x and y where the coordinate is 0.
        sign: 1 where the coordinate grows to the right, or downwards, else -1.
        first: the coordinate at the left, or upper, edge.
        last: the coordinate at the right, or lower, edge.
        count: number of columns, or of rows.
    """

    name: str
    shares: tuple[float, float]
    origin: tuple[float, float]
    sign: int
    first: float
    last: float
    count: int

    @property
    def length(self) -> float:
        """The length of the side."""
        return abs(self.last - self.first)

    def at(self, place: float) -> float:
        """The coordinate at a column or row, which may be between two."""
        return self.first + (self.last - self.first) * (place + 0.5) / self.count

    def coordinates(self, points: Floats) -> npt.NDArray[np.float64]:
        """The coordinates (N,) of measured points (N, 3)."""
        found: npt.NDArray[np.float64] = (points[:, :2].astype(np.float64) - self.origin) @ self.shares
        return found


@dataclass(frozen=True, eq=False)
class Drawing:
    """A cloud, prepared for scene, map, profile and histogram.

    Attributes:
        xyz: (H, W, 3) as measured.
        mask: (H, W) uint8, with the values of `outlier_mask`.
        heights: (H, W) float64, levelled where that is wanted; NaN where not measured.
        values: (H, W) float64 what the colours show; NaN where not measured.
        span: the values at the two ends of the colours.
        across: the side along a row.
        down: the side along a column.
        unit: of the lengths; None: it is not known.
        display: what was chosen.
    """

    xyz: Cloud
    mask: npt.NDArray[np.uint8]
    heights: npt.NDArray[np.float64]
    values: npt.NDArray[np.float64]
    span: tuple[float, float]
    across: MapSide
    down: MapSide
    unit: str | None
    display: Display

    @property
    def kept(self) -> Mask:
        """(H, W) the measured points that are no outliers."""
        kept: Mask = np.isfinite(self.heights) & (self.mask != OUTLIER)
        return kept

    @property
    def outliers(self) -> Mask:
        """(H, W) the outliers."""
        outliers: Mask = np.isfinite(self.heights) & (self.mask == OUTLIER)
        return outliers

    @property
    def lengths(self) -> LengthScale:
        """How x and y are shown."""
        return length_scale([self.across.first, self.across.last, self.down.first, self.down.last], self.unit)

    @property
    def height_scale(self) -> LengthScale:
        """How heights are shown: by those of the kept points."""
        return length_scale(self.height_span, self.unit)

    @property
    def height_span(self) -> tuple[float, float]:
        """The lowest and the highest kept point; of all points where none is kept."""
        found = self.heights[self.kept]
        found = found if found.size else self.heights[np.isfinite(self.heights)]
        return float(found.min()), float(found.max())

    @property
    def range_sentence(self) -> str:
        """What the two ends of the colours are."""
        is_height = self.display.values == 'heights'
        what = self.height_scale.label('height of kept points') if is_height else self.display.values
        return f'{what}, full range' if self.display.full_range else f'{what}, {ROBUST[0]:g} to {ROBUST[1]:g} %'


def drawing_of(cloud: PointCloud, mask: npt.NDArray[np.uint8], display: Display, unit: str | None) -> Drawing:
    """Prepare a cloud for display.

    Args:
        cloud: as measured.
        mask: (H, W) uint8, with the values of `outlier_mask`.
        display: what was chosen.
        unit: of the lengths; None: it is not known.

    Raises:
        CloudError: mask and cloud differ in size, or no point is measured.
    """
    xyz = cloud.xyz()
    if mask.shape != xyz.shape[:2]:
        raise CloudError(
            f'The mask has the shape {mask.shape} and the cloud {xyz.shape[:2]}; they must be of one measurement.'
        )
    measured = (mask != NOT_MEASURED) & np.isfinite(xyz).all(axis=2)
    if not measured.any():
        raise CloudError('The cloud has no measured point.')
    kept = measured & (mask != OUTLIER)
    heights = np.where(measured, xyz[..., 2], np.nan).astype(np.float64)
    if display.levelled:
        heights = np.where(measured, levelled_heights(xyz, kept), np.nan)
    name = _FIELDS.get(display.values)
    values = heights
    if name is not None and display.values in quantities_of(cloud):
        values = np.where(measured, cloud.values(name), np.nan).astype(np.float64)
    across, down = _sides(xyz, measured)
    return Drawing(
        xyz, mask, heights, values, _span(values, kept, display), across, down, unit, display,
    )  # fmt: skip


def quantities_of(cloud: PointCloud) -> tuple[Quantity, ...]:
    """What the colours can show of a cloud."""
    found: list[Quantity] = ['heights']
    for values, name in _FIELDS.items():
        with contextlib.suppress(MessageError):
            cloud.field(name)
            found.append(values)
    return tuple(found)


def _span(values: npt.NDArray[np.float64], kept: Mask, display: Display) -> tuple[float, float]:
    found = values[kept & np.isfinite(values)]
    if not found.size:
        found = values[np.isfinite(values)]
    if not found.size:
        return 0.0, 1.0
    low, high = np.percentile(found, (0.0, 100.0) if display.full_range else ROBUST)
    return float(low), float(high)


def _sides(xyz: Cloud, measured: Mask) -> tuple[MapSide, MapSide]:
    """The coordinates along a row and along a column: x and y, or distances where the cloud is turned about z."""
    grid = nearest_grid(xyz, measured)
    if grid is None or grid.pitch is None or _is_straight(grid):
        return _straight_sides(xyz)
    # Shares of x and y in the number of the column and in that of the row.
    shares = np.linalg.inv(np.column_stack([grid.column_step, grid.row_step]))
    sides = []
    for name, pitch, share, count in zip(
        ('along a row', 'along a column'), grid.pitch, shares, measured.shape[::-1], strict=True
    ):
        in_x, in_y = (share * pitch).tolist()
        sides.append(MapSide(name, (in_x, in_y), grid.origin, 1, -pitch / 2, (count - 0.5) * pitch, count))
    return sides[0], sides[1]


def _is_straight(grid: NearestGrid) -> bool:
    """Whether x and y lie along rows and columns, or along columns and rows."""
    steps = np.abs([grid.column_step, grid.row_step])
    return any(
        bool(each[0, 1] <= _STRAIGHT * each[0, 0] and each[1, 0] <= _STRAIGHT * each[1, 1])
        for each in (steps, steps[:, ::-1])
    )


def _straight_sides(xyz: Cloud) -> tuple[MapSide, MapSide]:
    """Which coordinates lie along a row and along a column, and in which direction they grow."""
    along = [_slopes(xyz, axis) for axis in (0, 1)]  # of x and of y: per column, per row
    swapped = abs(along[0][1]) * abs(along[1][0]) > abs(along[0][0]) * abs(along[1][1])
    sides = []
    for direction, axis in enumerate((1, 0) if swapped else (0, 1)):
        slope = along[axis][direction]
        count = xyz.shape[1 - direction]
        middle = float(np.nanmedian(xyz[..., axis]))
        step = slope or 1.0
        first, last = middle - step * count / 2, middle + step * count / 2
        shares = (0.0, 1.0) if axis else (1.0, 0.0)
        sides.append(MapSide('xy'[axis], shares, (0.0, 0.0), -1 if slope < 0 else 1, first, last, count))
    return sides[0], sides[1]


def _slopes(xyz: Cloud, axis: int) -> tuple[float, float]:
    """How much a coordinate grows per column and per row; 0 where no two points tell it."""
    coordinates = xyz[..., axis].astype(np.float64)
    found = []
    for direction in (1, 0):
        steps = np.diff(coordinates, axis=direction)
        steps = steps[np.isfinite(steps)]
        found.append(float(np.median(steps)) if steps.size else 0.0)
    return found[0], found[1]
