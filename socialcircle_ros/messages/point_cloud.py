# SPDX-License-Identifier: Apache-2.0
"""sensor_msgs/PointCloud2: organized clouds looked at in place, and written with outliers taken out."""

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Cloud, Mask, unmasked
from socialcircle_ros.digits import size_text
from socialcircle_ros.errors import CloudError, MessageError
from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .cdr import CdrReader, CdrWriter
from .header import Header

TYPE = 'sensor_msgs/msg/PointCloud2'

DATATYPES = {1: 'i1', 2: 'u1', 3: 'i2', 4: 'u2', 5: 'i4', 6: 'u4', 7: 'f4', 8: 'f8'}
"""sensor_msgs/PointField's datatypes as NumPy writes them, without byte order."""

_NAMES = {1: 'INT8', 2: 'UINT8', 3: 'INT16', 4: 'UINT16', 5: 'INT32', 6: 'UINT32', 7: 'FLOAT32', 8: 'FLOAT64'}
Bits = npt.NDArray[np.uint32] | npt.NDArray[np.uint64]
BitsOfOne = np.uint32 | np.uint64

_LEAST_FIELD = 17  # bytes of a PointField with an empty name


@dataclass(frozen=True)
class PointField:
    """sensor_msgs/PointField: where in a point a value stands."""

    name: str
    offset: int
    datatype: int
    count: int = 1


