# SPDX-License-Identifier: Apache-2.0
"""A focus stack while its frames come: where it ends, and which z its frames have."""

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from socialcircle_ros.errors import StackError
from socialcircle_ros.focus import FocusResult, FocusStack, Frame
from socialcircle_ros.lengths import length_text
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.image import Image
from socialcircle_ros.settings import StackSettings

from .frame_stamps import GAP_PERIODS, frame_numbers, period_of
from .rest_of_scan import PAUSE_PERIODS
from .stack_cloud import StackCloud, make_cloud

_MOST_DRIFT = 2.0
"""Pixels that a part may move sideways in a stack. On a simulated rough plane of 15 frames, the error of the good
pixels is 0.09 steps without drift, 0.11 with 1 pixel, 0.14 with 2, 0.17 with 3 and 0.22 with 5."""

_FINER = 4
"""Where steps are too wide, the fitted curves are too wide, too, so that they do not tell which step would do. A
quarter of one does, up to steps of four depths of field."""


@dataclass
class RunningStack:
    """A stack, with the settings that were in force when it began.

    Attributes:
        focus: measures the frames.
        settings: in force.
        shape: of the frames.
        encoding: of the frames.
        header: of the last frame.
        stamps: of the frames that were measured, ns.
        offered: frames that were offered, with those that could not be measured.
        ended_by: what ended the stack before its time; '': nothing did.
        after_another: whether another stack was given up before it, and nothing tells where the next scan began.
        first: number in its scan of the first frame, as far as the numbers of the publisher tell it.
        missing_before: frames that are known to be missing before the first one; they may belong to it.
        missing: frames that are known to be missing between the first and the last one.
    """

    focus: FocusStack
    settings: StackSettings
    shape: tuple[int, ...]
    encoding: str
    header: Header
    stamps: list[int] = field(default_factory=list)
    offered: int = 0
    ended_by: str = ''
    after_another: bool = False
    first: int = 0
    missing_before: int = 0
    missing: int = 0
    _first_z: float = math.nan
    _last_z: float = math.nan
    _furthest_z: float = math.nan
    _blue_first: bool = False
    _steady: bool = True
    """Whether z never moved back."""
    _gap: bool = False
    """Whether there was a gap between two frames."""

    @property
    def frames(self) -> int:
        """How many frames were measured."""
        return len(self.stamps)

    def begin_behind(self, missing: int, ahead: int | None) -> None:
        """Take note of frames that are known to be missing before the first one.

        Args:
            missing: how many.
            ahead: number in its scan of the first of them, from the end of the stack before; None: not known.
        """
        self.missing_before = missing
        if ahead is not None and self.settings.frames and not self.counts:
            # Nothing but their count tells where the scans that follow begin.
            self.first = (ahead + missing) % self.settings.frames

    def add(self, frame: Image, pixels: Frame, z: float | None, missing: int = 0) -> None:
        """Measure a frame.

        Args:
            frame: its message.
            pixels: (H, W), its pixels in gray.
            z: position of the stage in m; None: it is counted.
            missing: frames that are known to be missing before it; those before the first one are not counted.

        Raises:
            StackError: the frame cannot be used.
        """
        if z is None:
            self.missing += missing if self.offered else 0
            z = self.settings.z_start + self.settings.z_step * (self.first + self.offered + self.missing)
        self.offered += 1
        self.focus.add(pixels, z, frame.colours())
        header = frame.header
        self._blue_first = frame.blue_first
        self._gap |= self.counts and self._shows_gap(header.stamp)
        self.header = header
        self.stamps.append(header.stamp)
        if self.frames == 1:
            self._first_z = self._furthest_z = z
        else:
            self._steady &= (z - self._last_z) * (self._last_z - self._first_z) >= 0
        if abs(z - self._first_z) > abs(self._furthest_z - self._first_z):
            self._furthest_z = z
        self._last_z = z

    def ends_before(self, stamp: int, z: float | None, missing: int = 0) -> bool:
        """Whether a frame belongs to the next stack, and not to the rest of this one; arguments as of `add`."""
        if z is not None:
            if self.settings.end_at_turn and self._turned(z):
                return True
            if self._returned(z) or (self.settings.frames and self._resumed_elsewhere(stamp, z)):
                self.ended_by = ', and the stage began again'
                return True
            return False
        if not self.counts or period_of(self.stamps) <= 0:
            wanted = self.settings.frames
            return 0 < wanted <= self.last_number + missing + 1 and missing > 0
        periods = self._periods_to(stamp)
        if periods < GAP_PERIODS:
            return False
        if self.settings.frames:
            return self.last_number + round(periods) >= self.settings.frames
        if periods - missing >= PAUSE_PERIODS:
            self.ended_by = f', before a pause of {periods:.0f} periods'
            return True
        return False

    @property
    def is_whole(self) -> bool:
        """Whether all frames have come that `stack.frames` asks for, or were lost on the way."""
        wanted = self.settings.frames
        has_gaps = self._gap or self.first + self.missing > 0
        return bool(wanted) and (self.frames >= wanted or (has_gaps and self.last_number >= wanted - 1))

    def cloud(self, *, preview: bool) -> StackCloud:
        """The cloud and the image of the frames so far.

        Raises:
            StackError: there are too few different z, or the stamps of the frames do not fit.
        """
        numbers = frame_numbers(self.stamps) if self.counts else None
        z = None if numbers is None else self._counted(numbers)
        lost = self.missing if numbers is None else int(numbers[-1]) + 1 - self.frames
        known_by = 'the numbers of their publisher' if numbers is None else 'the stamps'
        result = self.focus.finish(z)
        return make_cloud(
            result,
            self.settings,
            self.header,
            frames=self.frames,
            preview=preview,
            warning='' if preview else self._warning(lost, known_by, result),
            speed=self._speed,
            blue_first=self._blue_first,
        )

    @property
    def _speed(self) -> float:
        """Of the stage, m/s; 0 where the stamps are equal."""
        time_ns = self.stamps[-1] - self.stamps[0]
        return 1e9 * (self._last_z - self._first_z) / time_ns if time_ns else 0.0

    @property
    def counts(self) -> bool:
        """Whether z is counted by the stamps."""
        return self.settings.z_source == 'step' and self.settings.check_stamps

    def _counted(self, numbers: npt.NDArray[np.int64]) -> npt.NDArray[np.float64] | None:
        """Z of the frames in ascending order; None: some frame was not measured, or their z are those."""
        if self.offered != self.frames or numbers[-1] + 1 == self.frames + self.missing == self.frames:
            return None
        z = self.settings.z_start + self.settings.z_step * numbers
        return np.sort(z)

    def _shows_gap(self, stamp: int) -> bool:
        """Whether frames are missing before a stamp: just before it, or before the period was known."""
        period = period_of([*self.stamps, stamp])
        if period <= 0:
            return False
        return (
            stamp - self.stamps[-1] >= GAP_PERIODS * period
            or stamp - self.stamps[0] >= (len(self.stamps) + 0.5) * period
        )

    def _periods_to(self, stamp: int) -> float:
        """The periods from the last frame to a stamp; 0: the period is not known yet."""
        period = period_of(self.stamps)
        return (stamp - self.stamps[-1]) / period if period > 0 else 0.0

    @property
    def last_number(self) -> int:
        """The number of the last frame in its scan, with lost ones as far as stamps or the publisher tell."""
        try:
            numbers = frame_numbers(self.stamps) if self.counts else None
        except StackError:
            numbers = None
        return self.first + self.frames + self.missing - 1 if numbers is None else int(numbers[-1])

    def _turned(self, z: float) -> bool:
        """Whether z moved back by more than half of the mean step, which jitter does not reach."""
        if self.frames < 3 or self._furthest_z == self._first_z:
            return False
        step = (self._furthest_z - self._first_z) / (self.frames - 1)
        return (self._furthest_z - z) / step > 0.5

    def _returned(self, z: float) -> bool:
        """Whether z jumped back over more than half of the scan, after it had never moved back."""
        span = self._furthest_z - self._first_z
        return self._steady and self.frames > 3 and (self._furthest_z - z) * np.sign(span) > abs(span) / 2 > 0

    def _resumed_elsewhere(self, stamp: int, z: float) -> bool:
        """Whether z is not one step on after a pause: the stage went to where the next scan begins."""
        if self.frames < 3 or self._furthest_z == self._first_z or self._periods_to(stamp) < PAUSE_PERIODS:
            return False
        step = (self._furthest_z - self._first_z) / (self.frames - 1)
        return abs((z - self._last_z) / step - 1) > 0.5

    def _warning(self, lost: int, known_by: str, result: FocusResult) -> str:
        """What may be wrong with the cloud; '': there is no sign of it.

        Args:
            lost: frames that were lost on the way.
            known_by: what shows that.
            result: what was measured.
        """
        sentences = []
        drift, registered = result.drift, result.registered
        if registered is not None and registered.failed:
            sentences.append(
                f'{_frames(registered.failed)} of a stack could not be registered, which makes heights less exact:'
                ' their texture does not tell where they show the part. Take more frames, nearer to each other,'
                ' in the order of z.'
            )
        elif registered is None and drift is not None and drift > _MOST_DRIFT:
            sentences.append(
                f'The frames of a stack moved sideways by {drift:.1f} pixels, which makes heights less exact:'
                ' clamp the part and the camera, align the stage with the optical axis, and scan again; or set'
                ' stack.register.'
            )
        if result.wide_steps:
            step = abs(self._furthest_z - self._first_z) / (self.focus.places - 1)
            sentences.append(
                'The frames of a stack are too few, or too far apart, to tell where its focus curves peak; the'
                f' quality is low. Scan with steps of {length_text(step / _FINER, "m")}, instead of'
                f' {length_text(step, "m")}.'
            )
        if lost:
            sentences.append(
                f'{_frames(lost)} of a stack {"was" if lost == 1 else "were"} lost on the way, as {known_by} show;'
                ' z is counted with the gaps.'
            )
        if self.missing_before:
            were = 'was' if self.missing_before == 1 else 'were'
            sentences.append(
                f'{_frames(self.missing_before)} {were} lost on the way just before a stack, of which z counts'
                f' {self.first or "none"} as its own: where that is wrong, all its heights are shifted.'
            )
        if self.after_another and self.counts:
            sentences.append(
                'Another stack was given up just before the first frame of a stack: if that was in the middle of a'
                ' scan, its heights are wrong.'
            )
        wanted = self.settings.frames
        if self.first + self.frames + lost < wanted:
            sentences.append(
                f'A stack ended after {_frames(self.frames)}, where stack.frames says {wanted}{self.ended_by}:'
                ' heights that the stage did not reach are missing or wrong.'
            )
        elif self.ended_by and not wanted:
            sentences.append(
                f'A stack ended after {_frames(self.frames)}{self.ended_by}: if frames were lost in it, the'
                ' heights of the next stack are wrong.'
            )
        return ' '.join(sentences)


def _frames(count: int) -> str:
    return '1 frame' if count == 1 else f'{count} frames'
