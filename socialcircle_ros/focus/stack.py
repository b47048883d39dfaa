"""Depth from a focus stack (section 3.1), one frame at a time or all frames at once."""

import math
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.errors import StackError
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.settings import FocusSettings

from .centroid import correct_for_centroid
from .curve import Curves
from .curve_rows import REACH
from .fit import fit_peaks
from .measure import Frame, MeasureParameters, checked_frame
from .reasons import SATURATED

_MOST_PLACES = 32_767 - REACH
"""Places are kept in 16 bits, and there must be REACH places beyond the last frame."""

_WIDTH = 0.73
"""Standard deviation of the focus curve, in depths of field, where the texture is as fine as the pixels.

Measured on simulated stacks: 0.71 to 0.75 at 5x and 10x, 0.5 at 20x, 0.35 at 50x. At 20x and 50x the estimate of
the depth of field is therefore too short.
"""

_SATURATED_SHARE = 8
"""A curve is not trusted if more than one pixel in this many of the window is saturated."""


@dataclass(frozen=True)
class FocusResult:
    """What is measured from a focus stack."""

    depth: NDArray[np.float64]
    """(H, W): z of the peak, in the unit of z; NaN where there is no peak or it is at the end of the scan."""

    quality: NDArray[np.float32]
    """(H, W): 0 to 1, the probability that the depth is good, see `fit`; 0 where the depth is NaN."""

    image: Frame
    """(H, W): the all-in-focus image, every pixel from its sharpest frame; the data type of the frames."""

    reasons: NDArray[np.uint8]
    """(H, W): why the depth is not to be trusted, bits of `Reason`; 0 where there is no reason."""

    depth_of_field: float | None
    """Estimate from the width of the focus curves, in the unit of z; None where no curve is trusted."""


class FocusStack:
    """Takes the frames of a focus stack one at a time, in constant memory, and measures the depth.

    A pixel takes 46 bytes, and 1 or 2 bytes of the all-in-focus image, however many frames there are. Frames may
    come in any order. Of two frames at the same z each pixel keeps the larger F, so that a frame that comes twice
    changes nothing.

    The fit uses the sharpest frame of each pixel and seven frames on either side of it. Where the curve rises to
    a single peak these frames are always kept, and the result does not depend on the order of the frames, bit for
    bit. Elsewhere a frame is missing if it was too far from the frame that was the sharpest when it came. The fit
    then has fewer frames, but never wrong ones.

    Example:
        >>> stack = FocusStack()
        >>> for frame, z in instrument:
        ...     stack.add(frame, z)
        >>> stack.finish().depth
    """

    def __init__(self, settings: FocusSettings | None = None) -> None:
        self._settings = settings or FocusSettings()
        self._parameters = MeasureParameters.of(self._settings)
        self._z: list[float] = []  # ascending: z of the places from self._first on
        self._first = 0
        self._curves: Curves | None = None

    @property
    def _places(self) -> range:
        return range(self._first, self._first + len(self._z))

    @property
    def places(self) -> int:
        """The number of different z so far."""
        return len(self._z)

    def add(self, frame: Frame, z: float) -> None:
        """Add a frame.

        Args:
            frame: (H, W) uint8 or uint16, like the first one; any strides; it is not kept.
            z: position of the stage, in any unit.

        Raises:
            StackError: the frame or its z cannot be used; the stack is unchanged.
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
        is_known = index < len(self._z) and self._z[index] == z
        if not is_known and len(self._z) == _MOST_PLACES:
            raise StackError(f'A stack holds at most {_MOST_PLACES} frames: finish it and start another.')
        if not is_known:
            if not self._z:
                curves.begin(frame)
            elif index == 0:
                self._first -= 1
            elif index < len(self._z):
                curves.make_room(self._first + index, self._places)
            self._z.insert(index, float(z))
        curves.add(frame, self._places[index], self._places, self._parameters, is_known=is_known)
        self._curves = curves

    def reset(self) -> None:
        """Forget all frames. The memory is kept, so that the next stack need not allocate it."""
        self._z = []
        self._first = 0

    def finish(self) -> FocusResult:
        """Measure the depth from the frames so far. More frames may follow.

        Raises:
            StackError: there are frames at fewer than three different z.
        """
        if self._curves is None or len(self._z) < 3:
            raise StackError(f'A peak needs frames at three different z at least; the stack has {len(self._z)}.')
        settings, z = self._settings, np.array(self._z)
        three_point = settings.fit == 'gauss3'
        depth, quality, reasons, widths = fit_peaks(self._curves, z, self._first, three_point=three_point)
        image = self._curves.image.copy()
        if not three_point:
            depth = correct_for_centroid(depth, quality, image, z, self._parameters)
        level = settings.saturation or np.iinfo(image.dtype).max
        _mark_saturated(image, level, settings.half_window, reasons, quality)
        width = widths.median(quality)
        return FocusResult(depth, quality, image, reasons, width and width / _WIDTH)


def _kind(frame: Frame) -> tuple[tuple[int, ...], np.dtype[np.uint8] | np.dtype[np.uint16]]:
    return frame.shape, frame.dtype


def depth_from_focus(
    frames: Iterable[Frame],
    z: Sequence[float] | NDArray[np.floating] | NDArray[np.integer],
    settings: FocusSettings | None = None,
) -> FocusResult:
    """Measure the depth of each pixel from a whole focus stack.

    The result is that of a `FocusStack` to which the frames are added in the same order, bit for bit.

    Args:
        frames: (N, H, W), uint8 or uint16.
        z: (N,), position of the stage at each frame, in any order and unit.
        settings: of the focus measure and the fit; None: the defaults.

    Raises:
        StackError: a frame or a z cannot be used, their numbers differ, or fewer than three z are different.
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
    """Mark the pixels with too many saturated pixels in their window, and set their quality to 0.

    Args:
        image: (H, W), every pixel from its sharpest frame.
        level: gray level from which a pixel is saturated.
        half: half-window N.
        reasons: (H, W), updated.
        quality: (H, W), updated.
    """
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
        # Most rows have no saturated pixel near: this test vectorises, the loop below does not.
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
