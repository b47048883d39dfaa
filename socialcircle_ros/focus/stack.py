# SPDX-License-Identifier: Apache-2.0
"""Depth from a focus stack (section 3.1), one frame at a time or all frames at once."""

import math
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
from .measure import REFERENCE, Frame, MeasureParameters, checked_frame, scale_of
from .noise import NoiseSampler
from .order import RECENT, FrameOrder
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

    flicker: float
    """Standard deviation of the mean light of the frames, as a share; it is divided out with `focus.normalize`."""


_MOST_FLICKER = 4.0
"""Greatest ratio between the mean light of a frame and of the first one that is divided out."""


class FocusStack:
    """Takes the frames of a focus stack one at a time, in constant memory, and measures the depth.

    A pixel takes 58 bytes, and 1 or 2 bytes of the all-in-focus image, however many frames there are. Frames may
    come in any order. Of two frames at the same z each pixel keeps the larger F, so that a frame that comes twice
    changes nothing.

    The fit uses the sharpest frame of each pixel and seven frames on either side of it. While the stage moves in
    one direction, upward or downward, these frames are always kept, and the result is that of `depth_from_focus`,
    bit for bit. In another order a frame that comes late may be missing next to the sharpest frame of a pixel.
    That pixel then has `Reason.INCOMPLETE` and a quality of 0.5 at most.

    Example:
        >>> stack = FocusStack()
        >>> for frame, z in instrument:
        ...     stack.add(frame, z)
        >>> stack.finish().depth
    """

    def __init__(self, settings: FocusSettings | None = None) -> None:
        self._settings = settings or FocusSettings()
        self._parameters = MeasureParameters.of(self._settings)
        self._order = FrameOrder()
        self._curves: Curves | None = None
        self._noise: NoiseSampler | None = None
        self._lights: list[float] = []  # mean light of each frame
        self._divisors: list[float] = []  # what each frame is divided by with `focus.normalize`
        self._scale = 1.0  # factor on F of the last frame

    @property
    def places(self) -> int:
        """The number of different z so far."""
        return len(self._order.z)

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
        curves, order = self._curves, self._order
        if curves is None or (not order.z and _kind(frame) != _kind(curves.image)):
            curves = Curves.like(frame)
        if _kind(frame) != _kind(curves.image):
            raise StackError(
                f'A frame of {frame.shape} {frame.dtype} cannot join a stack of {curves.image.shape}'
                f' {curves.image.dtype}: start a new stack.'
            )
        if len(order.z) == _MOST_PLACES and not order.knows(z):
            raise StackError(f'A stack holds at most {_MOST_PLACES} frames: finish it and start another.')
        if self._noise is None or not order.z:
            curves.begin(frame)
            self._noise, self._lights, self._divisors = NoiseSampler(frame, self._parameters), [], []
        if len(order.z) < RECENT:
            curves.clear_slots(len(order.z))
        rows, recent, places = list(order.rows), order.recent, order.places
        arrival = order.add(float(z))
        if arrival.turns:
            curves.release_all(rows, recent, places)
        to_reference = scale_of(frame)
        light = REFERENCE[frame.dtype] / to_reference
        divisor = self._divisor(light)
        if divisor != light:
            to_reference = REFERENCE[frame.dtype] / divisor
        self._scale = scale = to_reference if self._settings.normalize else 1.0
        if not arrival.is_known:  # the same frame again would show no noise
            self._noise.add(frame, scale)
            self._lights.append(light)
            self._divisors.append(divisor)
        curves.add(frame, arrival, scale, self._parameters)
        self._curves = curves

    def _divisor(self, light: float) -> float:
        """What a frame is divided by: its mean light, but no more than `_MOST_FLICKER` from the first frame's.

        No lamp and no exposure changes by more. Light that does follows the focus of the part itself, and is not
        divided out: the peak would go with it.
        """
        if not self._lights:
            return light
        first = self._lights[0]
        return min(max(light, first / _MOST_FLICKER), first * _MOST_FLICKER)

    def reset(self) -> None:
        """Forget all frames. The memory is kept, so that the next stack need not allocate it."""
        self._order = FrameOrder()

    def finish(self, z: NDArray[np.float64] | None = None) -> FocusResult:
        """Measure the depth from the frames so far. More frames may follow.

        Args:
            z: (n,) of the different z that were given, in ascending order, where they are known better by now;
                None: as they were given.

        Raises:
            StackError: there are frames at fewer than three different z, or `z` does not ascend or does not fit
                their number.
        """
        order = self._order
        if self._curves is None or self._noise is None or len(order.z) < 3:
            raise StackError(f'A peak needs frames at three different z at least; the stack has {len(order.z)}.')
        for part in range(len(order.z), RECENT):
            self._curves.clear_slots(part)
        settings, z = self._settings, np.array(order.z) if z is None else z
        if len(z) != len(order.z) or not np.all(np.diff(z) > 0):
            raise StackError(f'The z of a stack must ascend, one for each of its {len(order.z)} different z.')
        three_point = settings.fit == 'gauss3'
        image = self._curves.image.copy()
        light = float(np.mean(self._divisors))
        floor = self._noise.floor(image, REFERENCE[image.dtype] / light if settings.normalize else 1.0)
        depth, quality, reasons, widths = fit_peaks(self._curves, order, z, floor, three_point=three_point)
        if not three_point:
            depth = correct_for_centroid(depth, quality, image, z, self._parameters)
        level = settings.saturation or np.iinfo(image.dtype).max
        _mark_saturated(image, level, settings.half_window, reasons, quality)
        width = widths.median(quality)
        flicker = float(np.std(self._lights) / np.mean(self._lights))
        return FocusResult(depth, quality, image, reasons, width and width / _WIDTH, flicker)


def _kind(frame: Frame) -> tuple[tuple[int, ...], np.dtype[np.uint8] | np.dtype[np.uint16]]:
    return frame.shape, frame.dtype


def depth_from_focus(
    frames: Iterable[Frame],
    z: Sequence[float] | NDArray[np.floating] | NDArray[np.integer],
    settings: FocusSettings | None = None,
) -> FocusResult:
    """Measure the depth of each pixel from a whole focus stack.

    The result does not depend on the order of the frames, and is that of a `FocusStack` that takes them while the
    stage moves in one direction, bit for bit.

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
    positions = [float(position) for position in z]
    stack = FocusStack(settings)
    # A z that is not finite has no order; the stack refuses it.
    for index in sorted(range(len(positions)), key=lambda k: (math.isfinite(positions[k]), positions[k])):
        stack.add(frames[index], positions[index])
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
