"""Files of measurements as organized clouds: `.npz` height maps, PLY and PCD."""

import zipfile
import zlib
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.errors import ImportFileError

from .point_files import PointTable, read_pcd, read_ply

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class ImportedCloud:
    """An organized cloud from a file.

    Attributes:
        name: Of the file, without its ending.
        points: x, y and z, (rows, columns, 3) float32 or float64; NaN where nothing was measured.
        fields: What else the file has for each point, (rows, columns) each, by name.
        unit: Of the coordinates, as the file says; None where it does not.
    """

    name: str
    points: Array
    fields: dict[str, Array]
    unit: str | None


def import_cloud(path: str | Path, *, shape: tuple[int, int] | None = None) -> ImportedCloud:
    """Read an organized cloud from a file.

    An `.npz` height map has heights `z` (rows, columns) and the pitches `dx` and `dy`, all in one unit (µm
    unless `unit` says otherwise): x is column · dx, y is row · dy. Its other arrays of the same size become
    fields, as do the planes of an array (planes, rows, columns).

    Args:
        path: An `.npz`, `.ply` or `.pcd` file.
        shape: (rows, columns) of a PLY or PCD file that does not say so itself.

    Raises:
        ImportFileError: The file cannot be used; the message says why and what to do.
    """
    path = Path(path)
    readers = {'.npz': _height_map, '.ply': _points, '.pcd': _points}
    if not path.suffix and not path.exists():
        raise ImportFileError(f'{path} does not exist: check the name of the file or folder.')
    if path.suffix.lower() not in readers:
        raise ImportFileError(f'{path} is of a kind that is not known here: give an .npz, .ply or .pcd file.')
    try:
        return readers[path.suffix.lower()](path, shape)
    except FileNotFoundError:
        raise ImportFileError(f'{path} does not exist: check the name of the file.') from None
    except OSError as error:
        raise ImportFileError(f'{path} cannot be read ({error.strerror}): check its permissions.') from None


def _height_map(path: Path, shape: tuple[int, int] | None) -> ImportedCloud:
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
    z = arrays.pop('z')
    if z.ndim != 2 or z.size == 0 or z.dtype.kind not in 'fiu':
        raise ImportFileError(
            f'{path} has z of the shape {z.shape} and type {z.dtype}: it must be numbers in rows and columns.'
        )
    if shape is not None and shape != z.shape:
        raise ImportFileError(f'{path} has {z.shape[0]} × {z.shape[1]} points, not {shape[0]} × {shape[1]}.')
    dx, dy = (_pitch(path, key, arrays.pop(key)) for key in ('dx', 'dy'))
    unit = str(arrays.pop('unit', 'um'))
    z = _as_coordinates(z)
    points = np.empty((*z.shape, 3), z.dtype)
    points[..., 0] = np.arange(z.shape[1]) * dx
    points[..., 1] = np.arange(z.shape[0])[:, np.newaxis] * dy
    points[..., 2] = z
    fields = {}
    for name, array in arrays.items():
        if array.shape == z.shape and array.dtype.kind in 'fiub':
            fields[name] = _as_field(array)
        elif array.ndim == 3 and array.shape[1:] == z.shape and array.dtype.kind in 'fiub':
            fields |= {f'{name}_{plane}': _as_field(values) for plane, values in enumerate(array)}
    return _checked(path, ImportedCloud(path.stem, points, fields, unit))


def load_npz(path: Path) -> dict[str, Array]:
    """The arrays of an .npz archive.

    Raises:
        ImportFileError: it is not one, or is cut off.
    """
    # A RuntimeError: the archive is encrypted, or compressed in a way that zipfile does not know.
    with suppress(ValueError, EOFError, KeyError, RuntimeError, zipfile.BadZipFile, zlib.error):
        archive = np.load(path, allow_pickle=False)
        if isinstance(archive, np.lib.npyio.NpzFile):
            with archive:
                return {key: archive[key] for key in archive.files}
    raise ImportFileError(f'{path} is not an .npz archive of numbers, or is cut off: save it again.')


def _pitch(path: Path, key: str, value: Array) -> float:
    if value.size != 1 or value.dtype.kind not in 'fiu' or not 0 < value.item() < np.inf:
        raise ImportFileError(f'{path} has no usable {key!r}: it must be one positive number, the pitch in µm.')
    return float(value.item())


def _points(path: Path, shape: tuple[int, int] | None) -> ImportedCloud:
    table = read_pcd(path) if path.suffix.lower() == '.pcd' else read_ply(path)
    for axis in 'xyz':
        if axis not in table.columns or table.columns[axis].ndim != 1:
            raise ImportFileError(f'{path} has no coordinate {axis!r} for its points: save it with x, y and z.')
    grid = _Grid(path, table, shape)
    coordinates = [_as_coordinates(table.columns.pop(axis)) for axis in 'xyz']
    points = np.stack([grid.place(values, np.nan) for values in coordinates], axis=-1)
    fields = {}
    for name, values in table.columns.items():
        if values.ndim == 1:
            fields[name] = grid.place(_as_field(values), 0)
        else:
            fields |= {f'{name}_{i}': grid.place(_as_field(values[:, i]), 0) for i in range(values.shape[1])}
    return _checked(path, ImportedCloud(path.stem, points, fields, unit=None))


class _Grid:
    """Puts the points of a table on their places in rows and columns."""

    def __init__(self, path: Path, table: PointTable, shape: tuple[int, int] | None) -> None:
        count = len(table.columns['x'])
        found = table.shape or shape
        if found is None:
            raise ImportFileError(
                f'{path} is not organized: it does not say how many rows and columns its {count} points '
                'form, so give the shape.'
            )
        if shape is not None and shape != found:
            raise ImportFileError(f'{path} has {found[0]} × {found[1]} points, not {shape[0]} × {shape[1]}.')
        if table.places is None and found[0] * found[1] != count:
            raise ImportFileError(f'{path} has {count} points, which are not {found[0]} × {found[1]}.')
        if table.places is not None and table.places.max() >= count:
            raise ImportFileError(f'{path} has a range_grid that names points which are not there: save it again.')
        self.shape = found
        self.places = table.places

    def place(self, values: Array, empty: float) -> Array:
        """Arrange `values` (N,) to (rows, columns), with `empty` where the grid has no point."""
        if self.places is None:
            return values.reshape(self.shape)
        placed = np.full(self.places.shape, empty, values.dtype)
        there = self.places >= 0
        placed[there] = values[self.places[there]]
        return placed.reshape(self.shape)


def _as_coordinates(values: Array) -> Array:
    """Float32 stays, and holds a half float; everything else becomes float64, which loses nothing of it."""
    small = values.dtype.kind == 'f' and values.dtype.itemsize <= 4
    return values.astype(np.float32 if small else np.float64)


def _as_field(values: Array) -> Array:
    """Convert to a type that a PointCloud2 can hold, in the machine's byte order."""
    kind, size = values.dtype.kind, values.dtype.itemsize
    if kind == 'b':
        return values.astype(np.uint8)
    if kind in 'iu' and size <= 4:
        return values.astype(f'{kind}{size}')
    return _as_coordinates(values)


def _checked(path: Path, cloud: ImportedCloud) -> ImportedCloud:
    if not np.isfinite(cloud.points).all(axis=-1).any():
        raise ImportFileError(f'{path} has no measured point: every height is NaN or infinite.')
    return cloud
