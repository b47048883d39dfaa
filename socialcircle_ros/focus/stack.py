# SPDX-License-Identifier: Apache-2.0
"""Depth from a focus stack (section 3.1), one frame at a time or all frames at once."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import SupportsFloat, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.arguments import settings_or_default
from socialcircle_ros.errors import StackError, shown
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.settings import FocusSettings

from .curve_rows import REACH
from .drift import DriftMeter
from .measure import REFERENCE, Frame, checked_frame, scale_of
from .order import RECENT, FrameOrder
from .reasons import OUT_OF_PICTURE, SATURATED
from .registration import Registered, Registration
from .scales import Scale, ScaleResult, choose, scales_for

_Item = TypeVar('_Item')

_MOST_PLACES = 32_767 - REACH
"""Places are kept in 16 bits, and there must be REACH places beyond the last frame."""

_LARGEST_SPAN = 1e15
"""Of the z of a stack, in their unit and in typical steps: float32 holds them, and the widths of the curves."""

_WIDTH = 0.73
"""Standard deviation of the focus curve, in depths of field, where the texture is as fine as the pixels.

Measured on simulated stacks: 0.71 to 0.75 at 5x and 10x, 0.5 at 20x, 0.35 at 50x. At 20x and 50x the estimate of
the depth of field is therefore too short.
"""

_SATURATED_SHARE = 8
"""A curve is not trusted if more than one pixel in this many of the window is saturated."""


@dataclass(frozen=True, eq=False)
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

    step: int
    """Step of the modified Laplacian, pixels: `focus.step`, or what was chosen from the frames."""

    drift: float | None
    """How far the frames moved sideways, pixels; None where their texture does not tell, see `DriftMeter`."""

    colours: NDArray[np.uint8] | None = None
    """(H, W, 3): the all-in-focus image in colour; None where the frames came without colours."""

    registered: Registered | None = None
    """What was corrected of drift and magnification; None where nothing was asked for."""

    wide_steps: bool = False
    """Whether the frames are too few, or too far apart, for the focus curves: the quality is low, see `steps`."""


_MOST_FLICKER = 4.0
"""Greatest ratio between the mean light of a frame and of the first one that is divided out."""


class FocusStack:
    """Takes the frames of a focus stack one at a time, in constant memory, and measures the depth.

    A pixel takes 58 bytes, and 1 or 2 bytes of the all-in-focus image, however many frames there are; a sixteenth
    more where the step is chosen from the frames. Frames may come in any order. Of two frames at the same z each
    pixel keeps the larger F, so that a frame that comes twice changes nothing.

    The fit uses the sharpest frame of each pixel and seven frames on either side of it. While the stage moves in
    one direction, upward or downward, these frames are always kept, and the result is that of `depth_from_focus`,
    bit for bit, unless the light changes so much that it counts which frame is the first, see `_divisor`. In
    another order a frame that comes late may be missing next to the sharpest frame of a pixel. That pixel then has
    `Reason.INCOMPLETE` and a quality of 0.5 at most.

    Args:
        settings: of the focus measure and the fit; None: the defaults.
        register: whether each frame is moved and scaled to where the first frame shows the part, see
            `registration`. The frames must then come in order of z, upward or downward. A pixel that leaves the
            picture in some frame has no depth, and `Reason.OUT_OF_PICTURE`. The stack takes 1 or 2 bytes more for
            each pixel.

    Attributes:
        register: as above; a change holds from the next stack on.

    Example:
        >>> stack = FocusStack()
        >>> for frame, z in instrument:
        ...     stack.add(frame, z)
        >>> stack.finish().depth
    """

    def __init__(self, settings: FocusSettings | None = None, *, register: bool = False) -> None:
        self._settings = settings_or_default(FocusSettings, settings)
        self.register = register
        self._registration: Registration | None = None
        self._order = FrameOrder()
        self._scales: tuple[Scale, ...] = ()
        self._lights: list[float] = []  # mean light of each frame
        self._divisors: list[float] = []  # what each frame is divided by with `focus.normalize`
        self._drift = DriftMeter()
        self._factor = 1.0  # on F of the last frame, for its light
        self._picture: NDArray[np.uint8] | None = None  # the all-in-focus image in colour

    @property
    def places(self) -> int:
        """The number of different z so far."""
        return len(self._order.z)

    def add(self, frame: Frame, z: float, colours: NDArray[np.uint8] | None = None) -> None:
        """Add a frame.

        Args:
            frame: (H, W) uint8 or uint16, like the first one; any strides; it is not kept.
            z: position of the stage, in any unit.
            colours: (H, W, 3), the same frame in colour, for the all-in-focus image; all frames have it, or none.

        Raises:
            StackError: the frame or its z cannot be used; the stack is unchanged.
        """
        frame = checked_frame(frame)
        z = _position(z)
        scales, order = self._scales, self._order
        if not scales or (not order.z and _kind(frame) != _kind(scales[0].image)):
            scales = scales_for(frame, self._settings)
        image = scales[0].image
        if _kind(frame) != _kind(image):
            raise StackError(
                f'A frame of {frame.shape} {frame.dtype} cannot join a stack of {image.shape}'
                f' {image.dtype}: start a new stack.'
            )
        if np.ma.is_masked(colours):
            raise StackError('The colours of a frame cannot be masked: give all of them as they were taken.')
        colours = None if colours is None else np.asarray(colours)
        if colours is not None and (colours.shape != (*frame.shape, 3) or colours.dtype != np.uint8):
            raise StackError(
                f'The colours of a frame of {frame.shape} must be {(*frame.shape, 3)} uint8, not {colours.shape}'
                f' {colours.dtype}.'
            )
        if order.z and (colours is None) != (self._picture is None):
            raise StackError('All frames of a stack must have colours, or none.')
        if len(order.z) == _MOST_PLACES and not order.knows(z):
            raise StackError(f'A stack holds at most {_MOST_PLACES} frames: finish it and start another.')
        if not order.z:
            self._scales, self._lights, self._divisors = scales, [], []
            self._drift = DriftMeter()
            self._registration = Registration(frame.shape) if self.register else None
            self._picture = None if colours is None else np.zeros_like(colours, order='C')
            for scale in scales:
                scale.begin(frame)
        self._drift.add(frame)
        if self._registration is not None:
            frame, colours = self._registration.add(frame, colours)
        self._measure(frame, z, colours)

    def _measure(self, frame: Frame, z: float, colours: NDArray[np.uint8] | None) -> None:
        """Measure a frame, (H, W), that may be registered; with its colours, (H, W, 3)."""
        scales, order, image = self._scales, self._order, self._scales[0].image
        place, rows, recent, places = len(order.z), list(order.rows), order.recent, order.places
        arrival = order.add(z)
        self._factor = self._factor_for(frame, is_known=arrival.is_known)
        for scale in scales:
            if place < RECENT:
                scale.curves.clear_slots(place)
            if arrival.turns:
                scale.curves.release_all(rows, recent, places)
            scale.add(frame, arrival, self._factor)
        if colours is not None and self._picture is not None:
            colours = np.require(colours, requirements=['C', 'W'])
            _take_colours(scales[0].curves.arrays.centre, arrival.place, image, frame, colours, self._picture)

    def _factor_for(self, frame: Frame, *, is_known: bool) -> float:
        """The factor of F for the light of a frame, which is noted unless there is a frame at its z already."""
        to_reference = scale_of(frame)
        light = REFERENCE[frame.dtype] / to_reference
        divisor = self._divisor(light)
        if divisor != light:
            to_reference = REFERENCE[frame.dtype] / divisor
        if not is_known:
            self._lights.append(light)
            self._divisors.append(divisor)
        return to_reference if self._settings.normalize else 1.0

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
            StackError: there are frames at fewer than three different z, or `z` are no finite numbers, do not
                ascend, do not fit their number, or reach too far.
        """
        order = self._order
        if len(order.z) < 3:
            raise StackError(f'A peak needs frames at three different z at least; the stack has {len(order.z)}.')
        settings = self._settings
        positions = np.array(order.z if z is None else [_position(each) for each in _listed(z, 'z')])
        with np.errstate(over='ignore'):
            gaps = np.diff(positions)
        if len(positions) != len(order.z) or not np.all(gaps > 0):
            raise StackError(f'The z of a stack must ascend, one for each of its {len(order.z)} different z.')
        first, last = float(positions[0]), float(positions[-1])
        if last - first > _LARGEST_SPAN or last - first > _LARGEST_SPAN * float(np.median(gaps)):
            raise StackError(f'The z of a stack reach from {first:g} to {last:g}, too far: check their unit.')
        image = self._scales[0].image.copy()
        light = float(np.mean(self._divisors))
        factor = REFERENCE[image.dtype] / light if settings.normalize else 1.0

        def measure(scale: Scale) -> ScaleResult:
            return scale.measure(order, positions, factor, three_point=settings.fit == 'gauss3')

        found = choose(self._scales, positions, measure)
        depth, quality, reasons = found.maps
        level = settings.saturation or np.iinfo(image.dtype).max
        _mark_saturated(image, level, found.half_window, reasons, quality)
        registered = None
        if self._registration is not None:
            registered = self._registration.result
            outside = self._registration.outside(found.step + found.half_window)
            depth[outside], quality[outside] = np.nan, 0
            reasons[outside] |= OUT_OF_PICTURE
        flicker = float(np.std(self._lights) / np.mean(self._lights))
        width = found.width
        depth_of_field = width and width / _WIDTH
        picture = None if self._picture is None else self._picture.copy()
        return FocusResult(
            depth=depth,
            quality=quality,
            image=image,
            reasons=reasons,
            depth_of_field=depth_of_field,
            flicker=flicker,
            step=found.step,
            drift=self._drift.drift,
            colours=picture,
            registered=registered,
            wide_steps=found.wide_steps,
        )


