# SPDX-License-Identifier: Apache-2.0
"""Organized clouds: their check, their memory as the kernels read it, their measured points and their grid."""

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from typing import NamedTuple, TypeAlias, cast

import numpy as np
import numpy.typing as npt

from socialcircle_ros.digits import size_text
from socialcircle_ros.errors import CloudError, shown
from socialcircle_ros.kernels.compiled import kernel

Cloud = npt.NDArray[np.float32] | npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

Real = np.float32 | np.float64
"""A scalar of the cloud's own dtype."""

Floats = npt.NDArray[np.float32] | npt.NDArray[np.float64]
"""An array of the cloud's own dtype."""

HeightMap = npt.NDArray[np.float32 | np.float64]
"""(H, W) heights, NaN where not measured."""

Memory = tuple[Floats, int, int]
"""The values of a cloud, its row step and its point step: see `flattened`."""

_ONE, _TWO, _THREE, _FOUR = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(4)


_SAMPLE = 4096  # points that tell the grid of a cloud
_NARROW = 1e-9  # of the extent of a cloud: one that is narrower than this is a line
_BLOCK = 20480  # points that are compared with a grid at a time: their numbers stay in the cache of the core
_ROUNDING_OF_FIT = 1e-12  # of the largest coordinate: more than that of float64
_ROUNDINGS = 8  # that coordinates may be off a regular grid, in steps of their data type at the largest coordinate

Pitch = tuple[float, float]
"""Distance of two points along x and along y, in the unit of the heights."""

PitchLike: TypeAlias = Sequence[float | np.floating | np.integer] | npt.NDArray[np.floating | np.integer]
"""What a caller may give for a pitch: two numbers in a tuple, a list or an array. `checked_pitch` makes it one."""


def organized(xyz: npt.ArrayLike) -> Cloud:
    """Check that `xyz` is an organized cloud, and make it readable for the kernels.

    Args:
        xyz: (H, W, 3) float32 or float64, any strides; rows are y, columns are x. What a masked array masks
            becomes NaN.

    Returns:
        The same array where its memory is native and aligned, else a copy that is.

    Raises:
        CloudError: another shape or data type, or no point at all.
    """
    cloud = _floats(xyz)
    if cloud.ndim != 3 or cloud.shape[2] != 3:
        raise CloudError(f'An organized cloud has the shape (rows, columns, 3), not {cloud.shape}.')
    return _native(cloud)


def organized_from(values: npt.ArrayLike, pitch: PitchLike | None) -> Cloud:
    """An organized cloud from what users have: a cloud, or a height map.

    Args:
        values: as for `organized`; or heights (H, W) with a pitch. An xarray DataArray of heights with two evenly
            spaced coordinates needs no pitch.
        pitch: of heights.

    Raises:
        CloudError: neither, another data type, no point at all, or heights without a pitch.
    """
    if np.ndim(values) != 2:
        if pitch is not None:
            raise CloudError('A pitch belongs to heights (rows, columns); a cloud has x and y of its own.')
        return organized(values)
    return _from_heights(_floats(values), _pitch_of_coordinates(values) if pitch is None else checked_pitch(pitch))


def checked_pitch(pitch: PitchLike) -> Pitch:
    """The pitch as two numbers.

    Raises:
        CloudError: it is something else, such as text or a set, which has no order; or one is not above 0.
    """
    try:
        if isinstance(pitch, (str, bytes, bytearray, memoryview, AbstractSet, Mapping)):
            raise TypeError(pitch)  # noqa: TRY301 - reported below, as every other fault of the pitch
        dx, dy = (_number(distance) for distance in pitch)
    except (TypeError, ValueError, OverflowError):
        raise CloudError(f'The pitch is {shown(pitch)}; give two numbers: pitch=(dx, dy).') from None
    if not (0 < dx < np.inf and 0 < dy < np.inf):
        raise CloudError(f'The pitch is ({dx:g}, {dy:g}); both distances must be above 0, and finite.')
    return dx, dy


