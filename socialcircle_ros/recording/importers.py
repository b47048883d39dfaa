"""Organized clouds from measurement files: `.npz` height maps, PLY and PCD."""

import zipfile
import zlib
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.cloud import Cloud
from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.formats import MeasuredSurface, OrganizedCloud, check_given, read_file
from socialcircle_ros.formats.points import comments_of

from .point_files import Column, PointTable, read_pcd, read_ply

_Number = TypeVar('_Number', bound=np.generic)


@dataclass(frozen=True, eq=False)
class ImportedCloud:
    """An organized cloud from a file.

    Attributes:
        name: the name of the file without its suffix.
        points: (rows, columns, 3) float32 or float64, x, y and z; NaN where a point was not measured.
        fields: the other values of each point by name, (rows, columns) each.
        unit: of the coordinates; None if the file does not name it.
    """

    name: str
    points: Cloud
    fields: dict[str, Column]
    unit: str | None


def import_cloud(
    path: str | Path,
    *,
    shape: tuple[int, int] | None = None,
    pitch: tuple[float, float] | None = None,
    unit: str | None = None,
) -> ImportedCloud:
    """Read an organized cloud from a file.

    An `.npz` height map has heights `z` (rows, columns) and the pitches `dx` and `dy`, all in one unit: µm, unless
    `unit` names another. x is column · dx, y is row · dy. Other arrays of the same size become fields, as do the
    planes of an array (planes, rows, columns).

    Args:
        path: an `.npz`, `.ply` or `.pcd` file, or one of the formats of `formats.FORMATS`.
        shape: (rows, columns) of a PLY or PCD file that does not hold its shape.
        pitch: dx and dy of a file of heights that does not state them, such as an ASCII matrix.
        unit: of a file that does not name it.

    Raises:
        ImportFileError: the file cannot be used; the message says why and what to do.
    """
    path = Path(path)
    readers = {'.npz': _read_height_map, '.ply': _read_points, '.pcd': _read_points}
    if not path.suffix and not path.exists():
        raise ImportFileError(f'{path} does not exist: check the name of the file or folder.')
    try:
        if path.suffix.lower() not in readers:
            return _read_other(path, shape, pitch, unit)
        cloud = readers[path.suffix.lower()](path, shape)
    except FileNotFoundError:
        raise ImportFileError(f'{path} does not exist: check the name of the file.') from None
    except OSError as error:
        raise ImportFileError(f'{path} cannot be read ({error.strerror}): check its permissions.') from None
    cloud = replace(cloud, unit=cloud.unit or unit)
    check_given(path, OrganizedCloud(cloud.points, cloud.unit), pitch, unit)
    return cloud


def load_npz(path: Path) -> dict[str, Column]:
    """Load the arrays of an `.npz` archive.

    Raises:
        ImportFileError: the file is not such an archive, or is cut off.
    """
    # zipfile raises a RuntimeError for an encrypted archive, and for one with an unknown compression.
    with suppress(ValueError, EOFError, KeyError, RuntimeError, zipfile.BadZipFile, zlib.error):
        archive = np.load(path, allow_pickle=False)
        if isinstance(archive, np.lib.npyio.NpzFile):
            with archive:
                return {key: archive[key] for key in archive.files}
    raise ImportFileError(f'{path} is not an .npz archive of numbers, or is cut off: save it again.')


def _read_height_map(path: Path, shape: tuple[int, int] | None) -> ImportedCloud:
    arrays = load_npz(path)
    if 'frames' in arrays:
        raise ImportFileError(
            f'{path} holds a focus stack, not a height map: import it by itself, with --pitch and --z-step.'
        )
    for key in ('z', 'dx', 'dy'):
        if key not in arrays:
            raise ImportFileError(
                f'{path} has no array {key!r}: a height map needs z (rows, columns), dx and dy, the pitches in µm.'
            )
    heights = arrays.pop('z')
    if heights.ndim != 2 or heights.size == 0 or heights.dtype.kind not in 'fiu':
        raise ImportFileError(
            f'{path} has an array z with shape {heights.shape} and type {heights.dtype}: it must hold numbers in'
            ' rows and columns.'
        )
    rows, columns = heights.shape
    if shape is not None and shape != (rows, columns):
        raise ImportFileError(f'{path} has {rows} × {columns} points, not {shape[0]} × {shape[1]}.')
    dx, dy = (_pitch(path, key, arrays.pop(key)) for key in ('dx', 'dy'))
    unit = str(arrays.pop('unit', 'um'))
    z = _as_coordinates(heights)
    points = np.empty((rows, columns, 3), z.dtype)
    points[..., 0] = np.arange(columns) * dx
    points[..., 1] = np.arange(rows)[:, np.newaxis] * dy
    points[..., 2] = z
    return _checked(path, ImportedCloud(path.stem, points, _fields_of(arrays, (rows, columns)), unit))


