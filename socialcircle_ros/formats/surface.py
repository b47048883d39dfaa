# SPDX-License-Identifier: Apache-2.0
"""What measurement files hold: heights on a regular grid, or an organized cloud."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.cloud import Cloud, HeightMap, checked_pitch, grid_coordinates, measured_points
from socialcircle_ros.digits import size_text
from socialcircle_ros.errors import CloudError, ImportFileError

PointValues = NDArray[np.generic]
"""One value for each point, (rows, columns), of any type."""

_LARGEST_DEVIATION = 1e-3  # of the pitch, from a regular grid
_ROUNDING = 8  # units in the last place, by which products that were rounded twice may differ

SOURCE_FORMAT = 'source format'
"""The name, in the metadata, of what a file was taken for, where its suffix does not tell that."""

MATRIX = 'text file with a matrix of heights'
"""What a matrix of heights is, as `SOURCE_FORMAT`."""


@dataclass(frozen=True, eq=False)
class OrganizedCloud:
    """An organized cloud from a file, or for one.

    Attributes:
        points: (rows, columns, 3) float32 or float64, x, y and z; NaN where a point was not measured.
        unit: of the coordinates; None if it is not known.
        fields: the other values of each point by name, (rows, columns) each.
        metadata: texts by name, such as the settings of the filter.
    """

    points: Cloud
    unit: str | None = None
    fields: Mapping[str, PointValues] = field(default_factory=dict)
    metadata: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class MeasuredSurface:
    """Heights on a regular grid: x is column · dx, y is row · dy.

    Attributes:
        heights: (rows, columns) float32 or float64; NaN where not measured.
        pitch: dx and dy, the distances of two columns and of two rows.
        unit: of the heights and the pitch; None if it is not known.
        fields: the other values of each point by name, (rows, columns) each.
        metadata: texts by name.
    """

    heights: HeightMap
    pitch: tuple[float, float]
    unit: str | None = None
    fields: Mapping[str, PointValues] = field(default_factory=dict)
    metadata: Mapping[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        rows, columns = self.heights.shape
        missing = int(np.count_nonzero(~np.isfinite(self.heights)))
        pitch = f'{self.pitch[0]:g} × {self.pitch[1]:g} {self.unit or "(unit not known)"} (x × y)'
        return (
            f'MeasuredSurface({size_text(rows, columns)}, {self.heights.dtype}, pitch {pitch},'
            f' {missing} not measured)'
        )

    def cloud(self) -> OrganizedCloud:
        """The same as an organized cloud.

        Raises:
            CloudError: the data type of the heights does not hold the coordinates.
        """
        points = np.empty((*self.heights.shape, 3), self.heights.dtype)
        points[..., 0], points[..., 1] = grid_coordinates(self.heights.shape, self.pitch, points.dtype)
        points[..., 2] = self.heights
        return OrganizedCloud(cast('Cloud', points), self.unit, self.fields, self.metadata)


def given_pitch(path: Path, pitch: tuple[float, float] | None) -> tuple[float, float]:
    """The pitch that the caller gives for a file that does not state it, as two numbers.

    Raises:
        ImportFileError: none is given, or it is not above 0.
    """
    if pitch is None:
        raise ImportFileError(
            f'{path} does not state its pitch: give it with its unit, as import --pitch 2 --unit um, or'
            " read_surface(path, pitch=(dx, dy), unit='um')."
        )
    try:
        return checked_pitch(pitch)
    except CloudError:
        raise ImportFileError(f'The pitch of {path} must be two numbers above 0, not {pitch}.') from None


class Flattened(NamedTuple):
    """A cloud as heights on a regular grid.

    Attributes:
        surface: the heights.
        notes: one sentence for each property of the cloud that the surface does not hold.
    """

    surface: MeasuredSurface
    notes: tuple[str, ...]


def surface_of(cloud: OrganizedCloud) -> Flattened:
    """The heights and the pitch of a cloud that lies on a regular grid.

    The pitch is the number with the fewest decimal digits that gives the same coordinates, bit for bit, where
    there is one. So the pitch of a file survives coordinates in float32.

    Raises:
        CloudError: the points do not lie on a regular grid, or too few of them are measured to tell the pitch.
    """
    points = cloud.points
    measured = measured_points(points)
    notes: list[str] = []
    pitch = (
        _axis_pitch(points[..., 0], measured, 'x', notes),
        _axis_pitch(points[..., 1].T, measured.T, 'y', notes),
    )
    heights = np.where(measured, points[..., 2], points.dtype.type(np.nan))
    surface = MeasuredSurface(cast('HeightMap', heights), pitch, cloud.unit, cloud.fields, cloud.metadata)
    return Flattened(surface, tuple(notes))


def _axis_pitch(values: NDArray[np.floating], measured: NDArray[np.bool_], axis: str, notes: list[str]) -> float:
    """The pitch of the coordinates of one axis, (other axis, this axis).

    Raises:
        CloudError: as `surface_of`.
    """
    places = np.flatnonzero(measured.any(axis=0))
    if len(places) < 2:
        raise CloudError(
            f'Too few points are measured to tell the pitch in {axis}; export the cloud as ply or pcd.'
        )
    least = np.where(measured, values, np.inf).min(axis=0)[places]
    most = np.where(measured, values, -np.inf).max(axis=0)[places]
    line = least.astype(np.float64)
    slope, start = (
        np.polynomial.Polynomial.fit(places, line, 1).convert().coef[[1, 0]] if line.any() else (0.0, 0.0)
    )
    if not slope > 0:
        raise CloudError(
            f'{axis} does not grow along its axis of the grid, so this is no height map: export the cloud as ply'
            ' or pcd, which hold any coordinates.'
        )
    if (least == most).all():
        exact = _exact_pitch(least, places)
        if exact is not None:
            return exact
    deviation = max(np.abs(side - (start + slope * places)).max() for side in (least, most)) / slope
    rounding = np.spacing(np.abs(line).max().astype(values.dtype)) / slope * _ROUNDING
    if deviation > max(_LARGEST_DEVIATION, rounding):
        raise CloudError(
            f'The points are off a regular grid by {deviation:.2g} of the pitch in {axis}, and a height map holds'
            ' only regular grids: export the cloud as ply or pcd, which hold any coordinates.'
        )
    if deviation > rounding:
        notes.append(
            f'{axis} is off a regular grid by up to {deviation:.2g} of its pitch; the file holds the grid.'
        )
    if abs(start) > slope * max(_LARGEST_DEVIATION, rounding):
        notes.append(f'{axis} starts at {start:.9g}; in the file it starts at 0.')
    if values.dtype == np.float64:
        return float(slope)
    return float(f'{slope:.8g}')


def _exact_pitch(line: NDArray[np.floating], places: NDArray[np.intp]) -> float | None:
    """The shortest number with the coordinates as its multiples, bit for bit; None if there is none."""
    numbers = line.astype(np.float64)
    half = np.spacing(np.abs(line)).astype(np.float64) / 2
    away = places > 0
    low = ((numbers - half)[away] / places[away]).max()
    high = ((numbers + half)[away] / places[away]).min()
    nearest = numbers[away][0] / places[away][0]
    middle = (low + high) / 2
    digits = (float(f'{guess:.{count}g}') for count in range(1, 18) for guess in (middle, nearest))
    for pitch in (*digits, middle, nearest, low, high):
        if pitch > 0 and ((places * pitch).astype(line.dtype) == line).all():
            return float(pitch)
    return None