def _number(value: object) -> float:
    """One number as float; Python's own `float` takes text, durations and arrays of one value, too.

    Raises:
        TypeError, ValueError: it is no number.
    """
    scalar = np.asarray(value)
    if scalar.ndim or scalar.dtype.kind not in 'fiuO':  # O: such as Fraction
        raise TypeError(value)
    return float(value)  # type: ignore[arg-type]


def unmasked(values: npt.ArrayLike) -> npt.NDArray[np.generic]:
    """The values as an array without a mask, with NaN for what a masked array masks.

    Whole numbers have no NaN. Where one of them is masked, they become float32 if it holds all of their type, else
    float64.

    Raises:
        CloudError: there are masked whole numbers, and float64 does not hold the others.
    """
    if not np.ma.isMaskedArray(values):
        return np.asarray(values)
    array = np.ma.asanyarray(values)
    plain: npt.NDArray[np.generic] = np.asarray(array)
    if plain.dtype.kind not in 'biuf' or not np.ma.is_masked(array):
        return plain
    kept = np.where(array.mask, plain.dtype.type(0), plain)  # what is masked may be any number
    floats = kept.astype(kept.dtype if kept.dtype.kind == 'f' else np.result_type(kept.dtype, np.float32))
    if not is_exact(floats, kept):
        raise CloudError('Masked whole numbers lose digits as float64, which marks what is masked: fill them.')
    floats[array.mask] = np.nan
    return floats


def mask_of_points(name: str, given: npt.ArrayLike, shape: tuple[int, ...]) -> Mask:
    """A mask of the points of a cloud; a point that a masked array masks is not in it.

    Raises:
        CloudError: it has another shape than the cloud, (H, W), or is not bool.
    """
    mask = np.asarray(np.ma.filled(given, False) if np.ma.is_masked(given) else given)
    if mask.shape != shape or mask.dtype != np.bool_:
        found = f'{mask.dtype} of the shape {mask.shape}'
        raise CloudError(f'{name} must be a bool mask of the shape of the cloud {shape}, not {found}.')
    return mask


def is_exact(floats: npt.NDArray[np.floating], values: npt.NDArray[np.generic]) -> bool:
    """Whether floats that values were converted to hold all of them.

    Args:
        floats: of the shape of the values; float64 where these are whole numbers of more than 32 bits.
        values: numbers or bool.
    """
    if values.dtype.kind == 'f':
        return bool(np.array_equal(floats.astype(values.dtype), values, equal_nan=True))
    if values.dtype.itemsize <= 4:
        return True
    # 2⁶³ and 2⁶⁴ are floats, but not whole numbers of 64 bits, and must not be converted back.
    limits = np.iinfo(np.int64 if values.dtype.kind == 'i' else np.uint64)
    inside = (floats >= float(limits.min)) & (floats < float(limits.max))
    return bool(inside.all()) and bool(np.array_equal(floats.astype(values.dtype), values))


def as_floats(values: npt.NDArray[np.generic]) -> Floats | None:
    """Numbers as float32 if that holds every value of their type, as it does for half floats; else as float64.

    Returns:
        The values in native byte order; the same array where it has one of these types already. Floats of more
        than 64 bits are rounded. None: these are no numbers, or whole numbers that float64 does not hold.
    """
    if values.dtype.kind not in 'fiu':
        return None
    if values.dtype.kind == 'f' and values.dtype.itemsize <= 4:
        return _native(values.astype(np.float32, copy=False))
    floats = values.astype(np.float64, copy=False)
    return _native(floats) if values.dtype.kind == 'f' or is_exact(floats, values) else None


