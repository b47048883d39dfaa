"""PLY and PCD files as columns of numbers, with the grid of the points if the file holds one.

No library is small and has a permissive licence: plyfile is GPL, and pypcd4 needs pydantic and a compiled LZF.
"""

import re
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.kernels.compiled import kernel

Column = NDArray[np.generic]
"""One value for each point, of any type."""

_PLY_TYPES = {
    **dict.fromkeys(('char', 'int8'), 'i1'),
    **dict.fromkeys(('uchar', 'uint8'), 'u1'),
    **dict.fromkeys(('short', 'int16'), 'i2'),
    **dict.fromkeys(('ushort', 'uint16'), 'u2'),
    **dict.fromkeys(('int', 'int32'), 'i4'),
    **dict.fromkeys(('uint', 'uint32'), 'u4'),
    **dict.fromkeys(('float', 'float32'), 'f4'),
    **dict.fromkeys(('double', 'float64'), 'f8'),
}
_PLY_ORDERS = {'ascii': '=', 'binary_little_endian': '<', 'binary_big_endian': '>'}
_PLY_SIZE = re.compile(
    r'(?:obj_info|comment)\s+(num_cols|num_rows|width|height)\s*[:=]?\s*(\d+)\s*', re.IGNORECASE
)
_PCD_KINDS = {'I': 'i', 'U': 'u', 'F': 'f'}


@dataclass
class PointTable:
    """The points of a file as columns.

    Attributes:
        columns: the values by name, (N,) each, or (N, count) if a point has several values.
        shape: (rows, columns) of the grid; None if the file does not hold it.
        places: (rows · columns,) the index of the point at each place of the grid, row by row; -1: no point. None:
            the points are in the order of the grid.
    """

    columns: dict[str, Column]
    shape: tuple[int, int] | None
    places: NDArray[np.int64] | None = None


@dataclass
class _PlyElement:
    name: str
    count: int
    properties: list[tuple[str, str]] = field(default_factory=list)  # name, NumPy type
    list_type: tuple[str, str] | None = None  # NumPy types of the count and of an entry


def read_pcd(path: Path) -> PointTable:
    """Read a PCD file with ascii, binary or binary_compressed data.

    Raises:
        ImportFileError: the file is no PCD file, contradicts itself, or is cut off.
    """
    content = path.read_bytes()
    header, encoding, start = _pcd_header(path, content)
    try:
        names = header['FIELDS']
        counts = [int(count) for count in header.get('COUNT', ['1'] * len(names))]
        width, height = int(header['WIDTH'][0]), int(header['HEIGHT'][0])
        points = int(header.get('POINTS', [str(width * height)])[0])
        layout = [
            # PCL names each padding `_`; the names of a dtype must differ.
            (f'_{place}' if name == '_' else name, f'<{_PCD_KINDS[kind]}{int(size)}', (count,))
            for place, (name, kind, size, count) in enumerate(
                zip(names, header['TYPE'], header['SIZE'], counts, strict=True)
            )
        ]
        record = np.dtype(layout)
    except (KeyError, IndexError, ValueError, TypeError):
        raise ImportFileError(
            f'{path} has an invalid PCD header: save it again with the program that made it.'
        ) from None
    if points != width * height or points <= 0:
        raise ImportFileError(
            f'{path} has a header with {points} points, but {width} × {height} places: save it again with matching'
            ' counts.'
        )
    data = content[start:]
    if encoding == 'ascii':
        table = _ascii_rows(path, data, points, sum(counts))
        ends = np.cumsum(counts)
        columns = {
            name: table[:, end - count : end].astype(record[name].base)
            for name, end, count in zip(record.names or (), ends, counts, strict=True)
        }
    elif encoding == 'binary':
        rows = np.frombuffer(_first(path, data, points * record.itemsize), record)
        columns = {name: rows[name] for name in record.names or ()}
    elif encoding == 'binary_compressed':
        columns = _pcd_compressed(path, data, points, record)
    else:
        raise ImportFileError(f'{path} has PCD data of the unknown type {encoding!r}: save it as binary.')
    kept = {
        name: values[:, 0] if values.shape[1] == 1 else values
        for name, values in columns.items()
        if not name.startswith('_')
    }
    return PointTable(kept, (height, width) if height > 1 else None)


