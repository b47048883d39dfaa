# SPDX-License-Identifier: Apache-2.0
"""The recorder: writes the messages of topics to a recording, byte for byte."""

import re
import signal
import time
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import rclpy
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.topic_endpoint_info import TopicEndpointInfo

from socialcircle_ros.arguments import Compression, OneOrSeveral, several
from socialcircle_ros.errors import RecordingError, SocialCircleError
from socialcircle_ros.node.rclpy_internals import TakenMessage
from socialcircle_ros.node.start import start_ros
from socialcircle_ros.recording import Message, RecordingWriter, ros_topic
from socialcircle_ros.recording.mcap_output import LAST_TIME
from socialcircle_ros.recording.overlap import WriterBehind
from socialcircle_ros.storage import free_bytes, noted_signals

from .message_types import message_class
from .qos import RECORDING_DEPTH, recorded_text
from .topic_input import TopicInput

_LOOK_PERIOD_S = 0.2  # between two looks at the graph for new topics
_DISK_PERIOD_S = 0.2  # between two looks at the free space
_NOT_RECORDED = '/_action/status'


@dataclass(frozen=True)
class TopicChoice:
    """Which topics are recorded, as `ros2 bag record` chooses them.

    Attributes:
        names: of topics; with neither names nor a pattern, every topic that is published.
        every: whether every topic is recorded, whatever else is given.
        pattern: also topics with a name in which this regular expression is found; None: none.
        excluded: no topics with a name in which this one is found; None: none is left out.
    """

    names: OneOrSeveral[str] = ()
    every: bool = False
    pattern: re.Pattern[str] | None = None
    excluded: re.Pattern[str] | None = None

    def holds(self, name: str, resolve: Callable[[str], str]) -> bool:
        """Whether a topic is recorded; `resolve` makes full names of `names`."""
        if self.excluded is not None and self.excluded.search(name):
            return False
        if self.every or not (self.names or self.pattern):
            return not name.endswith(_NOT_RECORDED)
        found = self.pattern is not None and self.pattern.search(name) is not None
        return found or name in map(resolve, several(self.names))


class Recorder(Node):
    """Subscribes to topics as they appear, and writes their messages.

    Args:
        writer: where to write.
        topics: which topics.
        received: called with the topic of each message that was handed to the writer.
        lost: called with a topic and the number of its messages that were published but did not arrive.
        context: the ROS context; None: the default one.

    Attributes:
        left_out: a sentence for each topic and type that is published but not recorded.
    """

    def __init__(
        self,
        writer: WriterBehind,
        topics: TopicChoice,
        received: Callable[[str], None] = lambda topic: None,
        lost: Callable[[str, int], None] = lambda topic, count: None,
        context: Context | None = None,
    ) -> None:
        super().__init__('socialcircle_record', context=context)
        self.left_out: dict[tuple[str, str], str] = {}
        self._writer = writer
        self._topics = topics
        self._received = received
        self._lost = lost
        self._recorded: dict[str, tuple[str, TopicInput]] = {}  # topics, with their type
        self.subscribe_to_new_topics()
        self.create_timer(_LOOK_PERIOD_S, self.subscribe_to_new_topics)

    def subscribe_to_new_topics(self) -> None:
        """Hear all publishers of the wanted topics, also those that have come since the last call."""
        for name, _ in self.get_topic_names_and_types():  # the types may be those of wrong subscribers
            if self._is_wanted(name):
                self._look_at(name, self.get_publishers_info_by_topic(name))

    def take_waiting(self) -> None:
        """Write the messages that have arrived and were not taken yet, one of each topic in turn.

        While they are written others may arrive; of each topic as many are taken as can wait at once.
        """
        waiting = [messages for _, messages in self._recorded.values()]
        for _ in range(RECORDING_DEPTH):
            waiting = [messages for messages in waiting if messages.take_waiting()]

    def _is_wanted(self, name: str) -> bool:
        return self._topics.holds(name, self.resolve_topic_name)

    def _look_at(self, name: str, publishers: Sequence[TopicEndpointInfo]) -> None:
        """Record a topic with the type that most of its publishers have, and tell which others it has."""
        types = Counter(sorted(publisher.topic_type for publisher in publishers))
        for type_name, _ in types.most_common():
            if name not in self._recorded and (name, type_name) not in self.left_out:
                self._begin(name, type_name, [each for each in publishers if each.topic_type == type_name])
        if name in self._recorded:
            recorded, messages = self._recorded[name]
            messages.hear([each for each in publishers if each.topic_type == recorded])
            for type_name in types.keys() - {recorded}:
                self._leave_out(name, type_name, f'it is recorded as {recorded}.')

    def _leave_out(self, name: str, type_name: str, reason: str) -> None:
        """Tell once that messages of a type are not recorded."""
        if (name, type_name) not in self.left_out:
            sentence = f'{name} is not recorded as {type_name}: {reason}'
            self.left_out[name, type_name] = sentence
            self.get_logger().warning(sentence)

    def _begin(self, name: str, type_name: str, publishers: Sequence[TopicEndpointInfo]) -> None:
        """Add a topic to the recording, or leave it out."""
        try:
            message_type = message_class(type_name)
            self._writer.add_topic(ros_topic(name, type_name, recorded_text(publishers)))
        except RecordingError as error:
            if self._writer.closed:
                raise
            self._leave_out(name, type_name, str(error))
            return
        write = self._write_to(name)
        messages = TopicInput(self, message_type, name, write, lambda count: self._lost(name, count))
        self._recorded[name] = type_name, messages

    def _write_to(self, topic: str) -> Callable[[TakenMessage], None]:
        """The callback that writes the messages of a topic."""

        def write(taken: TakenMessage) -> None:
            now = time.time_ns()
            # A publisher with a wrong clock may send any number, which must not end the recording.
            published = taken.published_ns if 0 < taken.published_ns <= LAST_TIME else now
            # The annotation of a message says bytes, as readers give it; any buffer is written.
            self._writer.write(Message(topic, cast('bytes', taken.message), now, published, 0))
            self._received(topic)

        return write