def _floats(values: npt.ArrayLike) -> Floats:
    """The values with NaN for what is masked.

    Raises:
        CloudError: another data type, or no value at all.
    """
    array: npt.NDArray[np.generic] = (
        np.ma.asanyarray(values) if np.ma.isMaskedArray(values) else np.asarray(values)
    )
    if array.dtype.kind != 'f' or array.dtype.itemsize not in (4, 8):
        raise CloudError(
            f'Coordinates must be float32 or float64, not {array.dtype}; convert them with'
            ' np.asarray(xyz, dtype=np.float64).'
        )
    if array.size == 0:
        raise CloudError(f'The cloud has no point: its shape is {array.shape}.')
    return cast('Floats', unmasked(array))


def _native(array: Floats) -> Floats:
    """The array in native byte order and aligned memory."""
    if array.dtype.isnative and array.flags.aligned:
        return array
    return cast('Floats', array.astype(array.dtype.newbyteorder('='), order='C'))


def _from_heights(heights: Floats, pitch: Pitch | None) -> Cloud:
    """The cloud of a height map, in its dtype: x and y of the point at (row, column) are column·dx and row·dy."""
    if pitch is None:
        raise CloudError(
            f'Heights of the shape {heights.shape} need the pitch: remove_outliers(z, pitch=(dx, dy)), in their'
            ' unit.'
        )
    height, width = heights.shape
    cloud = np.empty((height, width, 3), heights.dtype.newbyteorder('='))
    cloud[..., 0], cloud[..., 1] = grid_coordinates((height, width), pitch, cloud.dtype)
    cloud[..., 2] = heights
    return cast('Cloud', cloud)


def grid_coordinates(
    shape: tuple[int, int], pitch: Pitch, kind: np.dtype[np.float32 | np.float64]
) -> tuple[Floats, Floats]:
    """The coordinates of a regular grid: x is column · dx, y is row · dy.

    Args:
        shape: rows and columns.
        pitch: dx and dy.
        kind: of the coordinates.

    Returns:
        x (columns,), and y (rows, 1).

    Raises:
        CloudError: the data type does not hold them; they would be infinite, and no point measured.
    """
    with np.errstate(over='ignore'):
        x, y = (
            cast('Floats', (np.arange(count) * distance).astype(kind))
            for count, distance in zip(shape[::-1], pitch, strict=True)
        )
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise CloudError(
            f'{kind} does not hold the coordinates of {size_text(*shape)} of points with the pitch ({pitch[0]:g},'
            f' {pitch[1]:g}): check the pitch.'
        )
    return x, y[:, np.newaxis]


def _pitch_of_coordinates(heights: npt.ArrayLike) -> Pitch | None:
    """The pitch of an xarray DataArray with two coordinates; None: another object, or one without coordinates.

    Raises:
        CloudError: the coordinates are no numbers or not evenly spaced, or their unit is not that of the heights.
    """
    names, coordinates = getattr(heights, 'dims', ()), getattr(heights, 'coords', None)
    if coordinates is None or len(names) != 2 or any(name not in coordinates for name in names):
        return None
    units = {str(getattr(each, 'attrs', {}).get('units', '')) for each in (heights, *map(coordinates.get, names))}
    if len(units) > 1:
        raise CloudError(
            f'Heights and coordinates differ in their units: {", ".join(sorted(map(repr, units)))}; convert them'
            ' to one.'
        )
    distances = []
    for name in names:
        values = np.asarray(coordinates[name])
        if values.dtype.kind not in 'fiu':  # dates would become nanoseconds
            raise CloudError(f'The coordinate {name!r} has {values.dtype}, not numbers; give pitch=(dx, dy).')
        if len(values) < 2:
            raise CloudError(f'The coordinate {name!r} has one value, which tells no pitch; give pitch=(dx, dy).')
        steps = np.diff(values.astype(np.float64))
        if not np.allclose(steps, steps[0], rtol=1e-3, atol=0) or steps[0] == 0:
            raise CloudError(f'The coordinate {name!r} is not evenly spaced; give pitch=(dx, dy).')
        distances.append(abs(float(steps[0])))
    return distances[1], distances[0]