@dataclass(frozen=True)
class PointCloud:
    """A PointCloud2 where it lies: its description, and its bytes untouched.

    `message` is the whole serialized message; the points begin at `data_start` in it. `row_step` is the distance
    of two rows; where row_step is the size of the whole cloud without padding, rows have width ·
    point_step.
    """

    message: bytes | memoryview
    header: Header
    height: int
    width: int
    fields: tuple[PointField, ...]
    is_bigendian: bool
    point_step: int
    row_step: int
    data_start: int
    data_length: int
    is_dense: bool

    @classmethod
    def decode(cls, message: bytes | memoryview) -> 'PointCloud':
        """Walk through a serialized PointCloud2; no point is looked at or copied.

        Raises:
            MessageError: the bytes are not a PointCloud2, or end early.
        """
        reader = CdrReader(message)
        header = Header.read(reader)
        height, width = reader.uint32(), reader.uint32()
        fields = tuple(
            PointField(reader.string(), reader.uint32(), reader.uint8(), reader.uint32())
            for _ in range(reader.count(_LEAST_FIELD))
        )
        is_bigendian = reader.boolean()
        point_step, row_step = reader.uint32(), reader.uint32()
        data_start, data_length = reader.octets()
        packed = width * point_step
        if row_step == height * packed == data_length:
            # PointCloud2Modifier::resize(width, height) of sensor_msgs leaves the size of the whole cloud here.
            row_step = packed
        return cls(
            message=message,
            header=header,
            height=height,
            width=width,
            fields=fields,
            is_bigendian=is_bigendian,
            point_step=point_step,
            row_step=row_step,
            data_start=data_start,
            data_length=data_length,
            is_dense=reader.boolean(),
        )

    def xyz(self) -> Cloud:
        """The coordinates, (height, width, 3) float32 or float64, native byte order.

        Where x, y and z are of one type and evenly spaced, as they nearly always are, the array is a view of
        the message: no copy. It is read-only.

        Raises:
            MessageError: not an organized cloud with x, y and z as floats, or one that contradicts itself;
                the sentence says in what.
        """
        self.check()
        x, y, z = (self._values(self.message, self.field(name)) for name in 'xyz')
        dx, dy, dz = (self.field(name).offset for name in 'xyz')
        together = x.dtype == y.dtype == z.dtype and dy - dx == dz - dy
        if not (together and x.dtype.isnative):
            stacked = np.stack([x, y, z], axis=2)
            return stacked.astype(stacked.dtype.newbyteorder('='), copy=False)
        view = np.ndarray(
            (self.height, self.width, 3),
            x.dtype,
            self.message,
            offset=self.data_start + dx,
            strides=(self.row_step, self.point_step, dy - dx),
        )
        view.flags.writeable = False
        return view

    def check(self) -> None:
        """See that this is an organized cloud with coordinates, and that it does not contradict itself.

        Raises:
            MessageError: it is not; says in what, and what to do.
        """
        if self.height == 0 or self.width == 0:
            raise MessageError(f'The cloud is empty: height {self.height}, width {self.width}.')
        if self.height == 1:
            raise MessageError(
                f'The cloud is not organized: height 1, width {self.width}; the filter needs the grid of the'
                ' sensor, so publish the cloud with its rows and columns and NaN where nothing was measured.'
            )
        needed = self.width * self.point_step
        if self.point_step == 0 or self.row_step < needed:
            raise MessageError(
                f'The cloud contradicts itself: row_step is {self.row_step}, but {self.width} points of'
                f' {self.point_step} bytes take {needed}.'
            )
        if self.data_length < self.row_step * self.height:
            raise MessageError(
                f'The cloud is cut short: data has {self.data_length} bytes, but row_step × height ='
                f' {self.row_step} × {self.height} = {self.row_step * self.height}.'
            )
        fields = sorted((self.field(name) for name in 'xyz'), key=lambda field: field.offset)
        for first, second in pairwise(fields):
            if first.offset + self._kind(first).itemsize > second.offset:
                raise MessageError(
                    f'The cloud contradicts itself: the fields {first.name!r} and {second.name!r} overlap, at'
                    f' offsets {first.offset} and {second.offset}.'
                )

    def field(self, name: str) -> PointField:
        """The coordinate field `name`.

        Raises:
            MessageError: there is none, it is not one float, or it does not lie within the point.
        """
        field = next((field for field in self.fields if field.name == name), None)
        if field is None:
            there = ', '.join(field.name for field in self.fields) or 'none'
            raise MessageError(f'The cloud has no field {name!r}; its fields are: {there}.')
        if field.datatype not in (7, 8) or field.count > 1:
            kind = _NAMES.get(field.datatype, f'unknown datatype {field.datatype}')
            raise MessageError(
                f'The field {name!r} is {field.count} × {kind}; a coordinate must be one FLOAT32 or FLOAT64.'
            )
        if field.offset + np.dtype(DATATYPES[field.datatype]).itemsize > self.point_step:
            raise MessageError(
                f'The field {name!r} at offset {field.offset} does not fit into a point of'
                f' {self.point_step} bytes.'
            )
        return field

    def values(self, name: str) -> npt.NDArray[np.generic]:
        """The values (height, width) of a field that holds one float, such as `quality`; a view of the message.

        Raises:
            MessageError: there is no such field, it is not one float, or the cloud contradicts itself.
        """
        self.check()
        return self._values(self.message, self.field(name))

    def without(self, outliers: Mask, *, dense: bool) -> bytes:
        """This message with x, y and z of the outliers NaN; every other byte stays as it came.

        Args:
            outliers: (height, width) mask.
            dense: whether every point of the result is measured: the value of is_dense.

        Returns:
            The serialized message.
        """
        return _written(bytes(len(self.message)), lambda target: self.write_without(outliers, target, dense=dense))

    def write_without(self, outliers: Mask, target: memoryview, *, dense: bool) -> None:
        """Write what `without` returns into memory that the caller reuses.

        Rows are copied and their outliers overwritten in one pass, on all cores: 20 MB take about 1 ms.

        Args:
            outliers: (height, width) mask.
            target: writable, as long as the message, and not the message itself.
            dense: whether every point of the result is measured: the value of is_dense.
        """
        source = np.frombuffer(self.message, np.uint8)
        source.flags.writeable = False  # as of a message in bytes: one type for the kernel, compiled once
        copy = np.frombuffer(target, np.uint8)
        first, last = self.data_start, self.data_start + self.height * self.row_step
        copy[:first] = source[:first]
        copy[last:] = source[last:]
        source_rows, rows = (memory[first:last].reshape(self.height, self.row_step) for memory in (source, copy))
        # As whole numbers: the byte order plays no part for the kernel, and NaN keeps its bits.
        fields = [(values, f'=u{values.itemsize}') for values in self._coordinates(target)]
        xyz = [values.view(bits) for values, bits in fields]
        nan_x, nan_y, nan_z = (np.full(1, np.nan, values.dtype).view(bits)[0] for values, bits in fields)

        def write(band: slice) -> None:
            x, y, z = (values[band] for values in xyz)
            coordinates = _CoordinateBits(x, y, z, nan_x, nan_y, nan_z)
            _copy_without(source_rows[band], outliers[band], rows[band], coordinates)

        in_bands(write, self.height, self.width)
        copy[self.data_start + self.data_length] = dense

    def replaced(self, where: Mask, xyz: Cloud, *, dense: bool) -> bytes:
        """This message with other x, y and z for some points; every other byte stays as it came.

        Args:
            where: (height, width) mask of the points.
            xyz: (height, width, 3) what they get.
            dense: whether every point of the result is measured: what is_dense will say.

        Returns:
            The serialized message.
        """

        def fill(message: memoryview) -> None:
            rows, columns = np.nonzero(where)
            for axis, name in enumerate('xyz'):
                self._values(message, self.field(name))[rows, columns] = xyz[rows, columns, axis]
            message[self.data_start + self.data_length] = dense

        return _written(bytes(self.message), fill)

    def _kind(self, field: PointField) -> np.dtype[np.generic]:
        return np.dtype(('>' if self.is_bigendian else '<') + DATATYPES[field.datatype])

    def _coordinates(self, message: bytes | memoryview) -> list[npt.NDArray[np.generic]]:
        """x, y and z as (height, width) views of `message`, which has this cloud's layout."""
        return [self._values(message, self.field(name)) for name in 'xyz']

    def _values(self, message: bytes | memoryview, field: PointField) -> npt.NDArray[np.generic]:
        """One field of all points as a (height, width) view of `message`, which has this cloud's layout."""
        return np.ndarray(
            (self.height, self.width),
            self._kind(field),
            message,
            offset=self.data_start + field.offset,
            strides=(self.row_step, self.point_step),
        )