def _pcd_header(path: Path, content: bytes) -> tuple[dict[str, list[str]], str, int]:
    """Read the entries of the header, the type of the data, and the offset of the data."""
    header: dict[str, list[str]] = {}
    position = 0
    while (end := content.find(b'\n', position)) >= 0:
        words = content[position:end].decode('ascii', errors='replace').split()
        position = end + 1
        if not words or words[0].startswith('#'):
            continue
        if words[0] == 'DATA' and len(words) == 2:
            return header, words[1], position
        if not words[0].isalpha():
            break
        header[words[0]] = words[1:]
    raise ImportFileError(f'{path} is not a PCD file, or its header is cut off: save it again.')


def _pcd_compressed(path: Path, data: bytes, points: int, record: np.dtype[np.void]) -> dict[str, Column]:
    """Decompress the LZF block of PCL, which holds one field after the other, each for all points."""
    packed, unpacked = (int(size) for size in np.frombuffer(_first(path, data, 8), '<u4'))
    if unpacked != points * record.itemsize:
        raise ImportFileError(f'{path} has compressed data that do not match its header: save it again as binary.')
    out = np.empty(unpacked, np.uint8)
    if _lzf(np.frombuffer(_first(path, data[8:], packed), np.uint8), out) != unpacked:
        raise ImportFileError(f'{path} has damaged compressed data: save it again as binary.')
    columns = {}
    start = 0
    for name in record.names or ():
        inner = record[name]
        values = out[start : start + points * inner.itemsize].view(inner.base)
        columns[name] = values.reshape(points, -1)
        start += points * inner.itemsize
    return columns


@kernel
def _lzf(packed: NDArray[np.uint8], out: NDArray[np.uint8]) -> int:
    """Decompress the format of LibLZF.

    Args:
        packed: the compressed bytes.
        out: receives the decompressed bytes.

    Returns:
        The number of decompressed bytes; -1 if the input is invalid.
    """
    read = 0
    written = 0
    while read < packed.size:
        control = int(packed[read])
        read += 1
        if control < 32:  # a run of control + 1 literal bytes
            length = control + 1
            if read + length > packed.size or written + length > out.size:
                return -1
            out[written : written + length] = packed[read : read + length]
            read += length
            written += length
            continue
        length = (control >> 5) + 2  # a copy of earlier output; source and target may overlap
        if length == 9:
            if read >= packed.size:
                return -1
            length += int(packed[read])
            read += 1
        if read >= packed.size:
            return -1
        source = written - ((control & 31) << 8) - int(packed[read]) - 1
        read += 1
        if source < 0 or written + length > out.size:
            return -1
        for _ in range(length):
            out[written] = out[source]
            written += 1
            source += 1
    return written


def read_ply(path: Path) -> PointTable:
    """Read the vertices of a PLY file, and its `range_grid` if it has one.

    Raises:
        ImportFileError: the file is no PLY file, contradicts itself, or is cut off.
    """
    content = path.read_bytes()
    order, elements, sizes, start = _ply_header(path, content)
    rows = sizes.get('num_rows', sizes.get('height'))
    columns = sizes.get('num_cols', sizes.get('width'))
    shape = (rows, columns) if rows and columns else None
    body = content[start:]
    table = PointTable({}, shape)
    for element in elements:
        if element.count > len(body):
            raise _cut_off(path)  # before memory is allocated for the count of a damaged header
        if element.list_type is None:
            values, body = _ply_rows(path, order, element, body)
            if element.name == 'vertex':
                table.columns = values
        elif element.name == 'range_grid':
            if shape is None or element.count != shape[0] * shape[1]:
                raise ImportFileError(
                    f'{path} has a range_grid that does not match its num_cols and num_rows: save it again.'
                )
            table.places, body = _ply_places(path, order, element, body)
        else:
            break  # faces are not needed
    if not table.columns:
        raise ImportFileError(f'{path} has no vertices before its faces: save it again with the vertices first.')
    return table


