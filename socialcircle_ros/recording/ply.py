# SPDX-License-Identifier: Apache-2.0
"""PLY files, as PCL, CloudCompare and Open3D write them.

No library has a permissive licence: plyfile is GPL.
"""

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.formats.text import BYTE_ORDER_MARK

from .point_table import FieldValues, PointTable, ascii_columns, cut_off, first, unique_names

_TYPES = {
    **dict.fromkeys(('char', 'int8'), 'i1'),
    **dict.fromkeys(('uchar', 'uint8'), 'u1'),
    **dict.fromkeys(('short', 'int16'), 'i2'),
    **dict.fromkeys(('ushort', 'uint16'), 'u2'),
    **dict.fromkeys(('int', 'int32'), 'i4'),
    **dict.fromkeys(('uint', 'uint32'), 'u4'),
    **dict.fromkeys(('int64', 'longlong'), 'i8'),
    **dict.fromkeys(('uint64', 'ulonglong'), 'u8'),
    **dict.fromkeys(('float', 'float32'), 'f4'),
    **dict.fromkeys(('double', 'float64'), 'f8'),
}
_STRUCT = dict(zip(('i1', 'u1', 'i2', 'u2', 'i4', 'u4', 'i8', 'u8', 'f4', 'f8'), 'bBhHiIqQfd', strict=True))
_ORDERS = {'ascii': '=', 'binary_little_endian': '<', 'binary_big_endian': '>'}
_SIZE = re.compile(
    r'(?:obj_info|comment)\s+(num_cols|num_rows|width|height)\s*[:=]?\s*(\d{1,9})\s*', re.IGNORECASE
)
_VERTICES, _GRID, _CAMERA = 'vertex', 'range_grid', 'camera'


@dataclass(frozen=True)
class _Property:
    name: str
    kind: str  # NumPy type
    count_kind: str = ''  # of a list: NumPy type of its length


@dataclass
class _Element:
    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)

    @property
    def has_lists(self) -> bool:
        return any(item.count_kind for item in self.properties)


@dataclass(frozen=True)
class _PlyHeader:
    order: str  # as NumPy has it; '=': ascii
    elements: list[_Element]
    sizes: dict[str, int]
    start: int  # of the data


def read_ply(path: Path) -> PointTable:
    """Read the vertices of a PLY file, and the grid of the points if the file holds it.

    The size of the grid is in comments (`num_cols` and `num_rows`, or `width` and `height`), or in the viewport of
    the element `camera`, where PCL writes it.

    Raises:
        ImportFileError: the file is no PLY file, contradicts itself, or is cut off.
    """
    content = path.read_bytes().removeprefix(BYTE_ORDER_MARK)
    header = _read_header(path, content)
    rows = header.sizes.get('num_rows', header.sizes.get('height'))
    columns = header.sizes.get('num_cols', header.sizes.get('width'))
    table = PointTable({}, (rows, columns) if rows and columns else None)
    body = content[header.start :]
    viewport = None
    left = {element.name for element in header.elements} & {_VERTICES, _GRID, _CAMERA}
    for element in header.elements:
        if not left:
            break  # nothing more is needed
        left.discard(element.name)
        if element.count > len(body):
            raise cut_off(path)  # before memory is allocated for the count of a damaged header
        if element.name == _GRID:
            if table.shape is None or element.count != table.shape[0] * table.shape[1]:
                raise ImportFileError(
                    f'{path} has a range_grid that does not match its num_cols and num_rows: save it again.'
                )
            table.places, body = _places(path, header.order, element, body)
        elif element.has_lists:
            if element.name == _VERTICES:
                raise ImportFileError(f'{path} has lists in its vertices: save it with plain numbers.')
            body = _without(path, header.order, element, body)
        else:
            values, body = _rows(path, header.order, element, body, table.notes)
            if element.name == _VERTICES:
                table.columns = values
            elif element.name == _CAMERA:
                viewport = _viewport(values)
    if not table.columns:
        raise ImportFileError(f'{path} has no vertices: save it with an element vertex.')
    count = len(next(iter(table.columns.values())))
    if table.shape is None and viewport is not None and viewport[0] * viewport[1] == count:
        table.shape = viewport
    return table