@dataclass(frozen=True)
class Recorded:
    """What `record_topics` has recorded.

    Attributes:
        counts: the number of messages for each topic that had one.
        lost: the number of messages, by topic, that were published but did not arrive.
        left_out: a sentence for each topic and type that was published but not recorded.
        ended_by: the signal that ended the recording; None: its duration, or the end of the context.
    """

    counts: Counter[str]
    lost: Counter[str]
    left_out: Collection[str]
    ended_by: signal.Signals | None


def record_topics(
    path: Path,
    topics: TopicChoice | None = None,
    *,
    compression: Compression = 'none',
    overwrite: bool = False,
    duration_s: float | None = None,
    max_bytes: int = 0,
    max_duration_s: float = 0.0,
    min_free_bytes: int = 0,
    progress: Callable[[int, int], None] = lambda messages, topics: None,
) -> Recorded:
    """Record topics from a node of its own, until Ctrl-C or for a given time.

    Whatever ends it, the recording is complete and holds all messages before: Ctrl-C, SIGTERM, SIGHUP, a full
    disk, an error. Messages that have arrived by then, and only wait to be written, are recorded as well. The node
    uses the default context of rclpy, which must not be in use.

    Args:
        path: an MCAP file if its name ends in `.mcap`, else a rosbag2 directory.
        topics: which topics; None: every topic that is published.
        compression: of the chunks.
        overwrite: whether to replace an existing recording.
        duration_s: how long to record; None: until Ctrl-C.
        max_bytes: in a directory, begin the next file when a file has this size; 0: one file.
        max_duration_s: in a directory, begin the next file after this time; 0: one file.
        min_free_bytes: warn in the log of the node when the disk has less free space than this; 0: never.
        progress: called several times per second with the numbers of messages and of topics recorded so far.

    Raises:
        RecordingError: the path exists already, cannot be written, or the recording ended early; then the message
            says what it holds.
    """
    counts: Counter[str] = Counter()
    lost: Counter[str] = Counter()
    end = time.monotonic() + duration_s if duration_s is not None else float('inf')
    # The signals are noted, so that none interrupts a message that is being written.
    with noted_signals(signal.SIGINT, signal.SIGTERM, signal.SIGHUP) as noted:
        writer = RecordingWriter(
            path,
            compression=compression,
            overwrite=overwrite,
            keep=True,
            max_bytes=max_bytes,
            max_duration_s=max_duration_s,
            direct=True,
        )
        watch = _DiskWatch(path.absolute().parent, min_free_bytes)

        def goes_on(recorder: Recorder) -> bool:
            progress(counts.total(), len(counts))
            watch.look(recorder.get_logger().warning)
            return noted.first is None and time.monotonic() < end

        try:
            with writer, WriterBehind(writer, bundle=1) as behind:
                left_out = _record(
                    behind,
                    topics or TopicChoice(),
                    lambda topic: counts.update([topic]),
                    lambda topic, count: lost.update({topic: count}),
                    goes_on,
                )
        except SocialCircleError:
            raise
        except Exception as error:
            raise RecordingError(
                f'{path} has ended early ({type(error).__name__}: {error}). {writer.contents()} '
                'All later messages are missing.'
            ) from error
    return Recorded(counts, lost, left_out, noted.first)


def _record(
    writer: WriterBehind,
    topics: TopicChoice,
    received: Callable[[str], None],
    lost: Callable[[str, int], None],
    goes_on: Callable[[Recorder], bool],
) -> Collection[str]:
    """Record while `goes_on` says so, which is called several times per second; what was left out."""
    start_ros(signals=SignalHandlerOptions.NO)
    try:
        recorder = Recorder(writer, topics, received, lost)
        executor = SingleThreadedExecutor()
        executor.add_node(recorder)
        try:
            while goes_on(recorder):
                writer.check()
                executor.spin_once(timeout_sec=_LOOK_PERIOD_S)
            recorder.take_waiting()
        except ExternalShutdownException:
            pass
        finally:
            recorder.destroy_node()
        return recorder.left_out.values()
    finally:
        rclpy.try_shutdown()


class _DiskWatch:
    """Warns once when a disk has little free space, and again after it had more.

    Args:
        folder: on the disk.
        least: the free bytes below which to warn; 0: never.
    """

    def __init__(self, folder: Path, least: int) -> None:
        self._folder = folder
        self._least = least
        self._next = 0.0
        self._warned = False

    def look(self, warn: Callable[[str], object]) -> None:
        """Look at the disk, at most several times per second, and warn with a sentence."""
        if time.monotonic() < self._next or not self._least:
            return
        self._next = time.monotonic() + _DISK_PERIOD_S
        try:
            free = free_bytes(self._folder)
        except OSError:
            return  # a disk that has a problem shows when it is written to
        if free < self._least and not self._warned:
            warn(f'{self._folder} has only {free / 1e6:.0f} MB of free space; the recording ends when it is full.')
        self._warned = free < self._least
