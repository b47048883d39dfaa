# SPDX-License-Identifier: Apache-2.0
"""TIFF files with heights: 32-bit floats, the pitch as in GeoTIFF, and the rest as text in the description."""

import json
import struct
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from socialcircle_ros.errors import ImportFileError, SocialCircleError, install_command

from .damage import picture_damage_told
from .surface import MeasuredSurface, given_pitch

if TYPE_CHECKING:
    from PIL import Image

    from socialcircle_ros.cloud import Pitch

_BITS, _DESCRIPTION, _SAMPLE_FORMAT, _PIXEL_SCALE, _NO_DATA = 258, 270, 339, 33550, 42113
_UNSIGNED = 1  # a sample format, and what a file without that tag has
_KINDS = {_UNSIGNED: 'whole numbers without a sign', 2: 'whole numbers with a sign', 3: 'floats'}
_DOUBLES = 12  # the type of a tag
_MODES = ('F', 'I', 'I;16', 'I;16B', 'I;16L')


def write_tiff(path: Path, surface: MeasuredSurface) -> None:
    """Write a surface in float32.

    Raises:
        SocialCircleError: Pillow is not installed.
    """
    try:
        from PIL import Image, TiffImagePlugin  # noqa: PLC0415 - an extra
    except ImportError:
        raise SocialCircleError(f'TIFF files need Pillow: {install_command("pictures")}.') from None
    tags = TiffImagePlugin.ImageFileDirectory_v2()
    text = {
        'dx': float(surface.pitch[0]),
        'dy': float(surface.pitch[1]),
        'unit': surface.unit,
        'metadata': dict(surface.metadata),
    }
    tags[_DESCRIPTION] = json.dumps(text, ensure_ascii=True)
    tags[_PIXEL_SCALE] = (*(float(each) for each in surface.pitch), 0.0)
    tags.tagtype[_PIXEL_SCALE] = _DOUBLES
    tags[_NO_DATA] = 'nan'
    heights = np.ascontiguousarray(surface.heights, np.float32)
    Image.fromarray(heights).save(path, format='TIFF', tiffinfo=tags)


def read_tiff(path: Path, pitch: 'Pitch | None', unit: str | None) -> MeasuredSurface:
    """Read heights, and their pitch where the file has it.

    Args:
        path: of the file.
        pitch: dx and dy of a file that does not have them.
        unit: of a file that does not name it.

    Raises:
        ImportFileError: the file has no heights, but a picture; or no pitch.
    """
    try:
        from PIL import Image  # noqa: PLC0415 - an extra
    except ImportError:
        raise ImportFileError(f'TIFF files need Pillow: {install_command("pictures")}.') from None
    try:
        with picture_damage_told(path, 'is damaged, or no TIFF file: save it again.'), _opened(path) as image:
            mode, pages = image.mode, getattr(image, 'n_frames', 1)
            tags = dict(getattr(image, 'tag_v2', {}))
            values = np.asarray(image) if mode in _MODES and pages == 1 else None
    except Image.DecompressionBombError:
        raise ImportFileError(
            f'{path} states more pixels than are read here: it is damaged, or to be split.'
        ) from None
    if pages != 1:
        raise ImportFileError(f'{path} has {pages} pages; a height map is one page of numbers: split the file.')
    if values is None:
        raise ImportFileError(
            f'{path} is a picture of the mode {mode}, not a height map: save heights as 32-bit float or 16-bit.'
        )
    described = _described(tags.get(_DESCRIPTION))
    if 'dx' in described and mode != 'F':
        raise ImportFileError(f'{path} is damaged: it does not say that its heights are float32; export it again.')
    scale = tags.get(_PIXEL_SCALE)
    stated = (described.get('dx'), described.get('dy')) if 'dx' in described else tuple(scale or ())[:2]
    found = tuple(float(each) for each in stated if isinstance(each, (int, float)))
    known = (found[0], found[1]) if len(found) == 2 and min(found) > 0 else given_pitch(path, pitch)
    if mode == 'I' and tags.get(_BITS) == (32,) and tags.get(_SAMPLE_FORMAT, (_UNSIGNED,)) == (_UNSIGNED,):
        values = values.view(np.uint32)  # Pillow has no mode for these, and takes their bits for signed numbers
    heights = values.astype(np.float32 if mode == 'F' else np.float64)
    no_data = str(tags.get(_NO_DATA, 'nan')).strip('\0 ')
    with suppress(ValueError):
        heights[heights == float(no_data)] = np.nan
    named, metadata = described.get('unit'), described.get('metadata')
    return MeasuredSurface(
        heights,
        known,
        named if isinstance(named, str) else unit,
        {},
        {str(key): str(value) for key, value in metadata.items()} if isinstance(metadata, dict) else {},
    )


def _opened(path: Path) -> 'Image.Image':
    """The file, opened by Pillow.

    Raises:
        ImportFileError: it is a TIFF with a type of number that Pillow does not read, as uint32 in big-endian.
        OSError: it is no TIFF file.
    """
    from PIL import Image, TiffImagePlugin, UnidentifiedImageError  # noqa: PLC0415 - an extra

    try:
        return Image.open(path)
    except UnidentifiedImageError:
        tags = TiffImagePlugin.ImageFileDirectory_v2()
        with suppress(struct.error), path.open('rb') as file:
            tags = TiffImagePlugin.ImageFileDirectory_v2(file.read(8))
            file.seek(tags.next)
            tags.load(file)
        kind = _KINDS.get(tags.get(_SAMPLE_FORMAT, (_UNSIGNED,))[0])
        bits = tags.get(_BITS, (0,))[0]
        if kind is None or bits not in (8, 16, 32, 64):
            raise
        order = 'big' if tags.prefix == b'MM' else 'little'
        raise ImportFileError(
            f'{path} has {kind} of {bits} bits in {order}-endian order, which Pillow does not read: save heights'
            ' as 32-bit float, or as .npy.'
        ) from None


def _described(text: object) -> dict[str, object]:
    """The description of a file that `write_tiff` wrote."""
    try:
        content = json.loads(text) if isinstance(text, str) else None
    except ValueError:
        return {}
    return content if isinstance(content, dict) else {}