def _read_header(path: Path, content: bytes) -> _PlyHeader:
    match = re.match(rb'ply\s*?\n(.*?\n)end_header[ \t\r]*\n', content, re.DOTALL)
    if match is None:
        raise ImportFileError(f'{path} is not a PLY file, or its header is cut off: save it again.')
    order = ''
    elements: list[_Element] = []
    sizes: dict[str, int] = {}
    try:
        for line in match[1].decode('utf-8', errors='replace').splitlines():
            words = line.split()
            if size := _SIZE.fullmatch(line.strip()):
                sizes[size[1].lower()] = int(size[2])
            elif words[:1] == ['format']:
                order = _ORDERS[words[1]]
            elif words[:1] == ['element']:
                elements.append(_Element(words[1], int(words[2])))
            elif words[:2] == ['property', 'list']:
                kind, count_kind = _TYPES[words[3]], _TYPES[words[2]]
                elements[-1].properties.append(_Property(words[4], kind, count_kind))
            elif words[:1] == ['property']:
                elements[-1].properties.append(_Property(words[2], _TYPES[words[1]]))
        counts = [item.count_kind for element in elements for item in element.properties]
        if not order or any(element.count < 0 for element in elements) or not {'f4', 'f8'}.isdisjoint(counts):
            raise ValueError(order)  # noqa: TRY301 - reported below, as every other fault of the header
    except (KeyError, IndexError, ValueError):
        raise ImportFileError(
            f'{path} has an invalid PLY header: save it again with the program that made it.'
        ) from None
    return _PlyHeader(order, elements, sizes, match.end())


def _rows(
    path: Path, order: str, element: _Element, body: bytes, notes: list[str]
) -> tuple[dict[str, FieldValues], bytes]:
    """Read the columns of an element without lists, and give the rest of the data."""
    names = [item.name for item in element.properties]
    if element.name == _VERTICES:
        names = unique_names(path, names, notes)
    kinds = [item.kind for item in element.properties]
    if not element.count or not kinds:
        return dict.fromkeys(names, np.empty(0)), body
    if order != '=':
        record = np.dtype([(f'f{place}', order + kind) for place, kind in enumerate(kinds)])
        size = element.count * record.itemsize
        rows = np.frombuffer(first(path, body, size), record)
        return {name: rows[place] for name, place in zip(names, record.names or (), strict=True)}, body[size:]
    lines = body.split(b'\n', element.count)
    columns = ascii_columns(path, b'\n'.join(lines[: element.count]), element.count, kinds)
    return dict(zip(names, columns, strict=True)), b''.join(lines[element.count :])


def _without(path: Path, order: str, element: _Element, body: bytes) -> bytes:
    """The data behind an element with lists."""
    if order == '=':
        lines = body.split(b'\n', element.count)
        if len(lines) < element.count:
            raise cut_off(path)
        return b''.join(lines[element.count :])
    position = 0
    for _, _, position in _entries(path, order, element, body):  # noqa: B007 - the last one counts
        pass
    return body[position:]


def _places(path: Path, order: str, element: _Element, body: bytes) -> tuple[NDArray[np.int64], bytes]:
    """Read the range_grid, which has a list of one index or none for each place, and give the rest of the data."""
    if [bool(item.count_kind) for item in element.properties] != [True]:
        raise ImportFileError(f'{path} has a range_grid that is not one list for each place: save it again.')
    places = np.full(element.count, -1, np.int64)
    if order == '=':
        lines = body.split(b'\n', element.count)
        try:
            for place in range(element.count):
                words = lines[place].split()
                if int(words[0]):
                    places[place] = int(words[1])
        except (ValueError, IndexError, OverflowError):
            raise cut_off(path) from None
        return places, b''.join(lines[element.count :])
    position = 0
    entry = struct.Struct(order + _STRUCT[element.properties[0].kind])
    for place, (start, count, position) in enumerate(_entries(path, order, element, body)):  # noqa: B007
        if count:
            places[place] = int(entry.unpack_from(body, start)[0])
    return places, body[position:]


def _entries(path: Path, order: str, element: _Element, body: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield for each entry of a binary element where its last list begins and how long it is, and where it ends.

    Raises:
        ImportFileError: the data are cut off.
    """
    layout = [(item, struct.Struct(order + _STRUCT[item.count_kind or item.kind])) for item in element.properties]
    position = start_of_list = count = 0
    for _ in range(element.count):
        for item, number in layout:
            start = position + number.size
            if start > len(body):
                raise cut_off(path)
            if item.count_kind:
                (count,) = number.unpack_from(body, position)
                start_of_list, start = start, start + count * int(item.kind[1:])
                if not start_of_list <= start <= len(body):
                    raise cut_off(path)
            position = start
        yield start_of_list, count, position


def _viewport(values: dict[str, FieldValues]) -> tuple[int, int] | None:
    """The size of the grid that PCL writes into the camera; None: it has none."""
    sizes = [values.get(name, np.empty(0)) for name in ('viewporty', 'viewportx')]
    if any(size.size != 1 or size.dtype.kind not in 'iu' for size in sizes):
        return None
    rows, columns = (int(size.astype(np.int64)[0]) for size in sizes)
    return (rows, columns) if rows > 1 and columns > 0 else None
