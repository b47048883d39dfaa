# SPDX-License-Identifier: Apache-2.0
"""Organized clouds from measurement files: `.npz` height maps, PLY and PCD."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.cloud import Cloud, Floats, Pitch, PitchLike, as_floats, grid_coordinates
from socialcircle_ros.digits import size_text
from socialcircle_ros.errors import CloudError, ImportFileError
from socialcircle_ros.formats import MeasuredSurface, OrganizedCloud, check_given, read_file, stated_time
from socialcircle_ros.formats.damage import unreadable
from socialcircle_ros.formats.fields import free_name, held_values
from socialcircle_ros.formats.lists import LIST
from socialcircle_ros.formats.points import comments_of, metadata_of, pitch_of
from socialcircle_ros.formats.surface import SOURCE_FORMAT, given_pitch
from socialcircle_ros.lengths import checked_unit
from socialcircle_ros.messages.header import FIRST_DATE

from .npz import Npz, open_npz
from .pcd import read_pcd
from .ply import read_ply
from .point_table import FieldValues, PointTable

_Number = TypeVar('_Number', bound=np.generic)
_LATERAL = {'x', 'y', 'dx', 'dy'}
_OWN_ARRAYS = {'z', *_LATERAL, 'unit', 'metadata'}
_HEIGHT_MAP = (
    'a height map needs z (rows, columns), and the pitches dx and dy in the unit of z, or its own x and y'
)
_OF_A_POINT = 3  # numbers in a line of text
_SAME_PITCH = 1e-3  # relative


@dataclass(frozen=True, eq=False)
class ImportedCloud:
    """An organized cloud from a file.

    Attributes:
        name: the name of the file without its suffix.
        points: (rows, columns, 3) float32 or float64, x, y and z; NaN where a point was not measured.
        fields: the other values of each point by name, (rows, columns) each.
        unit: of the coordinates; None if the file does not name it.
        notes: what was not taken as it stands, one sentence each.
        unit_note: what was taken for a unit that the file does not state; empty: it states its unit, or the caller
            gave it.
        measured_ns: when it was measured, as the file states it, ns since 1970; None: the file does not.
        kind: what the file was taken for, where its suffix does not tell that; else empty.
        metadata: texts by name, as the file has them.
        pitch: dx and dy, where the file states them apart from its coordinates; else None.
    """

    name: str
    points: Cloud
    fields: dict[str, FieldValues]
    unit: str | None
    notes: tuple[str, ...] = ()
    unit_note: str = ''
    measured_ns: int | None = None
    kind: str = ''
    metadata: Mapping[str, str] = field(default_factory=dict)
    pitch: Pitch | None = None

    def organized(self) -> OrganizedCloud:
        """The cloud without what only an import needs."""
        return OrganizedCloud(self.points, self.unit, self.fields, self.metadata, self.pitch)


_Reader = Callable[[Path, tuple[int, int] | None], ImportedCloud]


def import_cloud(
    path: str | Path,
    *,
    shape: tuple[int, int] | None = None,
    pitch: PitchLike | None = None,
    unit: str | None = None,
) -> ImportedCloud:
    """Read an organized cloud from a file.

    An `.npz` height map has heights `z` (rows, columns) and the pitches `dx` and `dy`, all in one unit: that of
    its array `unit` or of the argument, else µm, as `unit_note` says then. x is column · dx, y is row · dy; or the
    file has its own `x` and `y`, one value for each column and row or one for each point; with none of the four,
    the argument has the pitch. Other arrays of the same size become fields, as do the planes of an array (planes,
    rows, columns). Other arrays are not loaded.

    Args:
        path: an `.npz`, `.ply` or `.pcd` file, or one of the formats of `formats.FORMATS`.
        shape: (rows, columns) of a PLY or PCD file that does not hold its shape.
        pitch: dx and dy of a file of heights that does not state them, such as an ASCII matrix or an `.npz` of `z`
            alone.
        unit: of a file that does not name it.

    Raises:
        ImportFileError: the file cannot be used; the message says why and what to do.
        SettingError: the unit is no text.
    """
    path, unit = Path(path), checked_unit(unit)
    given = None if pitch is None else given_pitch(path, pitch)
    readers: dict[str, _Reader] = {
        '.npz': partial(_read_height_map, given=given),
        '.ply': _read_points,
        '.pcd': _read_points,
    }
    if not path.suffix and not path.exists():
        raise ImportFileError(f'{path} does not exist: check the name of the file or folder.')
    try:
        if path.suffix.lower() not in readers:
            return _with_unit(path, _read_other(path, shape, given, unit), unit)
        cloud = readers[path.suffix.lower()](path, shape)
    except OSError as error:
        raise unreadable(path, error) from None
    cloud = _with_unit(path, cloud, unit)
    check_given(path, cloud.organized(), given, unit)
    return cloud


def _with_unit(path: Path, cloud: ImportedCloud, given: str | None) -> ImportedCloud:
    """The cloud with the unit that the file states or the caller gives, or a note on what is taken."""
    if cloud.unit or given:
        return replace(cloud, unit=cloud.unit or given)
    if path.suffix.lower() == '.npz':
        return replace(cloud, unit='um', unit_note='does not state its unit: taken as µm; import --unit names it')
    note = 'does not state its unit: its numbers are kept, in a unit that is not known; import --unit names it'
    return replace(cloud, unit_note=note)


def _read_height_map(path: Path, shape: tuple[int, int] | None, given: Pitch | None) -> ImportedCloud:
    with open_npz(path) as archive:
        if 'frames' in archive.headers:
            raise ImportFileError(
                f'{path} holds a focus stack, not a height map: import it by itself, with --pitch and --z-step.'
            )
        if 'z' not in archive.headers:
            raise ImportFileError(f"{path} has no array 'z': {_HEIGHT_MAP}.")
        header = archive.headers['z']
        if len(header.shape) != 2 or 0 in header.shape or header.dtype.kind not in 'fiu':
            raise ImportFileError(
                f'{path} has an array z with shape {header.shape} and type {header.dtype}: it must hold numbers in'
                ' rows and columns.'
            )
        rows, columns = header.shape
        if shape is not None and shape != (rows, columns):
            raise ImportFileError(f'{path} has {size_text(rows, columns)} of points, not {size_text(*shape)}.')
        z = _as_coordinates(path, 'z', archive.load('z'))
        fields = _Fields((rows, columns))
        pitch = given_pitch(path, given) if _LATERAL.isdisjoint(archive.headers) else None
        x, y = _lateral(archive, rows, columns, z.dtype, pitch)
        pitch = pitch or _stated_pitch(archive)
        points = np.empty((rows, columns, 3), np.result_type(x, y, z))
        points[..., 0], points[..., 1], points[..., 2] = x, y, z
        unit, metadata = _text_of(archive, 'unit'), metadata_of(_text_of(archive, 'metadata'))
        for name in archive.headers:
            if name not in _OWN_ARRAYS:
                fields.add_array(archive, name)
    cloud = ImportedCloud(path.stem, points, fields.by_name, unit, tuple(fields.notes), metadata=metadata)
    return _checked(path, replace(cloud, measured_ns=_date(metadata), pitch=pitch))


def _date(metadata: Mapping[str, str]) -> int | None:
    """When a cloud was measured, as its metadata state it; what is before 2000 is no date."""
    time = stated_time(metadata)
    return None if time is None or time < FIRST_DATE else time


def _text_of(archive: Npz, name: str) -> str | None:
    """The one text of an array; None if it is not there, is empty, or is no text."""
    if name not in archive.headers or archive.headers[name].dtype.kind not in 'US':
        return None
    values = archive.load(name).astype(np.str_).ravel()
    return (''.join(filter(str.isprintable, str(values[0]))).strip() or None) if values.size == 1 else None


def _lateral(
    archive: Npz, rows: int, columns: int, kind: np.dtype[np.float32 | np.float64], given: Pitch | None
) -> tuple[Floats, Floats]:
    """The coordinates x and y of a height map: its own, or those of the pitches, which may be `given` instead.

    Returns:
        Arrays that fit (rows, columns); those of the pitches in the type of the heights, `kind`.

    Raises:
        ImportFileError: they are missing, do not fit, or contradict each other, or the type does not hold them.
    """
    path = archive.path
    own = [name for name in ('x', 'y') if name in archive.headers]
    if not own:
        pitch = given or (_pitch(archive, 'dx'), _pitch(archive, 'dy'))
        try:
            return grid_coordinates((rows, columns), pitch, kind)
        except CloudError as error:
            raise ImportFileError(f'{path} cannot be used: {error}') from None
    shapes = [archive.headers[name].shape for name in own]
    if shapes not in ([(columns,), (rows,)], [(rows, columns)] * 2):
        listed = ' and '.join(f'{name} {shape}' for name, shape in zip(own, shapes, strict=True))
        raise ImportFileError(
            f'{path} has {listed}, which do not fit z ({rows}, {columns}): x needs one value for each column and y'
            ' one for each row, or both one for each point.'
        )
    x, y = (_as_coordinates(path, name, archive.load(name)) for name in own)
    if x.ndim == 1:
        y = y[:, np.newaxis]
    for key, values, axis in (('dx', x, -1), ('dy', y, 0)):
        if key in archive.headers and values.shape[axis] > 1:
            steps = np.abs(np.diff(values.astype(np.float64), axis=axis))
            stated, found = _pitch(archive, key), np.nanmedian(steps)
            if not np.isclose(found, stated, rtol=_SAME_PITCH):
                raise ImportFileError(
                    f'{path} has {key} {stated:g}, but its own {key[1]} is {found:g} apart: remove one of these.'
                )
    return x, y


def _stated_pitch(archive: Npz) -> Pitch | None:
    """The pitches dx and dy of a height map; None: one is missing, or is none beside coordinates of its own."""
    if not {'dx', 'dy'} <= archive.headers.keys():
        return None
    try:
        return _pitch(archive, 'dx'), _pitch(archive, 'dy')
    except ImportFileError:
        return None  # what `_lateral` needs of them, it has checked


def _pitch(archive: Npz, key: str) -> float:
    """Read a pitch.

    Raises:
        ImportFileError: it is missing, or is not one positive number.
    """
    if key not in archive.headers:
        raise ImportFileError(f'{archive.path} has no array {key!r}: {_HEIGHT_MAP}.')
    path, value = archive.path, archive.load(key)
    if value.size == 1 and value.dtype.kind in 'fiu':
        pitch = float(value.astype(np.float64).item())
        if 0 < pitch < np.inf:
            return pitch
    raise ImportFileError(
        f'{path} has no usable {key!r}: it must be one positive number, the pitch in the unit of z.'
    )


def _read_other(path: Path, shape: tuple[int, int] | None, pitch: Pitch | None, unit: str | None) -> ImportedCloud:
    """Read a file of another format, such as that of an instrument."""
    found = read_file(path, pitch=pitch, unit=unit)
    try:
        cloud = found.cloud() if isinstance(found, MeasuredSurface) else found
    except CloudError as error:
        raise ImportFileError(f'{path} cannot be used: {error}') from None
    rows, columns = cloud.points.shape[:2]
    if shape is not None and shape != (rows, columns):
        raise ImportFileError(f'{path} has {size_text(rows, columns)} of points, not {size_text(*shape)}.')
    taken = cloud.metadata.get(SOURCE_FORMAT, '')
    # Three numbers in a line may be a point or three heights, so that it is said which they are.
    notes = (f'it is taken as a {taken}',) if taken == LIST or (taken and columns == _OF_A_POINT) else ()
    fields = _Fields((rows, columns))
    for name, values in cloud.fields.items():
        fields.add(name, values)
    all_notes = (*notes, *fields.notes)
    imported = ImportedCloud(path.stem, cloud.points, fields.by_name, cloud.unit, all_notes, kind=taken)
    imported = replace(imported, metadata=cloud.metadata, pitch=cloud.pitch)
    return _checked(path, replace(imported, measured_ns=_date(cloud.metadata)))


def _read_points(path: Path, shape: tuple[int, int] | None) -> ImportedCloud:
    """Read a PLY or PCD file."""
    table = read_pcd(path) if path.suffix.lower() == '.pcd' else read_ply(path)
    for axis in 'xyz':
        if axis not in table.columns or table.columns[axis].ndim != 1:
            raise ImportFileError(f'{path} has no coordinate {axis!r} for its points: save it with x, y and z.')
    comments = comments_of(path)
    if table.shape is None and comments.get('rows') == '1':
        table.shape = (1, len(table.columns['x']))
    grid = _PointGrid(path, table, shape)
    coordinates = [_as_coordinates(path, axis, table.columns.pop(axis)) for axis in 'xyz']
    points = cast('Cloud', np.stack([grid.place(values, np.nan) for values in coordinates], axis=-1))
    fields = _Fields(grid.shape)
    for name, values in table.columns.items():
        if values.ndim == 1:
            fields.add(name, grid.place(values, 0))
        else:
            for place in range(values.shape[1]):
                fields.add(f'{name}_{place}', grid.place(values[:, place], 0))
    notes, metadata = (*table.notes, *fields.notes), metadata_of(comments.get('metadata'))
    cloud = ImportedCloud(path.stem, points, fields.by_name, comments.get('unit'), notes, metadata=metadata)
    return _checked(path, replace(cloud, measured_ns=_date(metadata), pitch=pitch_of(comments)))


class _PointGrid:
    """Arranges the points of a table in rows and columns."""

    def __init__(self, path: Path, table: PointTable, shape: tuple[int, int] | None) -> None:
        count = len(table.columns['x'])
        found = table.shape or shape
        if found is None:
            raise ImportFileError(
                f'{path} is not organized: it does not tell the numbers of rows and columns of its {count} points,'
                ' so give the shape.'
            )
        if shape is not None and shape != found:
            raise ImportFileError(f'{path} has {size_text(*found)} of points, not {size_text(*shape)}.')
        if table.places is None and found[0] * found[1] != count:
            raise ImportFileError(f'{path} has {count} points, which are not {size_text(*found)}.')
        if table.places is not None and table.places.max() >= count:
            raise ImportFileError(f'{path} has a range_grid that names missing points: save it again.')
        self.shape = found
        self._places = table.places

    def place(self, values: NDArray[_Number], empty: float) -> NDArray[_Number]:
        """Arrange values (N,) in rows and columns; a place without a point gets the value `empty`."""
        if self._places is None:
            return values.reshape(self.shape)
        placed = np.full(self._places.shape, empty, values.dtype)
        occupied = self._places >= 0
        placed[occupied] = values[self._places[occupied]]
        return placed.reshape(self.shape)


class _Fields:
    """The values of each point beside its coordinates, in types that a PointCloud2 can hold."""

    def __init__(self, shape: tuple[int, int]) -> None:
        self._shape = shape
        self.by_name: dict[str, FieldValues] = {}
        self.notes: list[str] = []

    def add_array(self, archive: Npz, name: str) -> None:
        """Add an array of the size of the cloud, or each plane of it; note which arrays are passed over."""
        shape, dtype = archive.headers[name]
        if shape[-2:] != self._shape or len(shape) not in (2, 3) or dtype.kind not in 'fiub':
            self.notes.append(f'the array {name} with shape {shape} and type {dtype} is passed over')
            return
        values = archive.load(name)
        if values.ndim == 2:
            self.add(name, values)
        else:
            for plane, part in enumerate(values):
                self.add(f'{name}_{plane}', part)

    def add(self, name: str, values: FieldValues) -> None:
        """Add values (rows, columns)."""
        held = held_values(name, values)
        for part, numbers in held.by_name.items():
            self._add(part, numbers)
        if held.note:
            self.notes.append(held.note)

    def _add(self, name: str, values: FieldValues) -> None:
        plain = ''.join(filter(str.isprintable, name)) or 'field'
        free = free_name(plain, {*self.by_name, 'x', 'y', 'z'})
        if plain != name:
            self.notes.append(f'the field {name!r} becomes {free}, because its name cannot be printed')
        elif free != name:
            self.notes.append(f'the field {name} becomes {free}, because there is one with its name')
        self.by_name[free] = values


def _as_coordinates(path: Path, name: str, values: FieldValues) -> Floats:
    """Convert to float32 if that holds every value of the type, as it does for half floats; else to float64.

    Raises:
        ImportFileError: these are no numbers, or float64 does not hold them all.
    """
    if values.dtype.kind not in 'fiu':
        raise ImportFileError(f'{path} has {values.dtype} in {name!r}: it must hold numbers.')
    floats = as_floats(values)
    if floats is None:
        raise ImportFileError(
            f'{path} has 64-bit whole numbers in {name!r} that lose digits as coordinates: subtract an offset.'
        )
    return floats


def _checked(path: Path, cloud: ImportedCloud) -> ImportedCloud:
    """The cloud, if it has a measured point.

    Raises:
        ImportFileError: it has none.
    """
    if not np.isfinite(cloud.points).all(axis=-1).any():
        raise ImportFileError(f'{path} has no measured point: every height is NaN or infinite.')
    return cloud
