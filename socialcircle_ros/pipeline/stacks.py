# SPDX-License-Identifier: Apache-2.0
"""Focus stacks: frames and stage positions → clouds. The node does this live, `socialcircle filter` offline.

A stack is closed at its end, and the next frame begins the next stack. It is given up where a frame cannot belong
to it. Where z is counted, the next stack then begins with the next scan, as far as the stamps tell where that is.
"""

import contextlib
import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from socialcircle_ros.errors import MessageError, SocialCircleError, StackError, printable
from socialcircle_ros.focus import FocusStack
from socialcircle_ros.kernels.memory import give_back_freed_memory
from socialcircle_ros.messages.image import Image
from socialcircle_ros.messages.joint_state import JointState
from socialcircle_ros.settings import FocusSettings, StackSettings

from .frame_stamps import period_of
from .rest_of_scan import PAUSE_PERIODS, RestOfScan
from .running_stack import RunningStack
from .stack_cloud import StackCloud, fields_of

MOST_WAITING = 64
"""Frames that may wait for a joint state; when more wait, the first one is refused."""

MOST_STATES = 10_000
"""Joint states that are kept; frames before the oldest one are refused."""

BYTES_PER_PIXEL = 86
"""Memory that a stack needs for each of its pixels: 64 for the curves, 22 for the results; not the cloud.
Colour needs 6 more."""

GAP_NS = 500_000_000
"""Joint states that are further apart than this are not interpolated."""

NOT_SET = 'is not set; set it to'
"""What the refusal of a frame says of a parameter that the stack needs."""

_NEVER = -(2**63)  # before every stamp
_OF_GIVEN_UP = (
    'A frame was refused: the stack of its scan was given up, so that its z is not known. The next scan makes the'
    ' next stack.'
)


@dataclass(frozen=True)
class Refusal:
    """Input that was refused, and why."""

    reason: str

    def __post_init__(self) -> None:
        """Make the reason printable, so that it can be logged and published."""
        object.__setattr__(self, 'reason', printable(self.reason))


StackEvent = StackCloud | Refusal


