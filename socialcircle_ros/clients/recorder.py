"""The recorder: writes the messages of topics to a recording, byte for byte."""

import time
from collections import Counter
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TypedDict

import rclpy
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

from socialcircle_ros.errors import RecordingError
from socialcircle_ros.recording import Message, RecordingWriter, ros_topic
from socialcircle_ros.recording.mcap_output import Compression

from .message_types import message_class
from .qos import recorded_text, recording_qos

_LOOK_PERIOD_S = 0.2  # between two looks at the graph for new topics
_NOT_RECORDED = '/_action/status'


class _MessageInfo(TypedDict, total=False):
    """What rclpy tells of a message; the middleware may leave the source's time out."""

    source_timestamp: int


class Recorder(Node):
    """Subscribes to topics as they appear, and writes their messages.

    Args:
        writer: where to write.
        topics: names of topics; none: every topic that is published.
        received: called after each message that was written.
        context: the ROS context; None: the default one.

    Attributes:
        refused: topics that cannot be recorded, with the reason.
    """

    def __init__(
        self,
        writer: RecordingWriter,
        topics: Collection[str],
        received: Callable[[Message], None] = lambda message: None,
        context: Context | None = None,
    ) -> None:
        super().__init__('socialcircle_record', context=context)
        self.refused: dict[str, str] = {}
        self._writer = writer
        self._wanted = {self.resolve_topic_name(name) for name in topics}
        self._received = received
        self._recorded: set[str] = set()
        self.subscribe_to_new_topics()
        self.create_timer(_LOOK_PERIOD_S, self.subscribe_to_new_topics)

    def subscribe_to_new_topics(self) -> None:
        """Subscribe to the wanted topics that have appeared since the last call."""
        for name, types in self.get_topic_names_and_types():
            if self._is_wanted(name) and name not in self._recorded and name not in self.refused:
                self._subscribe(name, types[0])

    def _is_wanted(self, name: str) -> bool:
        return name in self._wanted if self._wanted else not name.endswith(_NOT_RECORDED)

    def _subscribe(self, name: str, type_name: str) -> None:
        publishers = self.get_publishers_info_by_topic(name)
        if not publishers:
            return
        try:
            message_type = message_class(type_name)
            self._writer.add_topic(ros_topic(name, type_name, recorded_text(publishers)))
        except RecordingError as error:
            self.refused[name] = str(error)
            self.get_logger().warning(f'{name} is not recorded: {error}')
            return
        self.create_subscription(message_type, name, self._write_to(name), recording_qos(publishers), raw=True)
        self._recorded.add(name)

    def _write_to(self, topic: str) -> Callable[[bytes, _MessageInfo], None]:
        """The callback that writes the messages of a topic."""

        def write(data: bytes, info: _MessageInfo) -> None:
            now = time.time_ns()
            message = Message(topic, data, now, info.get('source_timestamp') or now, 0)
            self._writer.write(*message)
            self._received(message)

        return write


def record_topics(
    path: Path,
    topics: Collection[str] = (),
    *,
    compression: Compression = 'none',
    overwrite: bool = False,
    duration_s: float | None = None,
    progress: Callable[[int, int], None] = lambda messages, topics: None,
) -> Counter[str]:
    """Record topics from a node of its own, until Ctrl-C or for a given time.

    The node uses the default context of rclpy, which must not be in use.

    Args:
        path: an MCAP file if its name ends in `.mcap`, else a rosbag2 directory.
        topics: names of topics; none: every topic that is published.
        compression: of the chunks.
        overwrite: whether to replace an existing recording.
        duration_s: how long to record; None: until Ctrl-C.
        progress: called some times per second with the numbers of messages and of topics recorded so far.

    Returns:
        The number of messages for each topic that had one.

    Raises:
        RecordingError: the path exists already, or cannot be written.
    """
    counts: Counter[str] = Counter()
    with RecordingWriter(path, compression=compression, overwrite=overwrite) as writer:
        rclpy.init()
        recorder = Recorder(writer, topics, lambda message: counts.update([message.topic]))
        executor = SingleThreadedExecutor()
        executor.add_node(recorder)
        end = time.monotonic() + duration_s if duration_s is not None else float('inf')
        try:
            while time.monotonic() < end:
                executor.spin_once(timeout_sec=_LOOK_PERIOD_S)
                progress(counts.total(), len(counts))
        except (KeyboardInterrupt, ExternalShutdownException):
            pass
        finally:
            recorder.destroy_node()
            rclpy.try_shutdown()
    return counts
