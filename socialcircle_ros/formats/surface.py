# SPDX-License-Identifier: Apache-2.0
"""What measurement files hold: heights on a regular grid, or an organized cloud."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from socialcircle_ros.cloud import (
    Cloud,
    Floats,
    HeightMap,
    Pitch,
    PitchLike,
    as_floats,
    checked_pitch,
    grid_coordinates,
    measured_points,
    unmasked,
)
from socialcircle_ros.digits import size_text
from socialcircle_ros.errors import CloudError, ImportFileError, shown
from socialcircle_ros.lengths import checked_unit

from .fields import PointValues, checked_fields

_LARGEST_DEVIATION = 1e-3  # of the pitch, from a regular grid
_ROUNDING = 8  # units in the last place, by which products that were rounded twice may differ

SOURCE_FORMAT = 'source format'
"""The name, in the metadata, of what a file was taken for, where its suffix does not tell that."""

MATRIX = 'text file with a matrix of heights'
"""What a matrix of heights is, as `SOURCE_FORMAT`."""


@dataclass(frozen=True, eq=False, init=False)
class OrganizedCloud:
    """An organized cloud from a file, or for one.

    Attributes:
        points: (rows, columns, 3) float32 or float64, x, y and z; NaN where a point was not measured.
        unit: of the coordinates; None if it is not known.
        fields: the other values of each point by name, (rows, columns) each.
        metadata: texts by name, such as the settings of the filter.
        pitch: dx and dy, if they are known apart from the coordinates, as those of a single row; else None.
    """

    points: Cloud
    unit: str | None = None
    fields: Mapping[str, PointValues] = field(default_factory=dict)
    metadata: Mapping[str, str] = field(default_factory=dict)
    pitch: Pitch | None = None

    def __init__(
        self,
        points: ArrayLike,
        unit: str | None = None,
        fields: Mapping[str, ArrayLike] | None = None,
        metadata: Mapping[str, str] | None = None,
        pitch: PitchLike | None = None,
    ) -> None:
        """Check the values, and convert them as `MeasuredSurface` does.

        Raises:
            CloudError: the points or a field have another shape or are no numbers, or the pitch is none.
            SettingError: the unit is no text.
        """
        values = _real('An organized cloud', '(rows, columns, 3)', points)
        if values.ndim != 3 or values.shape[2] != 3:
            raise CloudError(f'An organized cloud has the shape (rows, columns, 3), not {values.shape}.')
        _set(
            self,
            points=values,
            unit=checked_unit(unit),
            fields=checked_fields(fields or {}, values.shape[:2]),
            metadata=_texts(metadata or {}),
            pitch=None if pitch is None else checked_pitch(pitch),
        )


@dataclass(frozen=True, eq=False, init=False)
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
    pitch: Pitch
    unit: str | None = None
    fields: Mapping[str, PointValues] = field(default_factory=dict)
    metadata: Mapping[str, str] = field(default_factory=dict)

    def __init__(
        self,
        heights: ArrayLike,
        pitch: PitchLike,
        unit: str | None = None,
        fields: Mapping[str, ArrayLike] | None = None,
        metadata: Mapping[str, str] | None = None,
    ) -> None:
        """Check the values.

        Args:
            heights: (rows, columns) numbers. What a masked array masks becomes NaN, half floats become float32,
                and whole numbers float64.
            pitch: dx and dy, two numbers above 0.
            unit: of the heights and the pitch; None if it is not known.
            fields: numbers or bool by name, (rows, columns) each. What is masked becomes NaN.
            metadata: texts by name.

        Raises:
            CloudError: the heights or a field have another shape or are no numbers, or the pitch is none.
            SettingError: the unit is no text.
        """
        values = _real('A height map', '(rows, columns)', heights)
        if values.ndim != 2:
            raise CloudError(f'A height map has the shape (rows, columns), not {values.shape}.')
        _set(
            self,
            heights=values,
            pitch=checked_pitch(pitch),
            unit=checked_unit(unit),
            fields=checked_fields(fields or {}, values.shape),
            metadata=_texts(metadata or {}),
        )

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
        return OrganizedCloud(points, self.unit, self.fields, self.metadata, self.pitch)


def _set(checked: OrganizedCloud | MeasuredSurface, **values: object) -> None:
    """Set the attributes of a frozen object that is made."""
    for name, value in values.items():
        object.__setattr__(checked, name, value)


def _texts(metadata: Mapping[str, str]) -> dict[str, str]:
    """The metadata as text by name, which is all that files hold.

    Raises:
        CloudError: they have no names.
    """
    if not isinstance(metadata, Mapping):
        raise CloudError(f'The metadata are texts by name, as a dict, not {type(metadata).__name__}.')
    return {str(name): str(text) for name, text in metadata.items()}


def _real(what: str, shape: str, values: ArrayLike) -> Floats:
    """The values as float32 or float64, with NaN for what is masked.

    Raises:
        CloudError: they are no numbers, there are none, or float64 does not hold them.
    """
    try:
        array = unmasked(values)
    except CloudError:
        raise
    except ValueError:
        raise CloudError(f'{what} is an array {shape} of numbers; these rows differ in their lengths.') from None
    floats = as_floats(array)
    if floats is None:
        whole = array.dtype.kind in 'iu'
        advice = 'of more digits than float64 has: subtract an offset' if whole else f'not {array.dtype}'
        if array.dtype.kind == 'b':
            advice += ': give 0 and 1 as numbers'
        raise CloudError(f'{what} holds numbers, {advice}.')
    if not floats.size:
        raise CloudError(f'{what} needs a point; this one has the shape {floats.shape}.')
    return floats


def given_pitch(path: Path, pitch: PitchLike | None) -> Pitch:
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
        raise ImportFileError(f'The pitch of {path} must be two numbers above 0, not {shown(pitch)}.') from None


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
    there is one. So the pitch of a file survives coordinates in float32. If the cloud states its pitch, and the
    coordinates are those that it gives, this is the pitch, even of a single row.

    Raises:
        CloudError: the points do not lie on a regular grid, or too few of them are measured to tell the pitch.
    """
    points = cloud.points
    measured = measured_points(points)
    notes: list[str] = []
    stated = (None, None) if cloud.pitch is None else cloud.pitch
    pitch = (
        _axis_pitch(points[..., 0], measured, 'x', stated[0], notes),
        _axis_pitch(points[..., 1].T, measured.T, 'y', stated[1], notes),
    )
    heights = np.where(measured, points[..., 2], points.dtype.type(np.nan))
    surface = MeasuredSurface(heights, pitch, cloud.unit, cloud.fields, cloud.metadata)
    return Flattened(surface, tuple(notes))


def _axis_pitch(
    values: NDArray[np.floating], measured: NDArray[np.bool_], axis: str, stated: float | None, notes: list[str]
) -> float:
    """The pitch of the coordinates of one axis, (other axis, this axis).

    Raises:
        CloudError: as `surface_of`.
    """
    if stated is not None:
        with np.errstate(over='ignore'):
            line = (np.arange(values.shape[1]) * stated).astype(values.dtype)
        if ((values == line) | ~measured).all():
            return stated
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
