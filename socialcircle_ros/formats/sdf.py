# SPDX-License-Identifier: Apache-2.0
"""SDF files, ISO 25178-71: a header of texts, and heights as text or in binary, in m."""

import json
import struct
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.digits import size_text
from socialcircle_ros.errors import ImportFileError

from .surface import MeasuredSurface
from .text import BYTE_ORDER_MARK
from .times import date_of_sdf

if TYPE_CHECKING:
    from socialcircle_ros.cloud import HeightMap, Pitch

_TYPES = {0: '<u1', 1: '<u2', 2: '<u4', 3: '<f4', 4: '<i1', 5: '<i2', 6: '<i4', 7: '<f8'}
# What marks a point that was not measured: in ISO 25178-71 the smallest value of the type. It has no types
# without a sign; Gwyddion marks with the largest value of 16 and 32 bits, and with nothing in 8 bits.
_MARKS = {1: 2**16 - 1, 2: 2**32 - 1, 4: -(2**7), 5: -(2**15), 6: -(2**31)}
# Floats beyond are marks, too: of either sign, and with fewer digits as text.
_LARGEST_HEIGHTS = {3: 3.4e38, 7: 1.79e308}
_BINARY = struct.Struct('<8s10s12s12sHHddddBBB')
_KEYS = ('NumPoints', 'NumProfiles', 'Xscale', 'Yscale', 'Zscale', 'Compression', 'DataType')
_METADATA = 'socialcircle = '


def write_sdf(path: Path, surface: MeasuredSurface) -> None:
    """Write a surface in m as text, with as many digits as give the same numbers back.

    BAD is written for what is not measured, and for a number that means that in the data type: one that is nearly
    as large as the type holds.
    """
    heights = surface.heights
    rows, columns = heights.shape
    single = heights.dtype.itemsize == 4
    kind = 3 if single else 7
    largest = _LARGEST_HEIGHTS[kind]
    header = (
        'aISO-1.0\n'
        'ManufacID   = SOCIALCIRC\n'
        'CreateDate  = 000000000000\n'
        'ModDate     = 000000000000\n'
        f'NumPoints   = {columns}\n'
        f'NumProfiles = {rows}\n'
        f'Xscale      = {float(surface.pitch[0])!r}\n'
        f'Yscale      = {float(surface.pitch[1])!r}\n'
        'Zscale      = 1.0\n'
        'Zresolution = -1.0\n'
        'Compression = 0\n'
        f'DataType    = {kind}\n'
        'CheckType   = 0\n'
        '*\n'
    )
    form = '{:.9g}' if single else '{:.17g}'
    with path.open('w', encoding='utf-8', newline='\n') as file:
        file.write(header)
        for row in heights.tolist():
            file.write(' '.join(form.format(value) if abs(value) < largest else 'BAD' for value in row))
            file.write('\n')
        file.write(f'*\n{_METADATA}{json.dumps(dict(surface.metadata), ensure_ascii=True)}\n*\n')


def read_sdf(path: Path) -> MeasuredSurface:
    """Read a surface; its unit is m.

    NaN is what was not measured: `BAD` in text, NaN and infinity, and the value of the data type that marks it,
    which is the smallest of a type with a sign, the largest of uint16 and uint32, and none of uint8. So a height
    with this value is lost.

    Raises:
        ImportFileError: the file is no SDF file, is cut off, or is compressed.
    """
    content = path.read_bytes().removeprefix(BYTE_ORDER_MARK)
    try:
        if content.startswith(b'bISO-1.0'):
            return _read_binary(path, content)
        if content.startswith(b'aISO-1.0'):
            return _read_text(path, content.decode('utf-8', errors='replace'))
    except (ValueError, KeyError, IndexError, struct.error):
        raise ImportFileError(f'{path} has an invalid SDF header, or is cut off: save it again.') from None
    raise ImportFileError(f'{path} is not an SDF file of ISO 25178-71: it must begin with aISO-1.0 or bISO-1.0.')


def _read_binary(path: Path, content: bytes) -> MeasuredSurface:
    _, _, created, _, columns, rows, dx, dy, scale, _, packed, kind, _ = _BINARY.unpack_from(content)
    dtype = np.dtype(_TYPES[kind])
    size = rows * columns * dtype.itemsize
    raw = np.frombuffer(content[_BINARY.size : _BINARY.size + size], dtype).reshape(rows, columns)
    return _surface(path, raw, kind, (dx, dy), scale, packed, date_of_sdf(created.decode('ascii', 'replace')))


def _read_text(path: Path, text: str) -> MeasuredSurface:
    parts = [part.strip('\n') for part in text.replace('\r', '\n').split('\n*')]
    lines = [line.partition('=') for line in parts[0].split('\n') if '=' in line]
    header = {name.strip().lower(): value.split('=')[-1].strip() for name, _, value in lines}
    columns, rows, dx, dy, scale, packed, kind = (header[key.lower()] for key in _KEYS)
    dtype = np.dtype(_TYPES[int(kind)])
    words = ['nan' if word.upper() == 'BAD' else word for word in parts[1].split()]
    if len(words) != int(rows) * int(columns):
        raise ImportFileError(
            f'{path} has {len(words)} heights, not {size_text(int(rows), int(columns))}: it is cut off.'
        )
    target = dtype if dtype.kind == 'f' else np.dtype(np.float64)
    with np.errstate(over='ignore'):  # a mark may become infinite
        raw = np.array(words, np.float64).astype(target).reshape(int(rows), int(columns))
    date = date_of_sdf(header.get('createdate', ''))
    surface = _surface(path, raw, int(kind), (float(dx), float(dy)), float(scale), int(packed), date)
    for line in '\n'.join(parts[2:]).split('\n'):
        if line.startswith(_METADATA):
            metadata = json.loads(line.removeprefix(_METADATA))
            return replace(surface, metadata=date | metadata)
    return surface


def _surface(
    path: Path,
    raw: NDArray[np.generic],
    kind: int,
    pitch: 'Pitch',
    scale: float,
    packed: int,
    metadata: dict[str, str],
) -> MeasuredSurface:
    if packed:
        raise ImportFileError(
            f'{path} is compressed, which ISO 25178-71 leaves open: save it without compression.'
        )
    if not all(0 < each < np.inf for each in pitch) or not raw.size:
        raise ImportFileError(f'{path} has no pitch above 0, or no points: save it again.')
    heights = cast('HeightMap', raw.astype(raw.dtype.newbyteorder('=') if raw.dtype.kind == 'f' else np.float64))
    heights[~_is_measured(heights, kind)] = np.nan
    if scale != 1:
        heights = heights.astype(np.float64) * scale
    return MeasuredSurface(heights, pitch, 'm', {}, metadata)


def _is_measured(heights: 'HeightMap', kind: int) -> NDArray[np.bool_]:
    """Where the heights of a data type, before their scale is applied, are heights."""
    unmarked = np.abs(heights) < _LARGEST_HEIGHTS.get(kind, np.inf)
    return cast('NDArray[np.bool_]', unmarked & (heights != _MARKS.get(kind, np.nan)))