def flattened(xyz: Cloud) -> Memory:
    """The cloud as the kernels take it, so that each is compiled once per data type, for all layouts.

    Args:
        xyz: (H, W, 3), any strides.

    Returns:
        The values, (n,), contiguous and read-only, the row step and the point step, in values: x of the point at
        (row, column) is `values[row * row_step + column * point_step]`, y and z follow it. A view where x, y and z
        are adjacent and rows and columns ascend in memory, as in nearly every cloud; else a copy.
    """
    height, width, _ = xyz.shape
    size = xyz.itemsize
    memory: npt.NDArray[np.generic] = xyz
    row_bytes, point_bytes, coordinate_bytes = xyz.strides
    ascending = xyz.size > 0 and row_bytes > 0 and point_bytes >= 3 * size and coordinate_bytes == size
    if not ascending or row_bytes % size or point_bytes % size:
        memory = np.array(xyz, order='C')
        row_bytes, point_bytes = 3 * size * width, 3 * size
    row_step, point_step = row_bytes // size, point_bytes // size
    length = (height - 1) * row_step + (width - 1) * point_step + 3 if xyz.size else 0
    values = np.lib.stride_tricks.as_strided(memory, (length,), (size,), writeable=False)
    return cast('Floats', values), row_step, point_step


def measured_points(xyz: Cloud) -> Mask:
    """Mask (H, W) of the measured points: those with finite x, y and z."""
    height, width, _ = xyz.shape
    measured = np.empty((height, width), np.bool_)
    _measure(*flattened(xyz), np.empty((4, width + 2), xyz.dtype), measured)
    return measured


@kernel
def _measure(values: Floats, row_step: int, point_step: int, line: Floats, measured: Mask) -> None:
    height, width = measured.shape
    for row in range(height):
        load_row(values, row * row_step, point_step, width, line)
        x, y, z = line[0, 1:], line[1, 1:], line[2, 1:]
        for column in range(width):
            measured[row, column] = is_measured(x[column], y[column], z[column])


def measured_only(xyz: Cloud, measured: Mask) -> Cloud:
    """The cloud with NaN where a point is not measured, such as at a mark that the filter has recognised.

    Args:
        xyz: (H, W, 3), unchanged.
        measured: (H, W) bool.
    """
    return np.where(measured[..., None], xyz, xyz.dtype.type(np.nan))


@kernel
def is_measured(x: Real, y: Real, z: Real) -> bool:
    """Whether all three are finite: finite - finite is 0, Inf - Inf and NaN - NaN are NaN."""
    finite: bool = (x - x) + (y - y) + (z - z) == 0
    return finite


@kernel
def load_row(values: Floats, start: int, point_step: int, width: int, line: Floats) -> None:
    """Write x, y and z of one row of points into the first three of `line`, (4, ≥ W + 2), from index 1 on.

    Loops over such lines are vectorised. This loop is vectorised too where the step is a constant and whole points
    are read: 0.4 ms instead of 1.9 ms for 1.2 million points of 4 values, although the fourth is not used.
    Unsigned indices avoid the check for negative indices, which prevents vectorisation.
    """
    x, y, z, spare = line[0, 1:], line[1, 1:], line[2, 1:], line[3, 1:]
    at = np.uint64(start)
    done = 0
    if point_step == 3:
        for column in range(width):
            i = at + _THREE * np.uint64(column)
            x[column], y[column], z[column] = values[i], values[i + _ONE], values[i + _TWO]
        done = width
    elif point_step == 4:
        # The last point of a cloud may have no fourth value.
        for column in range(width - 1):
            i = at + _FOUR * np.uint64(column)
            x[column], y[column], z[column] = values[i], values[i + _ONE], values[i + _TWO]
            spare[column] = values[i + _THREE]
        done = width - 1
    for column in range(done, width):
        i = at + np.uint64(point_step) * np.uint64(column)
        x[column], y[column], z[column] = values[i], values[i + _ONE], values[i + _TWO]


