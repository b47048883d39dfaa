"""A focus stack, frame by frame or all at once."""

import math
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.errors import StackError
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.settings import FocusSettings

from .centroid import centred
from .curve import REACH, Curves
from .fit import SATURATED, fit_peaks
from .measure import Frame, checked_frame

_MOST_PLACES = 32_767 - REACH
"""Places are kept in 16 bits, with REACH to spare for those beside the last."""

_WIDTH = 0.73
"""Standard deviation of the focus curve in depths of field, where the texture is as fine as the pixels: 0.71 to
0.75 on simulated stacks at 5x and 10x. At 20x it is 0.5, at 50x 0.35: there the depth of field comes out shorter
than it is."""

_SATURATED_SHARE = 8
"""One saturated pixel in so many of the window, and the curve can no longer be trusted."""


@dataclass(frozen=True)
class FocusResult:
    """What a focus stack shows."""

    depth: NDArray[np.float64]
    """(H, W): z of the peak, in z's unit; NaN where there is no peak or it is at the end of the scan."""

    quality: NDArray[np.float32]
    """(H, W): 0 to 1, how far the depth is to be trusted; 0 where it is NaN."""

    image: Frame
    """(H, W): all in focus, every pixel from its sharpest frame; the frames' dtype."""

    reasons: NDArray[np.uint8]
    """(H, W): what speaks against a pixel, bits of `Reason`; 0 where nothing does."""

    depth_of_field: float | None
    """Of the optics, as the width of the focus curves tells it, in z's unit; None where no curve is trusted."""


class FocusStack:
    """Takes the frames of a focus stack one at a time, in constant memory, and measures the depth.

    Each pixel costs 46 bytes and its pixel of the all-in-focus image, however many frames there are. Frames
    come in any order. Of two frames at the same z each pixel keeps the larger F, so that a frame that comes
    twice changes nothing.

    Of each pixel the sharpest frame and seven on either side of it are used. Where the curve rises to one
    peak they are always there, and the result is the same bit for bit in any order. Where it does not, a
    frame is missing if it was outside the window round what was then the sharpest; the fit then has fewer
    frames, never wrong ones.

    Example:
        >>> stack = FocusStack()
        >>> for frame, z in instrument:
        ...     stack.add(frame, z)
        >>> stack.finish().depth
    """

    def __init__(self, settings: FocusSettings | None = None) -> None:
        self._settings = settings or FocusSettings()
        self._z: list[float] = []  # ascending; z of the places from self._first on
        self._first = 0
        self._curves: Curves | None = None

    @property
    def _places(self) -> range:
        return range(self._first, self._first + len(self._z))

    @property
    def places(self) -> int:
        """How many different z have been taken in."""
        return len(self._z)

    def add(self, frame: Frame, z: float) -> None:
        """Take in a frame.

        Args:
            frame: (H, W) uint8 or uint16, like the first; any strides; not kept.
            z: where the stage was, in any unit.

        Raises:
            StackError: the frame or its z cannot be used; the stack is as it was before.
        """
        frame = checked_frame(frame)
        if not math.isfinite(z):
            raise StackError(f'A frame needs a finite z, not {z}.')
        curves = self._curves
        if curves is None or (not self._z and _kind(frame) != _kind(curves.image)):
            curves = Curves.like(frame)
        if _kind(frame) != _kind(curves.image):
            raise StackError(
                f'A frame of {frame.shape} {frame.dtype} cannot join a stack of {curves.image.shape}'
                f' {curves.image.dtype}: start a new stack.'
            )
        index = bisect_left(self._z, z)
        known = index < len(self._z) and self._z[index] == z
        if not known and len(self._z) == _MOST_PLACES:
            raise StackError(f'A stack holds at most {_MOST_PLACES} frames: finish it and start another.')
        if not known:
            if not self._z:
                curves.begin(frame)
            elif index == 0:
                self._first -= 1
            elif index < len(self._z):
                curves.make_room(self._first + index, self._places)
            self._z.insert(index, float(z))
        settings = self._settings
        curves.add(
            frame,
            self._places[index],
            self._places,
            settings.step,
            settings.half_window,
            settings.threshold,
            known=known,
        )
        self._curves = curves

    def reset(self) -> None:
        """Forget all frames and keep the memory, so that the next stack does not wait for it."""
        self._z = []
        self._first = 0

    def finish(self) -> FocusResult:
        """Measure from the frames so far; more may follow.

        Raises:
            StackError: there are fewer than three different z.
        """
        if self._curves is None or len(self._z) < 3:
            raise StackError(f'A peak needs frames at three different z at least, not {len(self._z)}.')
        settings, z = self._settings, np.array(self._z)
        three = settings.fit == 'gauss3'
        depth, quality, reasons, widths = fit_peaks(self._curves, z, self._first, three=three)
        image = self._curves.image.copy()
        if not three:
            depth = centred(depth, quality, image, z, settings.step, settings.half_window, settings.threshold)
        level = settings.saturation or np.iinfo(image.dtype).max
        _mark_saturated(image, level, settings.half_window, reasons, quality)
        width = widths.median(quality)
        return FocusResult(depth, quality, image, reasons, width and width / _WIDTH)


def _kind(frame: Frame) -> tuple[tuple[int, ...], np.dtype[Any]]:
    return frame.shape, frame.dtype


def depth_from_focus(
    frames: Iterable[Frame], z: Sequence[float] | NDArray[Any], settings: FocusSettings | None = None
) -> FocusResult:
    """Depth of each pixel from a whole focus stack, the same bit for bit as `FocusStack` in the same order.

    Args:
        frames: (N, H, W), uint8 or uint16.
        z: (N,) where the stage was at each frame, in any order and unit.
        settings: how the focus is measured and its peak found.

    Raises:
        StackError: the frames or z cannot be used, or are not as many, or fewer than three.
    """
    frames = list(frames)
    if len(frames) != len(z):
        raise StackError(f'Each frame needs its z, but there are {len(frames)} frames and {len(z)} z.')
    stack = FocusStack(settings)
    for frame, position in zip(frames, z, strict=True):
        stack.add(frame, float(position))
    return stack.finish()


@kernel
def _mark_saturated(
    image: Frame, level: int, half: int, reasons: NDArray[np.uint8], quality: NDArray[np.float32]
) -> None:
    """Mark the pixels in whose window too many pixels of the all-in-focus image are saturated."""
    height, width = image.shape
    side = 2 * half + 1
    least = np.int32(level)
    columns = np.zeros(width, np.int32)
    for row in range(-half, height):
        if row + half < height:
            entering = image[row + half]
            for x in range(width):
                columns[x] += np.int32(np.int32(entering[x]) >= least)
        if row - half - 1 >= 0:
            leaving = image[row - half - 1]
            for x in range(width):
                columns[x] -= np.int32(np.int32(leaving[x]) >= least)
        if row < 0:
            continue
        most = np.int32(0)
        for x in range(width):
            most = max(most, columns[x])
        if most == 0:
            continue
        count = 0
        for x in range(-half, width):
            if x + half < width:
                count += columns[x + half]
            if x - half - 1 >= 0:
                count -= columns[x - half - 1]
            if x >= 0 and count * _SATURATED_SHARE > side * side:
                reasons[row, x] |= SATURATED
                quality[row, x] = 0