def _ply_header(path: Path, content: bytes) -> tuple[str, list[_PlyElement], dict[str, int], int]:
    """Read the byte order ('=': ascii), the elements, the sizes of the grid, and the offset of the data."""
    match = re.match(rb'ply\s*?\n(.*?\n)end_header\s*?\n', content, re.DOTALL)
    if match is None:
        raise ImportFileError(f'{path} is not a PLY file, or its header is cut off: save it again.')
    order = ''
    elements: list[_PlyElement] = []
    sizes: dict[str, int] = {}
    try:
        for line in match[1].decode('utf-8', errors='replace').splitlines():
            words = line.split()
            if size := _PLY_SIZE.fullmatch(line.strip()):
                sizes[size[1].lower()] = int(size[2])
            elif words[:1] == ['format']:
                order = _PLY_ORDERS[words[1]]
            elif words[:1] == ['element']:
                elements.append(_PlyElement(words[1], int(words[2])))
            elif words[:2] == ['property', 'list']:
                elements[-1].list_type = (_PLY_TYPES[words[2]], _PLY_TYPES[words[3]])
            elif words[:1] == ['property']:
                elements[-1].properties.append((words[2], _PLY_TYPES[words[1]]))
        if not order or any(element.count < 0 for element in elements):
            raise ValueError(order)  # noqa: TRY301 - reported below, as every other fault of the header
    except (KeyError, IndexError, ValueError):
        raise ImportFileError(
            f'{path} has an invalid PLY header: save it again with the program that made it.'
        ) from None
    return order, elements, sizes, match.end()


def _ply_rows(path: Path, order: str, element: _PlyElement, body: bytes) -> tuple[dict[str, Column], bytes]:
    """Read the columns of an element without lists, and give the rest of the data."""
    try:
        record = np.dtype([(name, order + kind) for name, kind in element.properties])
    except ValueError:
        raise ImportFileError(f'{path} names a property twice: save it again.') from None
    if order != '=':
        size = element.count * record.itemsize
        rows = np.frombuffer(_first(path, body, size), record) if size else np.empty(0, record)
        return {name: rows[name] for name in record.names or ()}, body[size:]
    lines = body.split(b'\n', element.count)
    values = _ascii_rows(path, b'\n'.join(lines[: element.count]), element.count, len(element.properties))
    columns = {name: values[:, place].astype(kind) for place, (name, kind) in enumerate(element.properties)}
    return columns, b''.join(lines[element.count :])


def _ply_places(path: Path, order: str, element: _PlyElement, body: bytes) -> tuple[NDArray[np.int64], bytes]:
    """Read the range_grid, which has a list of one index or none for each place, and give the rest of the data."""
    places = np.full(element.count, -1, np.int64)
    counts, entries = (np.dtype(order + kind) for kind in element.list_type or ('u1', 'i4'))
    position = 0
    try:
        if order == '=':
            lines = body.split(b'\n', element.count)
            for place in range(element.count):
                words = lines[place].split()
                if int(words[0]):
                    places[place] = int(words[1])
            return places, b''.join(lines[element.count :])
        for place in range(element.count):
            count = int(np.frombuffer(body, counts, 1, position)[0])
            position += counts.itemsize
            if count:
                places[place] = np.frombuffer(body, entries, 1, position)[0]
            position += count * entries.itemsize
    except (ValueError, IndexError, OverflowError):
        raise _cut_off(path) from None
    return places, body[position:]


def _ascii_rows(path: Path, text: bytes, rows: int, columns: int) -> NDArray[np.float64]:
    """Read lines of numbers, (rows, columns).

    Raises:
        ImportFileError: a line has something else, or the shape differs.
    """
    if not text.strip():
        raise _cut_off(path)  # np.loadtxt only warns
    try:
        table = np.loadtxt(BytesIO(text), np.float64, ndmin=2, comments=None)
    except ValueError:
        raise ImportFileError(
            f'{path} has a line without {columns} numbers: save it again, or remove that line.'
        ) from None
    if table.shape != (rows, columns):
        raise ImportFileError(
            f'{path} should have {rows} lines of {columns} numbers, but has {table.shape[0]} of '
            f'{table.shape[1]}: it is cut off or its header is wrong; save it again.'
        )
    return table


def _first(path: Path, data: bytes, size: int) -> bytes:
    """The first `size` bytes.

    Raises:
        ImportFileError: there are fewer.
    """
    if len(data) < size:
        raise _cut_off(path)
    return data[:size]


def _cut_off(path: Path) -> ImportFileError:
    return ImportFileError(f'{path} is cut off: it has fewer points than its header says; save it again.')
