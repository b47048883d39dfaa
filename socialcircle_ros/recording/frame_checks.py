# SPDX-License-Identifier: Apache-2.0
"""Which frames do not belong to a stack: another size or mode, a mask, or a picture in focus everywhere."""

import numpy as np
import numpy.typing as npt

from socialcircle_ros.digits import size_text
from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.messages.gray import GrayImage

from .pictures import FramePicture

_TILES = 8  # along each side
_TILE = 32  # pixels of a tile that are looked at, along each side
_TEXTURED = 2.0  # how far the sharpness of a tile rises above its lowest
_AS_SHARP = 0.75  # of the sharpest other frame
_LESS_SHARP = 0.6
_FEW, _MANY = 2, 16  # gray values of a mask, and of a frame


class FrameChecks:
    """Takes the frames of a stack in the order of z, and refuses what does not belong."""

    def __init__(self) -> None:
        self._names: list[str] = []
        self._first: FramePicture | None = None
        self._sharpness: list[npt.NDArray[np.float64]] = []
        self._values: list[int] = []

    def take(self, name: str, picture: FramePicture) -> None:
        """Take the next frame.

        Raises:
            ImportFileError: its size or mode differs from those of the first.
        """
        first = self._first = self._first or picture
        if picture.pixels.shape != first.pixels.shape or picture.mode != first.mode:
            raise ImportFileError(
                f'{name} is {described(picture)}, but {self._names[0]} is {described(first)}: the'
                ' frames of a stack are alike; move away what does not belong.'
            )
        self._names.append(name)
        self._sharpness.append(_sharpness(picture.pixels))
        self._values.append(_few_values(picture.pixels))

    def finish(self) -> None:
        """Look at all frames together.

        Raises:
            ImportFileError: one is a mask, or is in focus everywhere.
        """
        for name, values in zip(self._names, self._values, strict=True):
            if values == _FEW and np.median(self._values) > _FEW:
                raise ImportFileError(
                    f'{name} has only {values} gray values, as a mask has, and the other frames have more: move it'
                    ' away.'
                )
        found = in_focus_everywhere(np.array(self._sharpness))
        if found is not None:
            raise ImportFileError(
                f'{self._names[found]} is in focus everywhere and the other frames are not: it is no frame of the'
                ' stack; move it away.'
            )


def described(picture: FramePicture) -> str:
    """Rows and columns, and mode."""
    rows, columns = picture.pixels.shape
    return f'{size_text(rows, columns)} {picture.mode}'


def in_focus_everywhere(sharpness: npt.NDArray[np.float64]) -> int | None:
    """The frame that is as sharp as the sharpest other frame nearly everywhere, though its neighbours are not.

    In a stack of a flat part one frame is the sharpest everywhere as well; but there the next sharpest are its
    neighbours.

    Args:
        sharpness: (frames, tiles).
    """
    frames = len(sharpness)
    if frames < 4:
        return None
    lowest = sharpness.min(axis=0)
    textured = sharpness.max(axis=0) > _TEXTURED * lowest + 1e-12
    if not textured.any():
        return None
    rise = (sharpness - lowest)[:, textured]
    for frame in range(frames):
        others = np.delete(np.arange(frames), frame)
        sharpest = others[rise[others].argmax(axis=0)]
        as_sharp = rise[frame] >= _AS_SHARP * rise[others].max(axis=0)
        beside = rise[[place for place in (frame - 1, frame + 1) if 0 <= place < frames]].max(axis=0)
        alone = (np.abs(sharpest - frame) > 2) & (beside < _LESS_SHARP * rise[frame])
        if as_sharp.mean() > 0.95 and alone.mean() > 0.5:
            return frame
    return None


def _sharpness(pixels: GrayImage) -> npt.NDArray[np.float64]:
    """The contrast of neighbouring pixels in tiles that are spread over a frame, relative to its brightness."""
    tiles = [
        pixels[row : row + _TILE, column : column + _TILE].astype(np.float64)
        for row in _starts(pixels.shape[0])
        for column in _starts(pixels.shape[1])
    ]
    brightness = float(np.mean([tile.mean() for tile in tiles])) or 1.0
    contrast: npt.NDArray[np.float64] = np.array([_contrast(tile) for tile in tiles])
    return contrast / brightness**2


def _contrast(tile: npt.NDArray[np.float64]) -> float:
    return float(np.square(np.diff(tile, axis=0)).sum() + np.square(np.diff(tile, axis=1)).sum()) / tile.size


def _starts(length: int) -> npt.NDArray[np.int64]:
    """Where tiles begin."""
    count = min(_TILES, max(1, length // 8))
    return np.linspace(0, max(0, length - min(_TILE, length // count)), count).astype(np.int64)


def _few_values(pixels: GrayImage) -> int:
    """How many gray values there are: 1, 2, or more."""
    low, high = pixels.min(), pixels.max()
    if low == high:
        return 1
    return _FEW if ((pixels == low) | (pixels == high)).all() else _MANY
