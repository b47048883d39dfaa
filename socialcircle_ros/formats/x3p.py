# SPDX-License-Identifier: Apache-2.0
"""X3P files, ISO 25178-72: a zip archive with an XML header and the heights in binary, in m."""

import hashlib
import json
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import escape

import numpy as np

from socialcircle_ros.digits import size_text
from socialcircle_ros.errors import ImportFileError

from .damage import archive_damage_told
from .surface import MeasuredSurface

if TYPE_CHECKING:
    from numpy.typing import NDArray


_NAMESPACE = 'http://www.opengps.eu/2008/ISO5436_2'
_TYPES = {'I': '<i2', 'L': '<i4', 'F': '<f4', 'D': '<f8'}
_POINTS, _CHECKSUMS, _METADATA = 'bindata/data.bin', 'md5checksum.hex', 'socialcircle.json'
_LARGEST_HEADER = 16 << 20  # bytes
_EPOCH = (1980, 1, 1, 0, 0, 0)  # of every file in the archive, so that the same surface gives the same bytes

_HEADER = """\
<?xml version="1.0" encoding="UTF-8" standalone="no" ?>
<p:ISO5436_2 xmlns:p="{namespace}" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" \
xsi:schemaLocation="{namespace} {namespace}/ISO5436_2.xsd">
  <Record1>
    <Revision>ISO5436 - 2000</Revision>
    <FeatureType>SUR</FeatureType>
    <Axes>
      <CX><AxisType>I</AxisType><DataType>D</DataType><Increment>{dx!r}</Increment><Offset>0</Offset></CX>
      <CY><AxisType>I</AxisType><DataType>D</DataType><Increment>{dy!r}</Increment><Offset>0</Offset></CY>
      <CZ><AxisType>A</AxisType><DataType>{kind}</DataType><Increment>1</Increment><Offset>0</Offset></CZ>
    </Axes>
  </Record1>
  <Record3>
    <MatrixDimension><SizeX>{columns}</SizeX><SizeY>{rows}</SizeY><SizeZ>1</SizeZ></MatrixDimension>
    <DataLink>
      <PointDataLink>{points}</PointDataLink>
      <MD5ChecksumPointData>{md5}</MD5ChecksumPointData>
    </DataLink>
  </Record3>
  <Record4><ChecksumFile>{checksums}</ChecksumFile></Record4>
  <VendorSpecificID>{vendor}</VendorSpecificID>
</p:ISO5436_2>
"""


def write_x3p(path: Path, surface: MeasuredSurface) -> None:
    """Write a surface in m; NaN marks a point that was not measured, as the standard has it for floats."""
    heights = np.ascontiguousarray(surface.heights, surface.heights.dtype.newbyteorder('<'))
    data = heights.tobytes()
    rows, columns = heights.shape
    header = _HEADER.format(
        namespace=_NAMESPACE,
        dx=float(surface.pitch[0]),
        dy=float(surface.pitch[1]),
        kind='F' if heights.itemsize == 4 else 'D',
        columns=columns,
        rows=rows,
        points=_POINTS,
        md5=_md5(data),
        checksums=_CHECKSUMS,
        vendor=escape('https://index.ros.org/p/socialcircle_ros'),
    ).encode()
    files = {
        'main.xml': header,
        _POINTS: data,
        _CHECKSUMS: f'{_md5(header)} *main.xml\n'.encode(),
        _METADATA: json.dumps(dict(surface.metadata), ensure_ascii=True, indent=1).encode(),
    }
    with zipfile.ZipFile(path, 'w', zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(name, _EPOCH), content, zipfile.ZIP_DEFLATED)


def read_x3p(path: Path) -> MeasuredSurface:
    """Read a surface; its unit is m.

    Raises:
        ImportFileError: the file is no X3P file, is damaged, or holds something other than one height map.
    """
    with (
        archive_damage_told(path, 'is not an X3P file, or is damaged: save it again.'),
        zipfile.ZipFile(path) as archive,
    ):
        return _read(path, archive)


