# SPDX-License-Identifier: Apache-2.0
"""What a TIFF with pages says of itself: the pitch and the z of its pages, as ImageJ and OME write it."""

import math
import re
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.lengths import METRES, known_unit

from .pictures import frame_damage_told, open_image

_DESCRIPTION, _X_RESOLUTION, _Y_RESOLUTION = 270, 282, 283  # tags


@dataclass(frozen=True)
class TiffStack:
    """The pages of a TIFF as a stack.

    Attributes:
        pages: the numbers of the pages in the order of their planes.
        z: of each page in metres; None if the file does not say it.
        pitch: (x, y) in metres; None if the file does not say it.
        notes: what the file says, one sentence each.
    """

    pages: list[int]
    z: list[float] | None
    pitch: tuple[float, float] | None
    notes: tuple[str, ...] = ()


def read_tiff_stack(path: Path) -> TiffStack:
    """Read what a TIFF says of its pages.

    Raises:
        ImportFileError: the file cannot be read, or its pages are no stack.
    """
    with open_image(path) as image, frame_damage_told(path):
        count = int(getattr(image, 'n_frames', 1))
        image.seek(0)
        tags = getattr(image, 'tag_v2', {})
        description = _text(tags.get(_DESCRIPTION, ''))
        resolution = [_real(tags.get(tag)) for tag in (_X_RESOLUTION, _Y_RESOLUTION)]
    if description.startswith('ImageJ='):
        return _imagej(path, count, description, resolution)
    if '<OME' in description[:4000]:
        return _ome(path, count, description)
    return TiffStack(list(range(count)), None, None)


def _imagej(path: Path, count: int, description: str, resolution: list[float]) -> TiffStack:
    entries = dict(line.partition('=')[::2] for line in description.splitlines())
    images, channels, slices, times = (
        _whole(entries.get(key, '1')) for key in ('images', 'channels', 'slices', 'frames')
    )
    if channels > 1 or (slices > 1 and times > 1):
        raise ImportFileError(
            f'{path} has {channels} channels, {slices} slices and {times} times: save one channel at one time.'
        )
    if images > count:
        raise ImportFileError(
            f'{path} has {images} images in one block, of which {count} can be read: save it as an image sequence.'
        )
    names = [re.sub(r'\\u00[bB]5', 'µ', entries.get(key, '').strip()) for key in ('unit', 'yunit', 'zunit')]
    unit = names[0]
    # ImageJ writes the units of y and z only where they differ from that of x.
    metres, y_metres, z_metres = (_metres(name or unit) for name in names)
    others = [f', {axis} in {name}' for axis, name in zip('yz', names[1:], strict=True) if name not in ('', unit)]
    notes = [f'ImageJ says unit {unit}{"".join(others)}' if metres else 'ImageJ names no unit of length']
    pitch = z = None
    spacing = abs(_real(entries.get('spacing')))  # negative where the first slice is the top
    if metres and y_metres and all(value > 0 for value in resolution):
        pitch = (metres / resolution[0], y_metres / resolution[1])
    if times > 1:
        notes.append('its pages are times, not slices')
    elif z_metres and spacing > 0:
        z = [page * spacing * z_metres for page in range(count)]
    return TiffStack(list(range(count)), z, pitch, tuple(notes))


def _ome(path: Path, count: int, description: str) -> TiffStack:
    pixels = _ome_pixels(path, description)
    sizes = {axis: _whole(pixels.get(f'Size{axis}', '1')) for axis in 'ZCT'}
    if sizes['C'] > 1 or sizes['T'] > 1:
        raise ImportFileError(
            f'{path} has {sizes["C"]} channels and {sizes["T"]} times: save one channel at one time.'
        )
    if sizes['Z'] != count:
        raise ImportFileError(
            f'{path} has {count} pages of {sizes["Z"]} planes: the others are in other files; save all in one.'
        )
    planes = _planes(path, pixels, count)
    notes = ['OME says how the pages lie']
    pitch = z = None
    dx, dy, step = (_length(pixels, f'PhysicalSize{axis}') for axis in 'XYZ')
    if dx and dy:
        pitch = (dx, dy)
    positions = {_whole(plane.get('TheZ', '-1')): _position(plane) for plane in pixels if _tag(plane) == 'Plane'}
    found = [positions.get(place) for place in range(count)]
    known = [position for position in found if position is not None]
    if len(known) == count and len(set(known)) == count:
        z = known
    elif step:
        z = [place * step for place in range(count)]
    return TiffStack(planes, z, pitch, tuple(notes))


def _ome_pixels(path: Path, description: str) -> ET.Element:
    """The first element `Pixels`.

    Raises:
        ImportFileError: the text is no OME, or could fill the memory.
    """
    if '<!ENTITY' not in description and '<!DOCTYPE' not in description:
        try:
            root = ET.fromstring(description.strip('\0 \r\n'))  # noqa: S314
        except ET.ParseError:
            root = None
        images = [] if root is None else [element for element in root.iter() if _tag(element) == 'Pixels']
        if len(images) > 1:
            raise ImportFileError(f'{path} has {len(images)} images: save one.')
        if images:
            return images[0]
    raise ImportFileError(f'{path} has a description by OME that cannot be read: save it without.')


def _planes(path: Path, pixels: ET.Element, count: int) -> list[int]:
    """The page of each plane along z.

    Raises:
        ImportFileError: planes are in another file, or nowhere.
    """
    pages: dict[int, int] = {}
    for data in pixels:
        if _tag(data) != 'TiffData':
            continue
        if 'IFD' not in data.attrib and 'FirstZ' not in data.attrib and 'PlaneCount' not in data.attrib:
            continue  # the pages in their order
        page, plane = _whole(data.get('IFD', '0')), _whole(data.get('FirstZ', '0'))
        for place in range(
            min(_whole(data.get('PlaneCount', '1' if 'IFD' in data.attrib else str(count))), count)
        ):
            pages[plane + place] = page + place
    planes = [pages.get(plane, -1) for plane in range(count)] if pages else list(range(count))
    if sorted(planes) != list(range(count)):
        raise ImportFileError(f'{path} has pages that OME does not name, or names twice: save it again.')
    return planes


def _text(value: object) -> str:
    """A text that Pillow decoded as Latin-1; most programs write UTF-8."""
    text = str(value)
    try:
        return text.encode('latin-1').decode('utf-8')
    except UnicodeError:
        return text


def _tag(element: ET.Element) -> str:
    return str(element.tag).rpartition('}')[2]


def _length(element: ET.Element, name: str) -> float:
    """A length in metres; 0 if it is missing or has no unit of length. OME's default unit is µm."""
    return _real(element.get(name)) * (_metres(element.get(f'{name}Unit', 'µm')) or 0.0)


def _position(plane: ET.Element) -> float | None:
    """The z of a plane in metres; None if it is missing, or in the "reference frame" of a stage."""
    scale = _metres(plane.get('PositionZUnit'))
    value = _real(plane.get('PositionZ'), math.nan)
    return None if scale is None or math.isnan(value) else value * scale


def _metres(unit: str | None) -> float | None:
    """The length of a unit in metres; None if it is none of length."""
    known = known_unit(unit)
    return None if known is None else METRES[known]


def _whole(text: str) -> int:
    match = re.fullmatch(r'\s*(-?\d{1,9})\s*', text)
    return int(match[1]) if match else 0


def _real(value: object, default: float = 0.0) -> float:
    """A finite number of a tag or a text, else the default."""
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError, ZeroDivisionError):
        return default
    return number if math.isfinite(number) else default