class _CoordinateBits(NamedTuple):
    """x, y and z of a cloud as whole numbers of their width, (H, W) views of a message, and the bits of NaN."""

    x: Bits
    y: Bits
    z: Bits
    nan_x: BitsOfOne
    nan_y: BitsOfOne
    nan_z: BitsOfOne


@kernel
def _copy_without(
    source: npt.NDArray[np.uint8], outliers: Mask, target: npt.NDArray[np.uint8], coordinates: _CoordinateBits
) -> None:
    """Copy rows of a message, (H, row_step), and set x, y and z of the outliers in the copy to NaN.

    The bytes are copied in a loop of our own: an assignment of whole rows takes five times as long in Numba.
    """
    x, y, z, nan_x, nan_y, nan_z = coordinates
    for row in range(outliers.shape[0]):
        row_of_source, row_of_target = source[row], target[row]
        for i in range(row_of_source.size):
            row_of_target[i] = row_of_source[i]
        for column in range(outliers.shape[1]):
            if outliers[row, column]:
                x[row, column] = nan_x
                y[row, column] = nan_y
                z[row, column] = nan_z


def encode_point_cloud(
    header: Header, xyz: npt.ArrayLike, extra: Mapping[str, npt.ArrayLike] | None = None
) -> bytes:
    """A serialized PointCloud2 of an organized cloud.

    Args:
        header: its header.
        xyz: (H, W, 3) float32 or float64; NaN where nothing was measured. What a masked array masks becomes NaN.
        extra: further fields by name, (H, W) each, of any type that PointField knows. What is masked becomes NaN.

    Returns:
        The message: fields x, y, z, then the extra ones, without padding; is_dense as it is.

    Raises:
        MessageError: coordinates of another type or shape, or no point; a field of another shape, or of a type
            that PointField does not know; or a name that no field beside x, y and z can have.
        CloudError: a field has masked whole numbers of 64 bits and others that float64 does not hold.
    """
    points = _array('The cloud', xyz)
    if points.ndim != 3 or points.shape[2] != 3:
        raise MessageError(f'An organized cloud has the shape (rows, columns, 3), not {points.shape}.')
    height, width = points.shape[:2]
    kind: np.dtype[np.generic] = np.ma.asanyarray(xyz).dtype  # masked whole numbers became floats
    if kind.kind != 'f' or kind.itemsize not in (4, 8):
        raise MessageError(
            f'Coordinates must be float32 or float64, not {kind}; convert them with np.float64(xyz).'
        )
    if not points.size:
        raise MessageError(f'The cloud needs a point; it has {size_text(height, width)}.')
    for name in extra or ():
        if not name or '\0' in name or name in ('x', 'y', 'z'):
            raise MessageError(f'Field {name!r} has no name of its own: give it one beside x, y and z.')
    values = {name: points[..., axis] for axis, name in enumerate('xyz')}
    values |= {name: _array(f'Field {name!r}', each) for name, each in (extra or {}).items()}
    codes = {code: number for number, code in DATATYPES.items()}
    for name, array in values.items():
        if array.shape != (height, width) or array.dtype.str[1:] not in codes:
            raise MessageError(
                f'Field {name!r} is {array.shape} {array.dtype}; a cloud of {size_text(height, width)} takes'
                f' {(height, width)} of {", ".join(codes)}.'
            )
    layout = np.dtype([(name, '<' + array.dtype.str[1:]) for name, array in values.items()])
    table = np.empty((height, width), layout)
    for name, array in values.items():
        table[name] = array
    return encode_layout(header, table, table.view(np.uint8), is_dense=bool(np.isfinite(points).all()))


