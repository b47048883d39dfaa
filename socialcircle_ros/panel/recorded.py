# SPDX-License-Identifier: Apache-2.0
"""Random access to the clouds and the focus stacks of a recording."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

from socialcircle_ros.arguments import settings_or_default
from socialcircle_ros.errors import RecordingError
from socialcircle_ros.interface import FILTERED, REPAIRED, STACK_FRAMES, STACK_JOINT_STATES, STACK_POINTS
from socialcircle_ros.messages.header import stamp_of
from socialcircle_ros.pipeline.stacks import Refusal
from socialcircle_ros.recording import Message, open_recording
from socialcircle_ros.recording.offline import SourceCloud, clouds_of, source_clouds, stacks_of
from socialcircle_ros.recording.reader import RecordingReader
from socialcircle_ros.recording.units import unit_of
from socialcircle_ros.settings import PipelineSettings

from .link import StackMessage

Progress = Callable[[int, int], None]
"""Takes the number of messages that have been read, and how many there are."""


class _Place(NamedTuple):
    """A message of the recording.

    Attributes:
        log_time: in ns.
        number: among the messages of this time that the page reads, from 0 on.
    """

    log_time: int
    number: int


@dataclass(frozen=True)
class RecordedStack:
    """A focus stack of a recording.

    Attributes:
        stamp: of its cloud, in ns.
        frames: how many frames were measured.
        reasons: number of pixels by objection to their depth.
        warning: why its heights may be wrong; '': there is no sign of it.
        namespace: of its frames.
    """

    stamp: int
    frames: int
    reasons: Mapping[str, int]
    warning: str
    namespace: str


@dataclass(frozen=True)
class RecordedCloud:
    """A cloud of a recording, or a stack that becomes one.

    Attributes:
        topic: of the cloud.
        log_time: when it was recorded, in ns.
        stack: the stack that it comes from; None: it was recorded as a cloud.
        unit: of its coordinates; None: the recording does not say.
    """

    topic: str
    log_time: int
    stack: RecordedStack | None = None
    unit: str | None = None


@dataclass(frozen=True)
class _Indexed:
    """Where a cloud, or the messages of a stack, are in the recording.

    Attributes:
        cloud: what is known of it.
        place: of the first message.
        count: number of messages.
    """

    cloud: RecordedCloud
    place: _Place
    count: int = 1


class RecordedClouds:
    """An open recording as a sequence of clouds and stacks; a context manager that closes it.

    Opening reads the whole recording once, and measures the stacks of a recording of frames to find where each
    ends. Then one cloud, or the frames of one stack, are read at a time.

    Args:
        path: an MCAP file, a rosbag2 directory, or a measurement file.
        settings: how the node makes stacks of frames.
        progress: called while the recording is read.

    Attributes:
        path: of the recording.
        damage: one sentence that says where the recording breaks off; None: it is complete.
        refusals: why frames gave no cloud, with the number of times.

    Raises:
        RecordingError: it cannot be read, or has neither clouds nor stacks.
    """

    def __init__(
        self,
        path: Path,
        settings: PipelineSettings | None = None,
        progress: Progress = lambda done, total: None,
    ) -> None:
        self.path = path
        self.refusals: dict[str, int] = {}
        with ExitStack() as closing:
            self._reader = closing.enter_context(open_recording(path))
            namespaces = stacks_of(self._reader)
            clouds = _clouds_in(self._reader)
            frames = [topic.within(space) for space in namespaces for topic in (STACK_FRAMES, STACK_JOINT_STATES)]
            self._topics = (*clouds, *frames)
            walk = self._walk_stacks if namespaces else self._walk_clouds
            self._found = list(walk(settings_or_default(PipelineSettings, settings), progress))
            if not self._found:
                because = next(iter(self.refusals), f'it has no message on {", ".join(self._topics)}.')
                raise self._reader.refusal(f'{path} gives no cloud: {because}')
            self.damage = self._reader.damage
            self._closing = closing.pop_all()

    def __len__(self) -> int:
        return len(self._found)

    def __getitem__(self, number: int) -> RecordedCloud:
        """What is known of one cloud, counted from 0."""
        return self._found[number].cloud

    def message(self, number: int) -> Message:
        """Read one cloud, counted from 0, that was recorded as a cloud.

        Raises:
            RecordingError: the recording can no longer be read.
        """
        place = self._found[number].place
        found = next(self._since(place), None)
        if found is None or found.log_time != place.log_time:
            raise RecordingError(f'{self.path} has changed since it was opened; open it again.')
        return found

    def stack_messages(self, number: int) -> Iterator[StackMessage]:
        """Read the frames and the stage positions of one stack, counted from 0, in their order."""
        found = self._found[number]
        if found.cloud.stack is None:
            return
        inputs = {topic.within(found.cloud.stack.namespace): topic for topic in (STACK_FRAMES, STACK_JOINT_STATES)}
        for message in islice(self._since(found.place), found.count):
            if message.topic in inputs:
                yield StackMessage(inputs[message.topic], message.data, message.log_time)

    def close(self) -> None:
        """Close the recording."""
        self._closing.close()

    def __enter__(self) -> 'RecordedClouds':  # noqa: PYI034 - Self is not in Python 3.10
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _since(self, place: _Place) -> Iterator[Message]:
        """The messages that the page reads, from one of them on."""
        return islice(self._reader.messages(self._topics, since=place.log_time), place.number, None)

    def _walk_clouds(self, _: PipelineSettings, progress: Progress) -> Iterator[_Indexed]:
        """The clouds of a recording without stacks; they are not read."""
        place: _Place | None = None
        for number, message in enumerate(self._reader.messages(self._topics), 1):
            place = _after(place, message)
            progress(number, self._reader.message_count)
            yield _Indexed(self._cloud(message), place)

    def _walk_stacks(self, settings: PipelineSettings, progress: Progress) -> Iterator[_Indexed]:
        """The clouds and the stacks of a recording, which are measured."""
        place: _Place | None = None
        last: Message | None = None
        last_frames: dict[str, Message] = {}
        waiting: dict[str, tuple[_Place, int]] = {}  # by namespace: what its next stack begins with
        positions: dict[str, tuple[_Place, int]] = {}  # by namespace: its last stage position
        ended_by: Message | None = None  # the last frame of a stack, which begins no other
        number = read = 0

        def seen(message: Message | None) -> None:
            nonlocal place, last, number, read
            if message is None:
                return
            number, last = number + 1, message
            progress(number, self._reader.message_count)
            if message.topic in self._topics:
                place, read = _after(place, message), read + 1
                space = _namespace_of_frames(message.topic)
                if space is not None and STACK_FRAMES.namespace_of(message.topic) is not None:
                    last_frames[space] = message
                    if message is ended_by:
                        return
                    # The position before the first frame is needed to interpolate its z.
                    waiting.setdefault(space, positions.get(space, (place, read)))
                elif space is not None:
                    positions[space] = place, read

        for cloud in source_clouds(self._reader, settings, seen=seen):
            if isinstance(cloud, Refusal):
                self.refusals[cloud.reason] = self.refusals.get(cloud.reason, 0) + 1
                continue
            here = _after(place, cloud.message)
            if cloud.image is None:
                yield _Indexed(self._cloud(cloud.message), here)
                continue
            is_read = cloud.message is last or cloud.message is last_frames.get(cloud.namespace)
            end, ended_by = read if is_read else read + 1, cloud.message
            first, begin = waiting.pop(cloud.namespace, (here, end))
            made = RecordedCloud(cloud.topic, cloud.message.log_time, _stack_of(cloud), 'm')
            yield _Indexed(made, first, end - begin + 1)

    def _cloud(self, message: Message) -> RecordedCloud:
        return RecordedCloud(message.topic, message.log_time, unit=unit_of(self._reader, message.topic))


def check_recording(path: Path) -> None:
    """Check that the page can open a recording, as far as that takes no time.

    Raises:
        RecordingError: it cannot be read, or has neither clouds nor stacks.
        ImportFileError: it is a measurement file that cannot be used.
    """
    with open_recording(path) as reader:
        _clouds_in(reader)


def _clouds_in(reader: RecordingReader) -> tuple[str, ...]:
    """The topics of clouds that were not filtered yet.

    Raises:
        RecordingError: there is none, and there are no frames either.
    """
    clouds = clouds_of(reader)
    results = [name for name in clouds if any(t.namespace_of(name) is not None for t in (FILTERED, REPAIRED))]
    if results:
        raise reader.refusal(f'{reader.path} holds only results of the filter: {", ".join(results)}.')
    if not clouds and not stacks_of(reader):
        clouds = tuple(name for name in reader.topics if STACK_POINTS.namespace_of(name) is not None)
        if not clouds:
            topics = ', '.join(sorted(reader.topics)) or 'no topics'
            raise reader.refusal(f'{reader.path} has neither clouds nor frames of a stack; it has: {topics}.')
    return clouds


def _after(place: _Place | None, message: Message) -> _Place:
    """The place of the message that follows the one at `place`."""
    same_time = place is not None and place.log_time == message.log_time
    return _Place(message.log_time, place.number + 1 if same_time and place is not None else 0)


def _namespace_of_frames(topic: str) -> str | None:
    space = STACK_FRAMES.namespace_of(topic)
    return space if space is not None else STACK_JOINT_STATES.namespace_of(topic)


def _stack_of(cloud: SourceCloud) -> RecordedStack:
    return RecordedStack(stamp_of(cloud.points), cloud.frames, cloud.reasons, cloud.warning, cloud.namespace)