class StackAssembler:
    """Makes clouds from serialized frames and joint states, one stack after the other.

    Each call yields the events that it causes, in order. The assembler reads no clock: the caller checks
    `timeout`.

    Args:
        make_focus: makes what measures the frames.
    """

    def __init__(self, make_focus: Callable[[FocusSettings], FocusStack] = FocusStack) -> None:
        self._make_focus = make_focus
        self._focus, self._settings = FocusSettings(), StackSettings()
        self._stack: RunningStack | None = None
        # The memory of the last stack is reused for the next one of its kind: a new allocation of 50 MB costs
        # frames.
        self._memory: tuple[tuple[FocusSettings, tuple[int, ...], str], FocusStack] | None = None
        self._waiting: deque[Image] = deque()
        # Stamp in ns, z of the stage in m; ascending stamps.
        self._track: deque[tuple[int, float]] = deque(maxlen=MOST_STATES)
        self._track_is_new = False  # whether it began again since the last frame
        self._last_stamp = self._last_placed = _NEVER
        self._recent: deque[int] = deque(maxlen=4)  # stamps of the last frames, ascending
        self._last_message: bytes | memoryview = b''
        self._gave_up = False  # a stack since the last one began, and nothing tells where the next scan begins
        self._late: int | None = None  # stamp of the last frame, if that was refused: it came after a later one
        self._first: int | None = None  # stamp of the first frame of the scan
        self._period = 0  # of the frames of the last stack, ns; 0: unknown
        self._rest: RestOfScan | None = None  # of a stack that was given up
        self._ended: RestOfScan | None = None  # of the last stack that ended
        self._ended_early = False  # whether frames of that one may follow: its end was told by a stamp alone
        self._missing = 0  # frames that are known to be missing before the next one that is counted
        self._ahead: int | None = None  # number in its scan of the frame behind the last stack; None: unknown

    def configure(self, focus: FocusSettings, settings: StackSettings) -> None:
        """Set how the next stack is measured; the running one keeps its settings."""
        self._focus, self._settings = focus, settings

    @property
    def running(self) -> bool:
        """Whether a stack has begun, or frames of one that was given up are refused."""
        return self._stack is not None or bool(self._waiting) or self._rest is not None

    @property
    def cloud_size(self) -> int:
        """Size in bytes of the cloud that the running stack becomes; 0: none runs."""
        stack = self._stack
        return 4 * len(fields_of(stack.encoding)) * math.prod(stack.shape) if stack is not None else 0

    @property
    def frames(self) -> int:
        """How many frames the running stack has, with those that wait for a joint state."""
        return len(self._waiting) + (0 if self._stack is None else self._stack.frames)

    def add_frame(self, message: bytes | memoryview, missing: int = 0) -> Iterator[StackEvent]:
        """Take in a serialized Image; `missing`: frames known to be missing since the one before, which count."""
        self._missing += missing
        try:
            frame = Image.decode(message)
            self._check(frame)
        except SocialCircleError as error:
            yield Refusal(f'A frame was refused: {error}')
            return
        stamp = frame.header.stamp
        if self._rest is not None:
            if self._rest.takes(stamp):
                self._last_stamp = stamp
                yield Refusal(_OF_GIVEN_UP)
                return
            self._rest, self._last_stamp, self._last_placed, self._first = None, _NEVER, _NEVER, None
            self._recent.clear()
        counts = self._settings_now.z_source == 'step' and self._settings_now.check_stamps
        if counts and stamp == self._last_stamp and message == self._last_message:
            yield Refusal('A frame was refused: it came twice.')
            return
        if counts and self._stack is None and self._is_of_ended(stamp):
            yield Refusal('A frame was refused: it came after its stack had ended.')
            return
        if stamp < self._last_stamp:
            if counts and (refusals := self._refused_late(stamp)):
                yield from refusals
                return
            if self._goes_on(stamp):
                yield from self._refuse_after(stamp)
            else:
                yield from self._go_back(stamp)
        self._track_is_new, self._late = False, None
        self._last_stamp, self._last_message = stamp, message
        if self._settings_now.z_source == 'joint_states':
            self._waiting.append(frame)
            yield from self._place_waiting()
            if len(self._waiting) > MOST_WAITING:
                self._waiting.popleft()
                yield Refusal(
                    f'A frame was refused: after {MOST_WAITING} more frames no joint state covers its stamp; check'
                    ' that stack/joint_states is published with the clock of the frames, or set stack.z_source.'
                )
        else:
            yield from self._take(frame, None)

    def add_joint_state(self, message: bytes) -> Iterator[StackEvent]:
        """Take in a serialized JointState; it is ignored where z is counted."""
        if self._settings_now.z_source == 'step':
            return
        try:
            state = JointState.decode(message)
            z = _position(state, self._settings_now.joint)
        except MessageError as error:
            yield Refusal(f'A joint state was refused: {error}')
            return
        stamp = state.header.stamp
        if self._track and stamp < self._track[-1][0]:
            self._track.clear()  # a replay that began again, or a stage that was switched on again
            self._track_is_new = True
        if self._track and stamp == self._track[-1][0]:
            self._track.pop()
        self._track.append((stamp, z))
        # Of the states before the first waiting frame, only the nearest is needed; a wrong stamp of the future
        # needs none.
        oldest = stamp - 10 * GAP_NS
        if self._waiting:
            oldest = min(oldest, self._time_of(self._waiting[0]))
        while len(self._track) > 2 and self._track[1][0] < oldest:
            self._track.popleft()
        yield from self._place_waiting()

    def finish(self) -> Iterator[StackEvent]:
        """Close the running stack, on request or after the timeout."""
        self._rest = self._ended = self._first = self._ahead = None
        self._last_message = b''
        if self._waiting:
            count = len(self._waiting)
            self._waiting.clear()
            stamps = '1 frame was refused: no joint state covers its stamp.'
            if count > 1:
                stamps = f'{count} frames were refused: no joint state covers their stamps.'
            yield Refusal(stamps)
        yield from self._close()

    def _end(self, stack: RunningStack, *, early: bool) -> Iterator[StackEvent]:
        """Close the running stack at its end; `early`: a stamp alone tells it, and may be wrong."""
        self._ended, self._ended_early, self._first = None, early, None
        if stack.counts:
            stamps, period = stack.stamps, period_of(stack.stamps) or self._period
            is_far = len(stamps) > 1 and stamps[-1] - stamps[-2] >= PAUSE_PERIODS * period > 0
            last = stamps[-2] if is_far else stamps[-1]  # a stamp far ahead ends a stack, but is a wrong one
            self._ended = RestOfScan(stamps[0], last, period, stack.settings.frames)
        elif stack.settings.z_source == 'step' and stack.settings.frames:
            self._ahead = stack.last_number + 1 - stack.settings.frames
        yield from self._close()

    def _close(self) -> Iterator[StackEvent]:
        """Make a cloud of the running stack; waiting frames belong to the next one."""
        stack, self._stack = self._stack, None
        if stack is None:
            return
        self._period = (period_of(stack.stamps) if stack.counts else 0) or self._period
        try:
            yield stack.cloud(preview=False)
        except StackError as error:
            yield Refusal(f'A stack of {_frames(stack.frames)} broke off: {error}')

    @property
    def timeout(self) -> float:
        """Time in s without a frame after which the caller finishes the running stack; 0: never."""
        return self._settings_now.timeout

    @property
    def _settings_now(self) -> StackSettings:
        return self._stack.settings if self._stack is not None else self._settings

    def _go_back(self, stamp: int) -> Iterator[StackEvent]:
        """Give the running stack up where time went backwards: a replay in a loop, or a clock that was set."""
        if self.running:
            back_s = (self._last_stamp - stamp) / 1e9
            yield Refusal(f'Time went backwards by {back_s:.3f} s: the running stack was given up.')
            self._gave_up = True
        self._stack = self._first = self._ended = self._ahead = None
        self._waiting.clear()
        self._last_placed = _NEVER
        if not self._track_is_new:
            self._track.clear()  # its stamps are from before

    def _is_of_ended(self, stamp: int) -> bool:
        """Whether a frame belongs to the last stack, although that has ended: it is late, or a stamp was wrong."""
        ended = self._ended
        if ended is None:
            return False
        return ended.first < stamp <= ended.last or (self._ended_early and ended.takes(stamp))

    def _refused_late(self, stamp: int) -> list[StackEvent]:
        """Refuse a frame, of which z is counted, that came after a frame with a later stamp; none: it is no such.

        One such frame counts as lost. After two of them it is the later stamp that is wrong, and z is not known.
        """
        stack, late_s = self._stack, (self._last_stamp - stamp) / 1e9
        given_up: list[StackEvent] = [
            Refusal(f'Time went backwards by {late_s:.3f} s: the running stack was given up.')
        ]
        if self._ended is not None and stack is not None and stack.frames == 1 and self._ended.takes(stamp):
            # The stamp of one frame, far ahead, ended the stack before.
            self._stack, self._rest, self._last_stamp = None, self._ended, stamp
            return given_up
        if stack is None or stamp <= stack.stamps[0]:
            return []
        if self._late is None:
            self._late = stamp
            return [Refusal(f'A frame was refused: it came {late_s:.3f} s after a later one.')]
        since, self._late = abs(stamp - self._late), None
        self._give_up(stack, stamp, period_of(stack.stamps) or self._period or since)
        self._last_stamp = stamp
        return given_up

    def _give_up(self, stack: RunningStack, stamp: int, period: int) -> bool:
        """Give a stack up, of which z is counted, at a frame with this stamp.

        Returns:
            Whether the frame belongs to the rest of the scan, as far as the stamps tell.
        """
        first = stack.stamps[0] if self._first is None else self._first
        rest = RestOfScan(first, stamp, period, stack.settings.frames)
        self._stack = None
        if not rest.takes(stamp):
            # Without a period nothing tells whether the scan goes on.
            self._gave_up, self._first = period <= 0, first if period <= 0 else None
            return False
        self._rest = rest
        return True

    def _goes_on(self, stamp: int) -> bool:
        """Whether time goes on with a frame, although a later stamp came before: that stamp is the wrong one.

        It is where no measured frame is later, and the stage is not at a later time either.
        """
        if stamp < self._last_placed:
            return False
        return not self._track or stamp >= self._track[-1][0] - GAP_NS

    def _refuse_after(self, stamp: int) -> Iterator[StackEvent]:
        """Refuse the waiting frames with later stamps."""
        while self._waiting and self._waiting[-1].header.stamp > stamp:
            ahead_s = (self._waiting.pop().header.stamp - stamp) / 1e9
            yield Refusal(f'A frame was refused: its stamp is {ahead_s:.3f} s after that of the frame behind it.')

    def _time_of(self, frame: Image) -> int:
        """When the stage was where the frame shows the part, in ns."""
        return frame.header.stamp - round(1e9 * self._settings_now.latency)

    def _place_waiting(self) -> Iterator[StackEvent]:
        """Take the frames with stamps that joint states cover."""
        while self._waiting and self._track and self._track[-1][0] >= self._time_of(self._waiting[0]):
            frame = self._waiting.popleft()
            try:
                z = _interpolated(self._track, self._time_of(frame))
            except StackError as error:
                yield Refusal(str(error))
            else:
                yield from self._take(frame, z)

    def _take(self, frame: Image, z: float | None) -> Iterator[StackEvent]:
        """Add a frame to the running stack, or begin one; close it where it ends.

        Args:
            frame: the frame.
            z: position of the stage in m; None: counted from z_start by z_step.
        """
        stamp = self._last_placed = frame.header.stamp
        if self._recent and stamp < self._recent[-1]:
            self._recent.clear()
        self._recent.append(stamp)
        pixels = frame.gray()
        stack = self._stack
        missing, self._missing = self._missing, 0
        if stack is not None and stack.ends_before(stamp, z, missing):
            yield from self._end(stack, early=True)
            stack = None
        if stack is not None and (pixels.shape, frame.encoding) != (stack.shape, stack.encoding):
            yield Refusal(
                f'A stack of {_frames(stack.frames)} broke off: a frame of {pixels.shape} {frame.encoding} came'
                f' after {stack.shape} {stack.encoding}.'
            )
            if stack.counts and self._give_up(stack, stamp, period_of(self._recent) or self._period):
                return
            stack = self._stack = None
        if stack is None:
            stack = self._begin(frame, pixels.shape, missing if z is None else 0)
        try:
            stack.add(frame, pixels, z, missing)
        except StackError as error:
            yield Refusal(f'A frame was refused: {error}')
            return
        settings = stack.settings
        if stack.is_whole:
            yield from self._end(stack, early=stack.frames < settings.frames)
        elif settings.preview and stack.frames % settings.preview == 0 and stack.focus.places >= 3:
            with contextlib.suppress(StackError):  # the end of the stack tells it
                yield stack.cloud(preview=True)

    def _check(self, frame: Image) -> None:
        """Check that a frame can join the running stack or begin one. A refused frame changes nothing.

        Raises:
            MessageError: the message is no image that can be measured.
            StackError: the image is too large, or the settings allow no stack.
        """
        frame.pixels()
        stack = self._stack
        if stack is not None and stack.shape == (frame.height, frame.width) and stack.encoding == frame.encoding:
            return
        settings = self._settings
        pixels = frame.height * frame.width
        if pixels > settings.max_pixels:
            raise StackError(
                f'it has {pixels:,} pixels, more than stack.max_pixels ({settings.max_pixels:,}); a stack of such'
                f' frames needs about {pixels * BYTES_PER_PIXEL / 1e9:.1f} GB of memory.'
            )
        if settings.pitch_x == 0:
            raise StackError(f'stack.pitch_x {NOT_SET} the distance of two pixels on the part, in metres.')
        if settings.z_source == 'step' and settings.z_step == 0:
            raise StackError(f'stack.z_step {NOT_SET} the distance of two frames, in metres.')

    def _begin(self, frame: Image, shape: tuple[int, ...], missing: int) -> RunningStack:
        kind = self._focus, shape, frame.encoding
        if self._memory is None or self._memory[0] != kind:
            self.release_memory()
            self._memory = kind, self._make_focus(self._focus)
        _, focus = self._memory
        focus.reset()
        focus.register = self._settings.register
        self._stack = RunningStack(focus, self._settings, shape, frame.encoding, frame.header)
        self._stack.after_another, self._gave_up = self._gave_up, False
        self._stack.begin_behind(missing, self._ahead)
        self._ahead = None
        if self._first is None:
            self._first = frame.header.stamp
        return self._stack

    def release_memory(self) -> None:
        """Give the memory of the last stack back to the system; the running stack keeps its own."""
        if self._memory is not None:
            self._memory = None
            give_back_freed_memory()