def _fields_of(arrays: dict[str, Column], shape: tuple[int, int]) -> dict[str, Column]:
    """The arrays, and planes of arrays, that have the shape of the height map."""
    fields = {}
    for name, array in arrays.items():
        if array.shape[-2:] != shape or array.dtype.kind not in 'fiub':
            continue
        if array.ndim == 2:
            fields[name] = _as_field(array)
        elif array.ndim == 3:
            fields |= {f'{name}_{plane}': _as_field(values) for plane, values in enumerate(array)}
    return fields


def _pitch(path: Path, key: str, value: Column) -> float:
    """Read a pitch.

    Raises:
        ImportFileError: it is not one positive number.
    """
    if value.size == 1 and value.dtype.kind in 'fiu':
        pitch = float(value.astype(np.float64).item())
        if 0 < pitch < np.inf:
            return pitch
    raise ImportFileError(f'{path} has no usable {key!r}: it must be one positive number, the pitch in µm.')


def _read_other(
    path: Path, shape: tuple[int, int] | None, pitch: tuple[float, float] | None, unit: str | None
) -> ImportedCloud:
    """Read a file of another format, such as that of an instrument."""
    found = read_file(path, pitch=pitch, unit=unit)
    cloud = found.cloud() if isinstance(found, MeasuredSurface) else found
    rows, columns = cloud.points.shape[:2]
    if shape is not None and shape != (rows, columns):
        raise ImportFileError(f'{path} has {rows} × {columns} points, not {shape[0]} × {shape[1]}.')
    return _checked(path, ImportedCloud(path.stem, cloud.points, dict(cloud.fields), cloud.unit))


def _read_points(path: Path, shape: tuple[int, int] | None) -> ImportedCloud:
    """Read a PLY or PCD file."""
    table = read_pcd(path) if path.suffix.lower() == '.pcd' else read_ply(path)
    for axis in 'xyz':
        if axis not in table.columns or table.columns[axis].ndim != 1:
            raise ImportFileError(f'{path} has no coordinate {axis!r} for its points: save it with x, y and z.')
    grid = _Grid(path, table, shape)
    coordinates = [_as_coordinates(table.columns.pop(axis)) for axis in 'xyz']
    points = cast('Cloud', np.stack([grid.place(values, np.nan) for values in coordinates], axis=-1))
    fields: dict[str, Column] = {}
    for name, values in table.columns.items():
        if values.ndim == 1:
            fields[name] = grid.place(_as_field(values), 0)
        else:
            fields |= {f'{name}_{i}': grid.place(_as_field(values[:, i]), 0) for i in range(values.shape[1])}
    return _checked(path, ImportedCloud(path.stem, points, fields, comments_of(path).get('unit')))


class _Grid:
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
            raise ImportFileError(f'{path} has {found[0]} × {found[1]} points, not {shape[0]} × {shape[1]}.')
        if table.places is None and found[0] * found[1] != count:
            raise ImportFileError(f'{path} has {count} points, which are not {found[0]} × {found[1]}.')
        if table.places is not None and table.places.max() >= count:
            raise ImportFileError(f'{path} has a range_grid that names missing points: save it again.')
        self._shape = found
        self._places = table.places

    def place(self, values: NDArray[_Number], empty: float) -> NDArray[_Number]:
        """Arrange values (N,) in rows and columns; a place without a point gets the value `empty`."""
        if self._places is None:
            return values.reshape(self._shape)
        placed = np.full(self._places.shape, empty, values.dtype)
        occupied = self._places >= 0
        placed[occupied] = values[self._places[occupied]]
        return placed.reshape(self._shape)


def _as_coordinates(values: Column) -> NDArray[np.float32] | NDArray[np.float64]:
    """Convert to float32 if that holds every value of the type, as it does for half floats; else to float64."""
    small = values.dtype.kind == 'f' and values.dtype.itemsize <= 4
    return values.astype(np.float32) if small else values.astype(np.float64)


def _as_field(values: Column) -> Column:
    """Convert to a type that a PointCloud2 can hold, in native byte order."""
    kind, size = values.dtype.kind, values.dtype.itemsize
    if kind == 'b':
        return values.astype(np.uint8)
    if kind in 'iu' and size <= 4:
        return values.astype(f'{kind}{size}')
    return _as_coordinates(values)


def _checked(path: Path, cloud: ImportedCloud) -> ImportedCloud:
    """The cloud, if it has a measured point.

    Raises:
        ImportFileError: it has none.
    """
    if not np.isfinite(cloud.points).all(axis=-1).any():
        raise ImportFileError(f'{path} has no measured point: every height is NaN or infinite.')
    return cloud
