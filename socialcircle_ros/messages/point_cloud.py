"""sensor_msgs/PointCloud2: organized clouds looked at in place, and written with outliers taken out."""

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.errors import MessageError
from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .cdr import CdrReader, CdrWriter
from .header import Header

TYPE = 'sensor_msgs/msg/PointCloud2'

DATATYPES = {1: 'i1', 2: 'u1', 3: 'i2', 4: 'u2', 5: 'i4', 6: 'u4', 7: 'f4', 8: 'f8'}
"""sensor_msgs/PointField's datatypes as NumPy writes them, without byte order."""

_NAMES = {1: 'INT8', 2: 'UINT8', 3: 'INT16', 4: 'UINT16', 5: 'INT32', 6: 'UINT32', 7: 'FLOAT32', 8: 'FLOAT64'}
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

    `message` is the whole serialized message; the points begin at `data_start` in it.
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

    def xyz(self) -> npt.NDArray[Any]:
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
        view: npt.NDArray[Any] = np.ndarray(
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
        for name in 'xyz':
            self.field(name)

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

    def without(self, outliers: npt.NDArray[np.bool_], *, dense: bool) -> bytes:
        """This message with x, y and z of the outliers set to NaN; every other byte stays as it came.

        Args:
            outliers: (height, width) mask.
            dense: whether every point of the result is measured: what is_dense will say.

        Returns:
            The serialized message.
        """

        def write(message: memoryview) -> None:
            self._exchange(message, outliers, self._nan(outliers))
            message[self.data_start + self.data_length] = dense

        return _written(bytes(self.message), write)

    def take_out(self, outliers: npt.NDArray[np.bool_], *, dense: bool) -> Callable[[], None]:
        """Make `message`, which may be written to, what `without` gives.

        Args:
            outliers: (height, width) mask.
            dense: whether every point of the result is measured.

        Returns:
            Makes `message` again what it was, if called once.
        """
        message, flag = memoryview(self.message), self.data_start + self.data_length
        others, was_dense = self._nan(outliers), message[flag]
        self._exchange(message, outliers, others)
        message[flag] = dense

        def put_back() -> None:
            self._exchange(message, outliers, others)
            message[flag] = was_dense

        return put_back

    def _nan(self, where: npt.NDArray[np.bool_]) -> list[npt.NDArray[Any]]:
        """NaN for x, y and z of the points of a mask, each as wide as its field."""
        count = np.count_nonzero(where)
        return [np.full(count, np.nan, self._kind(self.field(name))) for name in 'xyz']

    def _exchange(
        self, message: bytes | memoryview, where: npt.NDArray[np.bool_], others: Sequence[npt.NDArray[Any]]
    ) -> None:
        """Exchange x, y and z of the points of a mask in `message` for others, (number of points,) each."""
        fields = [self._values(message, self.field(name)) for name in 'xyz']
        # As whole numbers, so that byte order plays no part for the compiled loop, and a NaN keeps its bits.
        points = [values.view(f'=u{values.itemsize}') for values in fields]
        numbers = [values.view(f'=u{values.itemsize}') for values in others]

        def exchange(band: slice) -> None:
            before = np.count_nonzero(where[: band.start])
            rows, rest = [values[band] for values in points], [values[before:] for values in numbers]
            _exchange(where[band], np.empty(self.width, np.int64), *rows, *rest)

        in_bands(exchange, self.height, self.width)

    def replaced(self, where: npt.NDArray[np.bool_], xyz: npt.NDArray[Any], *, dense: bool) -> bytes:
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

    def _kind(self, field: PointField) -> np.dtype[Any]:
        return np.dtype(('>' if self.is_bigendian else '<') + DATATYPES[field.datatype])

    def _values(self, message: bytes | memoryview, field: PointField) -> npt.NDArray[Any]:
        """One field of all points as a (height, width) view of `message`, which has this cloud's layout."""
        return np.ndarray(
            (self.height, self.width),
            self._kind(field),
            message,
            offset=self.data_start + field.offset,
            strides=(self.row_step, self.point_step),
        )


@kernel
def _exchange(where: Any, columns: Any, x: Any, y: Any, z: Any, other_x: Any, other_y: Any, other_z: Any) -> None:
    """Exchange the values where the mask says so for others, in one pass over the cloud.

    A row's points are found without a branch, which the processor would guess wrong at each; then all are
    read before one is written, so that no read waits to see where a write goes. `columns`, (W,), is for work.
    """
    i = np.uint64(0)
    for row in range(where.shape[0]):
        chosen, of_x, of_y, of_z = where[row], x[row], y[row], z[row]
        count = 0
        for column in range(where.shape[1]):
            columns[count] = column
            count += chosen[column]
        for k in range(count):
            at = np.uint64(columns[k])
            old_x, old_y, old_z = of_x[at], of_y[at], of_z[at]
            new_x, new_y, new_z = other_x[i], other_y[i], other_z[i]
            of_x[at], of_y[at], of_z[at] = new_x, new_y, new_z
            other_x[i], other_y[i], other_z[i] = old_x, old_y, old_z
            i += np.uint64(1)


def encode_point_cloud(
    header: Header, xyz: npt.NDArray[Any], extra: Mapping[str, npt.NDArray[Any]] | None = None
) -> bytes:
    """A serialized PointCloud2 of an organized cloud.

    Args:
        header: its header.
        xyz: (H, W, 3) float32 or float64; NaN where nothing was measured.
        extra: further fields by name, (H, W) each, of any type that PointField knows.

    Returns:
        The message: fields x, y, z, then the extra ones, without padding; is_dense as it is.

    Raises:
        MessageError: an array of another shape, or of a type that PointField does not know.
    """
    height, width = xyz.shape[:2]
    values = {name: xyz[..., axis] for axis, name in enumerate('xyz')} | dict(extra or {})
    codes = {code: number for number, code in DATATYPES.items()}
    for name, array in values.items():
        if array.shape != (height, width) or array.dtype.str[1:] not in codes:
            raise MessageError(
                f'Field {name!r} is {array.shape} {array.dtype}; a cloud of {height}×{width} points takes'
                f' {(height, width)} of {", ".join(codes)}.'
            )
    layout = np.dtype([(name, '<' + array.dtype.str[1:]) for name, array in values.items()])
    points = np.empty((height, width), layout)
    for name, array in values.items():
        points[name] = array
    return encode_layout(header, points, points.view(np.uint8), is_dense=bool(np.isfinite(xyz).all()))


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

    A BytesIO copies what it was given only if somebody else holds it too, and gives away what it holds
    without a copy once nobody looks at it anymore.
    """
    buffer = io.BytesIO(message)
    del message
    view = buffer.getbuffer()
    write(view)
    del view
    return buffer.getvalue()


def encode_layout(
    header: Header, points: npt.NDArray[Any], data: npt.NDArray[np.uint8], *, is_dense: bool = False
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
    header: Header, shape: tuple[int, ...], layout: np.dtype[Any], row_step: int, data_length: int
) -> bytes:
    """What comes before the data of a serialized PointCloud2; behind it there is only is_dense, one byte."""
    codes = {code: number for number, code in DATATYPES.items()}
    writer = CdrWriter()
    header.write(writer)
    writer.uint32(shape[0])
    writer.uint32(shape[1])
    fields: Any = layout.fields or {}
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