def _read(path: Path, archive: zipfile.ZipFile) -> MeasuredSurface:
    if archive.getinfo('main.xml').file_size > _LARGEST_HEADER:
        raise ImportFileError(f'{path} has a header of more than 16 MB: it is damaged; save it again.')
    root = ET.fromstring(archive.read('main.xml'))  # noqa: S314 - expat refuses bombs of entities; nothing else is run
    for element in root.iter():
        element.tag = element.tag.rpartition('}')[2]
    if _text(root, 'Record1/FeatureType') != 'SUR' or _text(root, 'Record3/MatrixDimension/SizeZ', '1') != '1':
        raise ImportFileError(
            f'{path} holds no height map, but a profile or a point list: export it as a surface.'
        )
    try:
        kinds = [_text(root, f'Record1/Axes/C{axis}/AxisType') for axis in 'XYZ']
        pitch = tuple(float(_text(root, f'Record1/Axes/C{axis}/Increment')) for axis in 'XY')
        scale = float(_text(root, 'Record1/Axes/CZ/Increment', '1'))
        offset = float(_text(root, 'Record1/Axes/CZ/Offset', '0'))
        columns, rows = (int(_text(root, f'Record3/MatrixDimension/Size{axis}')) for axis in 'XY')
        kind = np.dtype(_TYPES[_text(root, 'Record1/Axes/CZ/DataType')])
    except ValueError:
        raise ImportFileError(f'{path} has a header with invalid numbers: save it again.') from None
    if kinds != ['I', 'I', 'A'] or not all(0 < each < np.inf for each in pitch) or min(rows, columns) < 1:
        raise ImportFileError(f'{path} has no regular grid with pitches above 0: export it as a height map.')
    data = _member(path, archive, root, 'PointDataLink', 'MD5ChecksumPointData')
    if len(data) != rows * columns * kind.itemsize:
        raise ImportFileError(
            f'{path} has {len(data)} bytes of heights, not {size_text(rows, columns)} × {kind.itemsize} bytes.'
        )
    raw: NDArray[np.generic] = np.frombuffer(data, kind).reshape(rows, columns)
    if raw.dtype.kind == 'f' and (scale, offset) == (1.0, 0.0):
        heights = raw.astype(raw.dtype.newbyteorder('='))
    else:
        heights = raw.astype(np.float64) * scale + offset
    if _text(root, 'Record3/DataLink/ValidPointsLink', ''):
        bits = np.frombuffer(_member(path, archive, root, 'ValidPointsLink', 'MD5ChecksumValidPoints'), np.uint8)
        if bits.size * 8 < raw.size:
            raise ImportFileError(f'{path} has too few bytes that say which points are valid: save it again.')
        valid = np.unpackbits(bits, count=raw.size, bitorder='little').astype(np.bool_).reshape(rows, columns)
        heights[~valid] = np.nan
    metadata = _metadata(archive, root)
    return MeasuredSurface(heights, pitch, 'm', {}, metadata)


def _member(path: Path, archive: zipfile.ZipFile, root: ET.Element, link: str, checksum: str) -> bytes:
    """A binary file of the archive, checked against its checksum where the header has one."""
    name = _text(root, f'Record3/DataLink/{link}', '')
    if not name:
        raise ImportFileError(f'{path} holds its heights as text in the header, not in binary: save it as binary.')
    data = archive.read(name.lstrip('/'))
    stated = _text(root, f'Record3/DataLink/{checksum}', '').strip().lower()
    if len(stated) == 32 and stated != _md5(data):
        raise ImportFileError(f'{path} is damaged: the checksum of {name} does not match; copy it again.')
    return data


def _metadata(archive: zipfile.ZipFile, root: ET.Element) -> Mapping[str, str]:
    found = {}
    for name in ('Date', 'Instrument/Manufacturer', 'Instrument/Model', 'Comment'):
        text = _text(root, f'Record2/{name}', '')
        if text and not text.startswith('1970-01-01'):  # what a program writes that does not know the date
            found[name.rpartition('/')[2].lower()] = text
    if _METADATA in archive.namelist():
        content = json.loads(archive.read(_METADATA))
        found |= {str(key): str(value) for key, value in content.items()} if isinstance(content, dict) else {}
    return found


def _text(root: ET.Element, place: str, default: str | None = None) -> str:
    """The text of an element.

    Raises:
        KeyError: it is missing, and there is no default.
    """
    text = root.findtext(place)
    if text is None or (not text.strip() and default is not None):
        if default is None:
            raise KeyError(place)
        return default
    return text.strip()


def _md5(data: bytes) -> str:
    """The checksum in lower case, as the program `md5sum` prints it, which the standard names."""
    return hashlib.md5(data, usedforsecurity=False).hexdigest()
