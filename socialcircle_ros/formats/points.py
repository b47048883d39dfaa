# SPDX-License-Identifier: Apache-2.0
"""Clouds into files that hold every coordinate: PLY, PCD, text with x, y and z; and the text back.

The fields that are written have names for which `is_allowed` holds, and types of PointCloud2: see `fields`.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.cloud import checked_pitch
from socialcircle_ros.errors import ImportFileError

from .matrix import check_labels
from .surface import MATRIX, SOURCE_FORMAT, MeasuredSurface, OrganizedCloud, given_pitch
from .text import BYTE_ORDER_MARK, open_text

if TYPE_CHECKING:
    from socialcircle_ros.cloud import Pitch, PitchLike

    from .fields import PointValues

RESERVED = ('x', 'y', 'z')
"""Names that no field of these files can have."""

_PLY_TYPES = {
    'i1': 'char', 'u1': 'uchar', 'i2': 'short', 'u2': 'ushort', 'i4': 'int', 'u4': 'uint', 'f4': 'float',
    'f8': 'double',
}  # fmt: skip
_SEPARATORS = {'.csv': ',', '.xyz': ' '}
_SIGNATURE = '# socialcircle cloud'
_LEAST_COLUMNS = 3  # of a matrix; two numbers in a line are a profile
_LONGEST_LINE, _LONGEST_HEADER = 8 << 20, 16 << 20  # bytes


def is_allowed(sign: str) -> bool:
    """Whether a name of a field may have a character: PLY is ASCII, and spaces end a name in PCD and in text."""
    return sign.isalnum() and sign.isascii()


def write_ply(path: Path, cloud: OrganizedCloud) -> None:
    """Write a binary PLY file with the numbers of rows and columns, as `obj_info`."""
    table = _table(cloud)
    rows, columns = table.shape
    properties = ''.join(
        f'property {_PLY_TYPES[table.dtype[name].str[1:]]} {name}\n' for name in table.dtype.names or ()
    )
    header = (
        'ply\nformat binary_little_endian 1.0\n'
        f'{_comments(cloud, "comment")}obj_info num_cols {columns}\nobj_info num_rows {rows}\n'
        f'element vertex {table.size}\n{properties}end_header\n'
    )
    path.write_bytes(header.encode() + table.tobytes())


def write_pcd(path: Path, cloud: OrganizedCloud) -> None:
    """Write a binary PCD file; its WIDTH and HEIGHT are the columns and rows.

    A cloud with the HEIGHT 1 has no rows for other programs, so that a comment tells a single row.
    """
    table = _table(cloud)
    rows, columns = table.shape
    names = table.dtype.names or ()
    kinds = [table.dtype[name] for name in names]
    single_row = '# rows 1\n' if rows == 1 else ''
    header = (
        '# .PCD v0.7 - Point Cloud Data file format\n'
        f'{_comments(cloud, "#")}{single_row}VERSION 0.7\nFIELDS {" ".join(names)}\n'
        f'SIZE {" ".join(str(kind.itemsize) for kind in kinds)}\n'
        f'TYPE {" ".join(kind.kind.upper() for kind in kinds)}\nCOUNT {" ".join("1" for _ in names)}\n'
        f'WIDTH {columns}\nHEIGHT {rows}\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {table.size}\nDATA binary\n'
    )
    path.write_bytes(header.encode() + table.tobytes())


def write_text(path: Path, cloud: OrganizedCloud) -> None:
    """Write one line per point, with as many digits as give the same numbers back.

    The separator is a comma in `.csv` and a space in `.xyz`.
    """
    table = _table(cloud)
    separator = _SEPARATORS[path.suffix.lower()]
    names = table.dtype.names or ()
    forms = {'f4': '%.9g', 'f8': '%.17g'}
    formats = [forms.get(table.dtype[name].str[1:], '%d') for name in names]
    kinds = ' '.join(table.dtype[name].str[1:] for name in names)
    rows, columns = table.shape
    header = (
        f'{_SIGNATURE}\n{_comments(cloud, "#")}# rows {rows}\n# columns {columns}\n# types {kinds}\n'
        f'{separator.join(names)}\n'
    )
    with path.open('w', encoding='utf-8', newline='\n') as file:
        file.write(header)
        np.savetxt(file, table.ravel(), formats, separator)


def is_own_text(path: Path) -> bool:
    """Whether `write_text` wrote a file."""
    with path.open('rb') as file:
        head = file.read(len(BYTE_ORDER_MARK) + len(_SIGNATURE))
    return head.removeprefix(BYTE_ORDER_MARK).startswith(_SIGNATURE.encode())


def read_text(path: Path) -> OrganizedCloud:
    """Read what `write_text` wrote.

    Raises:
        ImportFileError: the file was changed so that it contradicts its header, or is cut off.
    """
    comments = comments_of(path)
    with open_text(path) as file:
        line = next((line for line in file if not line.startswith('#')), '')
        separator = _SEPARATORS[path.suffix.lower()]
        names = line.strip().split(separator)
        try:
            kinds = comments['types'].split()
            unknown = any(np.dtype(kind).kind not in 'biuf' for kind in kinds)
            if unknown or not all(names) or len(set(names)) < len(names):
                raise ValueError(names)  # noqa: TRY301 - reported below, as every other fault of the header
            layout = np.dtype([(name, f'<{kind}') for name, kind in zip(names, kinds, strict=True)])
            shape = int(comments['rows']), int(comments['columns'])
            table = np.loadtxt(file, layout, delimiter=separator, ndmin=1, comments=None).reshape(shape)
            points = np.stack([table[axis] for axis in 'xyz'], axis=-1)
        except (ValueError, KeyError, TypeError):
            raise ImportFileError(
                f'{path} does not match its header, or is cut off: export it again, or remove the lines that begin'
                ' with # to import it as text of another program.'
            ) from None
    fields = {name: np.ascontiguousarray(table[name]) for name in names if name not in ('x', 'y', 'z')}
    return OrganizedCloud(
        points, comments.get('unit'), fields, metadata_of(comments.get('metadata')), pitch_of(comments)
    )


def is_matrix(path: Path, *, least: int = 4) -> bool:
    """Whether the first line of a text has commas between its values, and more of them than a point has."""
    with open_text(path) as file:
        first = next((line for line in file if line.strip() and not line.startswith('#')), '')
    return ';' not in first and first.count(',') >= least - 1


def read_matrix(path: Path, pitch: 'PitchLike | None', unit: str | None) -> MeasuredSurface:
    """Read heights, one row per line, with commas between them; an empty place is not measured.

    Raises:
        ImportFileError: a line has something else, no pitch is given, or the first row or column are labels.
    """
    try:
        with open_text(path) as file:
            heights = np.loadtxt(file, np.float64, delimiter=',', ndmin=2, converters=_height)
    except ValueError as error:
        raise ImportFileError(
            f'{path} is no matrix of numbers with commas between them ({str(error).splitlines()[0]}):'
            ' save it again.'
        ) from None
    check_labels(path, heights)
    return MeasuredSurface(heights, given_pitch(path, pitch), unit, metadata={SOURCE_FORMAT: MATRIX})


def read_bare_matrix(path: Path, pitch: 'PitchLike | None', unit: str | None) -> MeasuredSurface | None:
    """Read heights, one row per line, with spaces or tabs between them; None if the file has anything else.

    Raises:
        ImportFileError: no pitch is given, or the first row or column are labels.
    """
    try:
        with open_text(path) as file:
            heights = np.loadtxt(file, np.float64, comments=None, ndmin=2)
    except ValueError:
        return None
    if heights.shape[1] < _LEAST_COLUMNS:
        return None
    check_labels(path, heights)
    return MeasuredSurface(heights, given_pitch(path, pitch), unit, metadata={SOURCE_FORMAT: MATRIX})


def _height(text: str) -> float:
    return float(text) if text.strip() else float('nan')


def comments_of(path: Path) -> dict[str, str]:
    """The comments `unit`, `metadata` and so on in the header of a PLY, PCD or text file that was written here."""
    found: dict[str, str] = {}
    with path.open('rb') as file:
        # The data of a damaged file may have no end of a line.
        for line in iter(lambda: file.readline(_LONGEST_LINE), b''):
            if file.tell() > _LONGEST_HEADER or line.startswith((b'end_header', b'DATA ')):
                break
            words = line.removeprefix(BYTE_ORDER_MARK).decode('utf-8', errors='replace').split(' ', 2)
            if len(words) == 3 and words[0] in ('#', 'comment'):
                found.setdefault(words[1], ''.join(filter(str.isprintable, words[2])).strip())
            elif path.suffix.lower() in _SEPARATORS and not words[0].startswith('#'):
                break
    return found


def _comments(cloud: OrganizedCloud, mark: str) -> str:
    """The lines of a header that hold the unit, the pitch and the metadata."""
    lines = f'{mark} unit {cloud.unit}\n' if cloud.unit else ''
    if cloud.pitch:
        lines += f'{mark} pitch {cloud.pitch[0]!r} {cloud.pitch[1]!r}\n'
    if cloud.metadata:
        lines += f'{mark} metadata {json.dumps(dict(cloud.metadata), ensure_ascii=True)}\n'
    return lines


def pitch_of(comments: Mapping[str, str]) -> 'Pitch | None':
    """The pitch in the comments of a header; None: it is not there, or is none."""
    try:
        return checked_pitch([float(word) for word in comments.get('pitch', '').split()])
    except ValueError:
        return None


def metadata_of(text: str | None) -> dict[str, str]:
    """The metadata that a file which was written here has as JSON; none where that is missing or damaged."""
    try:
        content = json.loads(text or '{}')
    except ValueError:
        return {}
    return {str(key): str(value) for key, value in content.items()} if isinstance(content, dict) else {}


def _table(cloud: OrganizedCloud) -> NDArray[np.void]:
    """The cloud as records, (rows, columns), little-endian, x, y and z first."""
    columns: dict[str, PointValues] = {axis: cloud.points[..., place] for place, axis in enumerate('xyz')}
    columns |= cloud.fields
    layout = np.dtype([(name, f'<{values.dtype.str[1:]}') for name, values in columns.items()])
    table = np.empty(cloud.points.shape[:2], layout)
    for name, values in columns.items():
        table[name] = values
    return table