class NearestGrid(NamedTuple):
    """The regular grid nearest to x and y of a cloud: origin + column · column_step + row · row_step.

    It may be turned about z, mirrored or oblique. A cloud that is off any regular grid has one, too.
    """

    origin: tuple[float, float]
    """x and y at row 0, column 0, in the unit of the cloud."""

    column_step: tuple[float, float]
    """x and y from a column to the next."""

    row_step: tuple[float, float]
    """x and y from a row to the next."""

    is_flat: bool
    """Whether the points lie on one line of the grid, so that the steps hold along this line only."""

    @property
    def pitch(self) -> Pitch | None:
        """Lengths of the column step and of the row step in the plane of x and y; None: on a line, not known."""
        if self.is_flat:
            return None
        return float(np.hypot(*self.column_step)), float(np.hypot(*self.row_step))

    def coordinates(self, shape: tuple[int, int]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Give x and y of the points of this grid from its origin on, (H, W) each."""
        rows, columns = np.arange(shape[0], dtype=np.float64)[:, np.newaxis], np.arange(shape[1], dtype=np.float64)
        (column_x, column_y), (row_x, row_y) = self.column_step, self.row_step
        return row_x * rows + column_x * columns, row_y * rows + column_y * columns

    def holds(self, xyz: Cloud, measured: Mask) -> bool:
        """Whether x and y of all measured points are on the grid, to the rounding of their data type.

        Args:
            xyz: (H, W, 3).
            measured: (H, W) bool.
        """
        height, width = measured.shape
        columns = np.arange(width, dtype=np.float64)
        some = -(-_BLOCK // width)
        for axis in (0, 1):
            start, step, row_step = self.origin[axis], self.column_step[axis], self.row_step[axis]
            ends = [start + r * row_step + c * step for r in (0, height - 1) for c in (0, width - 1)]
            largest = max(map(abs, ends))
            limit = max(_ROUNDINGS * float(np.spacing(xyz.dtype.type(largest))), _ROUNDING_OF_FIT * largest)
            line = start + step * columns
            for first in range(0, height, some):
                rows = slice(first, first + some)
                places = row_step * np.arange(first, min(first + some, height))[:, np.newaxis] + line
                np.subtract(xyz[rows, :, axis], places, out=places)
                if ((np.abs(places, out=places) > limit) & measured[rows]).any():
                    return False
        return True


def nearest_grid(xyz: Cloud, measured: Mask) -> NearestGrid | None:
    """Find the regular grid nearest to x and y of the measured points, by least squares.

    Args:
        xyz: (H, W, 3).
        measured: (H, W) bool, points with finite x and y; some thousand of them are used, the same each time.

    Returns:
        The grid; None if fewer than two points are measured, or x and y do not tell apart points that lie in
        different rows or columns, as where all x are equal.
    """
    at = np.flatnonzero(measured)
    if len(at) > _SAMPLE:
        # At random, because points in equal steps can all lie in one column.
        at = np.random.default_rng(0).choice(at, _SAMPLE)
    if len(at) < 2:
        return None
    rows, columns = np.unravel_index(at, measured.shape)
    numbers = np.column_stack([columns, rows]).astype(np.float64)
    places = xyz[rows, columns, :2].astype(np.float64)
    middle, centre = numbers.mean(axis=0), places.mean(axis=0)
    steps, _, rank, _ = np.linalg.lstsq(numbers - middle, places - centre, rcond=None)
    extent = np.linalg.svd((numbers - middle) @ steps, compute_uv=False) / np.sqrt(len(at))
    rounding = float(np.spacing(np.abs(places).max().astype(xyz.dtype)))
    if np.count_nonzero(extent > max(rounding, _NARROW * extent[0])) < rank:
        return None
    origin, column_step, row_step = ((float(x), float(y)) for x, y in (centre - middle @ steps, *steps))
    return NearestGrid(origin, column_step, row_step, is_flat=bool(rank < 2))
