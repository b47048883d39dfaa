# SPDX-License-Identifier: Apache-2.0
"""Frames from image files: gray values without loss, or a refusal."""

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from socialcircle_ros.errors import ImportFileError, install_command
from socialcircle_ros.formats.damage import picture_damage_told
from socialcircle_ros.messages.gray import GrayImage

if TYPE_CHECKING:
    from PIL.Image import Image

SUFFIXES = ('.png', '.tif', '.tiff', '.jpg', '.jpeg', '.bmp')
TIFF_SUFFIXES = ('.tif', '.tiff')

_BITS_PER_SAMPLE = 258  # a tag of TIFF
_WITH_ALPHA = {'LA': 'L', 'La': 'L', 'PA': 'RGB', 'RGBA': 'RGB', 'RGBa': 'RGB'}


class ImagePage(NamedTuple):
    """Where a frame is: a file, and the page of it if it has several, counted from 0."""

    path: Path
    number: int | None = None

    def __str__(self) -> str:
        return self.path.name if self.number is None else f'{self.path.name} page {self.number + 1}'


@dataclass(frozen=True, eq=False)
class FramePicture:
    """A frame in gray.

    Attributes:
        pixels: (H, W) uint8 or uint16.
        mode: what the file holds, such as `gray, 16 bits`.
    """

    pixels: GrayImage
    mode: str


def read_pictures(pages: Sequence[ImagePage]) -> Iterator[FramePicture]:
    """Read frames one at a time; a file is opened once for pages that follow one another.

    Colours become gray as Pillow weights them. Other images than those with 8 or 16 bits are converted if every
    value stays as it is.

    Raises:
        ImportFileError: a file cannot be read, would lose something, or Pillow is not installed.
    """
    position = 0
    while position < len(pages):
        path = pages[position].path
        with open_image(path) as image:
            while position < len(pages) and pages[position].path == path:
                with frame_damage_told(path):
                    image.seek(pages[position].number or 0)
                    picture = _gray(path, image)
                yield picture
                position += 1


class _Opened:
    """An opened image file; closes it."""

    def __init__(self, image: 'Image') -> None:
        self._image = image

    def __enter__(self) -> 'Image':
        return self._image

    def __exit__(self, *_: object) -> None:
        self._image.close()


def open_image(path: Path) -> _Opened:
    """Open an image file with Pillow; a context manager.

    Raises:
        ImportFileError: the file cannot be read, or Pillow is not installed.
    """
    try:
        from PIL import Image  # noqa: PLC0415 - an extra
    except ImportError:
        raise ImportFileError(f'Images need Pillow: {install_command("pictures")}.') from None
    try:
        with frame_damage_told(path):
            return _Opened(Image.open(path))
    except Image.DecompressionBombError:
        raise ImportFileError(f'{path} has too many pixels to be a frame: give smaller images.') from None


def page_count(path: Path) -> int:
    """The number of pages of an image file.

    Raises:
        ImportFileError: the file cannot be read, or Pillow is not installed.
    """
    with open_image(path) as image, frame_damage_told(path):
        return int(getattr(image, 'n_frames', 1))


def frame_damage_told(path: Path) -> AbstractContextManager[None]:
    """Turn whatever Pillow says of a damaged picture into one sentence.

    Raises:
        ImportFileError: as by `picture_damage_told`.
    """
    return picture_damage_told(path, 'is damaged, or no image: save it again as PNG or TIFF.')


def _gray(path: Path, image: 'Image') -> FramePicture:
    """The pixels of the current page.

    Raises:
        ImportFileError: they cannot become gray values of 8 or 16 bits without loss.
    """
    bits = _bits_per_sample(image)
    if image.mode in _WITH_ALPHA or 'transparency' in image.info:
        alpha = np.asarray(image.convert('RGBA'))[..., 3]
        if (alpha != np.iinfo(np.uint8).max).any():
            raise ImportFileError(
                f'{path} has transparent pixels, which have no gray value: save it without alpha.'
            )
        image = image.convert(_WITH_ALPHA.get(image.mode, image.mode))
    mode = image.mode
    if mode.startswith('I;16'):
        return FramePicture(np.asarray(image).astype(np.uint16), f'gray, {max(bits, 16)} bits')
    if mode in ('I', 'F'):
        return FramePicture(_whole(path, np.asarray(image), bits), f'gray, {bits} bits{" float" * (mode == "F")}')
    if bits > 8:
        raise ImportFileError(
            f'{path} has {bits} bits for each colour, of which 8 would be kept: save it as gray with 16 bits.'
        )
    if mode in ('L', '1'):
        return FramePicture(np.asarray(image.convert('L')), f'gray, {1 if mode == "1" else 8} bits')
    if mode in ('P', 'RGB'):
        return FramePicture(np.asarray(image.convert('RGB').convert('L')), 'RGB' if mode == 'RGB' else 'palette')
    raise ImportFileError(f'{path} has pixels of the kind {mode}, which is not read: save it as gray or RGB.')


def _whole(path: Path, values: npt.NDArray[np.generic], bits: int) -> npt.NDArray[np.uint16]:
    """Values of 32 bits, if all are whole numbers of 16 bits."""
    with np.errstate(invalid='ignore'):
        whole = values.astype(np.uint16)
    if np.array_equal(whole, values):
        return whole
    kind = 'real' if values.dtype.kind == 'f' else 'whole'
    raise ImportFileError(
        f'{path} has {kind} numbers of {bits} bits, {values.min():g} to {values.max():g}, which gray values of 16'
        ' bits do not hold: scale all frames alike and save them with 16 bits.'
    )


def _bits_per_sample(image: 'Image') -> int:
    """The bits of a value in the file; Pillow reduces 16-bit colours to 8 bits without a word."""
    tags = getattr(image, 'tag_v2', None)
    if tags is not None:
        return int(max(tags.get(_BITS_PER_SAMPLE, (1,))))
    tiles = getattr(image, 'tile', None)
    raw = str(tiles[0][3]) if tiles else ''
    if image.mode in ('F', 'I'):
        return 16 if ';16' in raw else 32
    return 16 if ';16' in raw else 8
