# SPDX-License-Identifier: Apache-2.0
"""PCD files, as PCL, CloudCompare and Open3D write them.

No library is small and has a permissive licence: pypcd4 needs pydantic and a compiled LZF.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.digits import size_text
from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.formats.text import BYTE_ORDER_MARK
from socialcircle_ros.kernels.compiled import kernel

from .compression import expansion_limit, over_the_limit
from .point_table import FieldValues, PointTable, ascii_columns, cut_off, first, unique_names

_KINDS = {
    **{('F', str(size)): f'f{size}' for size in (2, 4, 8)},
    **{('I', str(size)): f'i{size}' for size in (1, 2, 4, 8)},
    **{('U', str(size)): f'u{size}' for size in (1, 2, 4, 8)},
}
_PADDING = '_'
_BEST_LZF = 88  # bytes that a byte of LZF expands to at most: 264 for 3


@dataclass(frozen=True)
class _Field:
    name: str
    kind: str
    count: int

    @property
    def size(self) -> int:
        return int(self.kind[1:]) * self.count


def read_pcd(path: Path) -> PointTable:
    """Read a PCD file with ascii, binary or binary_compressed data.

    Raises:
        ImportFileError: the file is no PCD file, contradicts itself, or is cut off.
    """
    content = path.read_bytes().removeprefix(BYTE_ORDER_MARK)
    header, encoding, start = _header(path, content)
    notes: list[str] = []
    try:
        fields = _fields(header)
        points = int(header['POINTS'][0]) if 'POINTS' in header else None
        width = int(header['WIDTH'][0]) if 'WIDTH' in header else points or 0
        height = int(header.get('HEIGHT', ['1'])[0])
    except (KeyError, IndexError, ValueError):
        raise ImportFileError(
            f'{path} has an invalid PCD header: save it again with the program that made it.'
        ) from None
    points = width * height if points is None else points
    if points != width * height or points <= 0:
        raise ImportFileError(
            f'{path} has a header with {points} points, but {size_text(height, width)}: save it again with'
            ' matching counts.'
        )
    data = content[start:]
    if encoding == 'ascii':
        columns = _ascii(path, data, points, fields)
    elif encoding == 'binary':
        columns = _binary(path, data, points, fields)
    elif encoding == 'binary_compressed':
        columns = _compressed(path, data, points, fields)
    else:
        raise ImportFileError(f'{path} has PCD data of the unknown type {encoding!r}: save it as binary.')
    kept = [(field.name, values) for field, values in zip(fields, columns, strict=True) if field.name != _PADDING]
    names = unique_names(path, [name for name, _ in kept], notes)
    table = {
        name: values[:, 0] if values.shape[1] == 1 else values
        for name, (_, values) in zip(names, kept, strict=True)
        if values.shape[1]
    }
    return PointTable(table, (height, width) if height > 1 else None, notes=notes)


def _fields(header: Mapping[str, list[str]]) -> list[_Field]:
    """The fields of a point.

    Raises:
        KeyError, ValueError: the header does not make sense.
    """
    names = header['FIELDS'] if 'FIELDS' in header else header['COLUMNS']
    counts = [int(count) for count in header.get('COUNT', ['1'] * len(names))]
    if min(counts, default=0) < 0 or sum(counts) > 10_000:
        raise ValueError(counts)
    kinds = [_KINDS[kind, size] for kind, size in zip(header['TYPE'], header['SIZE'], strict=True)]
    return [_Field(*entries) for entries in zip(names, kinds, counts, strict=True)]


def _header(path: Path, content: bytes) -> tuple[dict[str, list[str]], str, int]:
    """Read the entries of the header, the type of the data, and the offset of the data."""
    header: dict[str, list[str]] = {}
    position = 0
    while (end := content.find(b'\n', position)) >= 0:
        words = content[position:end].decode('utf-8', errors='replace').split()
        position = end + 1
        if not words or words[0].startswith('#'):
            continue
        if words[0] == 'DATA' and len(words) == 2:
            return header, words[1], position
        if not words[0].isalpha():
            break
        header[words[0]] = words[1:]
    raise ImportFileError(f'{path} is not a PCD file, or its header is cut off: save it again.')


def _ascii(path: Path, data: bytes, points: int, fields: list[_Field]) -> list[FieldValues]:
    values = iter(ascii_columns(path, data, points, [field.kind for field in fields for _ in range(field.count)]))
    return [
        np.stack([next(values) for _ in range(field.count)], axis=1) if field.count else np.empty((points, 0))
        for field in fields
    ]


def _binary(path: Path, data: bytes, points: int, fields: list[_Field]) -> list[FieldValues]:
    record = np.dtype([(f'f{place}', f'<{field.kind}', (field.count,)) for place, field in enumerate(fields)])
    rows = np.frombuffer(first(path, data, points * record.itemsize), record)
    return [rows[name] for name in record.names or ()]


def _compressed(path: Path, data: bytes, points: int, fields: list[_Field]) -> list[FieldValues]:
    """Decompress the LZF block of PCL, which holds one field after the other, each for all points."""
    packed, unpacked = (int(size) for size in np.frombuffer(first(path, data, 8), '<u4'))
    if unpacked != points * sum(field.size for field in fields):
        raise ImportFileError(f'{path} has compressed data that do not match its header: save it again as binary.')
    if len(data) - 8 < packed:
        raise cut_off(path)
    if unpacked > _BEST_LZF * packed:  # before memory is allocated
        raise _damaged(path)
    if unpacked > expansion_limit():
        raise ImportFileError(f'{path} is not read, because it {over_the_limit(unpacked)}; or save it as binary.')
    out = np.empty(unpacked, np.uint8)
    if _lzf(np.frombuffer(data, np.uint8, packed, 8), out) != unpacked:
        raise _damaged(path)
    columns = []
    start = 0
    for field in fields:
        end = start + points * field.size
        columns.append(out[start:end].view(f'<{field.kind}').reshape(points, field.count))
        start = end
    return columns


def _damaged(path: Path) -> ImportFileError:
    return ImportFileError(f'{path} has damaged compressed data: save it again as binary.')


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