def _kind(frame: Frame) -> tuple[tuple[int, ...], np.dtype[np.uint8] | np.dtype[np.uint16]]:
    return frame.shape, frame.dtype


def _position(z: object) -> float:
    """The z of one frame, as it was given, as a number.

    Raises:
        StackError: it is not one number, or not finite.
    """
    try:
        if z is np.ma.masked or np.ndim(cast('float', z)) > 0:
            raise TypeError  # noqa: TRY301 - NumPy would take the only item of an array for a number, and warn
        is_finite = math.isfinite(cast('SupportsFloat', z))
    except (TypeError, ValueError, OverflowError):
        raise StackError(f'A frame needs one number for its z, not {shown(z)}.') from None
    if not is_finite:
        raise StackError(f'A frame needs a finite z, not {z}.')
    return float(cast('SupportsFloat', z))


def _listed(values: Iterable[_Item], name: str) -> list[_Item]:
    """The items of a sequence or of a generator.

    Raises:
        StackError: it is neither.
    """
    try:
        items = iter(values)
    except TypeError:
        raise StackError(f'{name} must have one item for each frame, but is {shown(values)}.') from None
    return list(items)


def depth_from_focus(
    frames: Iterable[Frame],
    z: Iterable[SupportsFloat],
    settings: FocusSettings | None = None,
    *,
    register: bool = False,
) -> FocusResult:
    """Measure the depth of each pixel from a whole focus stack.

    The result does not depend on the order of the frames, and is that of a `FocusStack` that takes them while the
    stage moves in one direction, bit for bit; with `register`, upward.

    Args:
        frames: (N, H, W), uint8 or uint16; any iterable of frames.
        z: (N,), position of the stage at each frame, in any order and unit; any iterable of numbers.
        settings: of the focus measure and the fit; None: the defaults.
        register: whether sideways drift and changes of the magnification are corrected, see `FocusStack`; the
            heights are then those at the pixels of the lowest frame.

    Raises:
        StackError: a frame or a z cannot be used, their numbers differ, or fewer than three z are different.
    """
    frames, positions = _listed(frames, 'frames'), [_position(each) for each in _listed(z, 'z')]
    if len(frames) != len(positions):
        raise StackError(f'Each frame needs its z, but there are {len(frames)} frames and {len(positions)} z.')
    stack = FocusStack(settings, register=register)
    for index in sorted(range(len(positions)), key=positions.__getitem__):
        stack.add(frames[index], positions[index])
    return stack.finish()


@kernel
def _take_colours(
    centre: NDArray[np.int16],
    place: int,
    image: Frame,
    frame: Frame,
    colours: NDArray[np.uint8],
    picture: NDArray[np.uint8],
) -> None:
    """Copy the colours of the pixels that are sharpest in this frame.

    Args:
        centre: (H, W), places of the sharpest frames, with this one.
        place: of the frame.
        image: (H, W), the all-in-focus image, with this frame. It differs from the frame where another frame at
            the same z is sharper.
        frame: (H, W).
        colours: (H, W, 3) of the frame.
        picture: (H, W, 3), updated.
    """
    height, width = image.shape
    for row in range(height):
        for x in range(width):
            if centre[row, x] == place and image[row, x] == frame[row, x]:
                for channel in range(3):
                    picture[row, x, channel] = colours[row, x, channel]


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