def _frames(count: int) -> str:
    return '1 frame' if count == 1 else f'{count} frames'


def _position(state: JointState, joint: str) -> float:
    """The position of the joint that moves the stage, in m.

    Raises:
        MessageError: the joint is missing, or its position is not finite.
    """
    names = list(state.names)
    if joint and joint not in names:
        raise MessageError(f'it has no joint {joint!r}; it has: {", ".join(names) or "none"}. See stack.joint.')
    index = names.index(joint) if joint else 0
    if index >= len(state.positions) or not math.isfinite(state.positions[index]):
        raise MessageError(f'joint {joint or "0"} has no finite position.')
    return state.positions[index]


def _interpolated(track: deque[tuple[int, float]], stamp: int) -> float:
    """Z of the stage in m at a stamp in ns that is not after the last joint state.

    Raises:
        StackError: the stamp is before the first joint state, or in a gap.
    """
    before = after = None
    for state in reversed(track):
        if state[0] > stamp:
            after = state
        else:
            before = state
            break
    if before is None:
        raise StackError('A frame was refused: its stamp is before the first joint state.')
    if after is None or before[0] == stamp:
        return before[1]
    if after[0] - before[0] > GAP_NS:
        gap_s = (after[0] - before[0]) / 1e9
        raise StackError(f'A frame was refused: the joint states around its stamp are {gap_s:.1f} s apart.')
    share = (stamp - before[0]) / (after[0] - before[0])
    return before[1] + share * (after[1] - before[1])