def _array(what: str, values: npt.ArrayLike) -> npt.NDArray[np.generic]:
    """The values as `unmasked` gives them.

    Raises:
        MessageError: they are lists of unlike lengths.
        CloudError: as by `unmasked`.
    """
    try:
        return unmasked(values)
    except CloudError:
        raise
    except ValueError:
        raise MessageError(f'{what} is no array: its rows differ in their lengths.') from None


def write_float_cloud(
    header: Header, shape: tuple[int, int], names: Sequence[str], fill: Callable[[npt.NDArray[np.float32]], bool]
) -> bytes:
    """A serialized PointCloud2 of float32 fields, written where it will stay: no copy of a large cloud.

    Args:
        header: its header.
        shape: rows and columns.
        names: of the fields, without padding between them.
        fill: gets the values, (H, W, number of names) little-endian and 0 everywhere, writes them, and says
            whether every point is measured: is_dense. It keeps no view of them.

    Returns:
        The message.
    """
    layout = np.dtype([(name, '<f4') for name in names])
    length = shape[0] * shape[1] * layout.itemsize
    description = _description(header, shape, layout, shape[1] * layout.itemsize, length)

    def write(message: memoryview) -> None:
        message[: len(description)] = description
        values = np.ndarray((*shape, len(names)), '<f4', message, offset=len(description))
        message[-1] = fill(values)

    return _written(bytes(len(description) + length + 1), write)


def _written(message: bytes, write: Callable[[memoryview], None]) -> bytes:
    """A message after something was written into it; the one that is given stays as it is.

    A BytesIO copies the given bytes only if another reference to them exists, and returns its memory without a
    copy once no view of it is left.
    """
    buffer = io.BytesIO(message)
    del message
    view = buffer.getbuffer()
    write(view)
    del view
    return buffer.getvalue()


def encode_layout(
    header: Header, points: npt.NDArray[np.generic], data: npt.NDArray[np.uint8], *, is_dense: bool = False
) -> bytes:
    """A serialized PointCloud2 of any layout.

    Args:
        header: its header.
        points: (H, W) of a structured little-endian type, as a view of `data`: its fields, their offsets and
            the item size become those of the message.
        data: (H, row_step) uint8, contiguous: the message's data, padding included.
        is_dense: what the message says of itself.
    """
    description = _description(header, points.shape[:2], points.dtype, data.shape[1], data.nbytes)
    return b''.join((description, data.data.cast('B'), bytes([is_dense])))


def _description(
    header: Header, shape: tuple[int, ...], layout: np.dtype[np.generic], row_step: int, data_length: int
) -> bytes:
    """What comes before the data of a serialized PointCloud2; behind it there is only is_dense, one byte."""
    codes = {code: number for number, code in DATATYPES.items()}
    writer = CdrWriter()
    header.write(writer)
    writer.uint32(shape[0])
    writer.uint32(shape[1])
    fields = dict(layout.fields or {})
    writer.uint32(len(fields))
    for name, (kind, offset, *_) in fields.items():
        writer.string(name)
        writer.uint32(offset)
        writer.uint8(codes[kind.str[1:]])
        writer.uint32(1)
    writer.boolean(False)
    writer.uint32(layout.itemsize)
    writer.uint32(row_step)
    writer.uint32(data_length)
    return writer.finish()
