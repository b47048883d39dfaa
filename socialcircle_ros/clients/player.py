# SPDX-License-Identifier: Apache-2.0
"""The player: publishes the messages of a recording, byte for byte, with their recorded timing."""

import math
import signal
import time
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import rclpy
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rosgraph_msgs.msg import Clock

from socialcircle_ros.arguments import OneOrSeveral, several
from socialcircle_ros.errors import RecordingError
from socialcircle_ros.node.start import start_ros
from socialcircle_ros.recording import Message, RecordingReader, Topic, open_recording
from socialcircle_ros.storage import noted_signals

from .message_types import message_class
from .pace import Pace
from .qos import replay_qos
from .replay_names import cells_of, names_in_namespace

if TYPE_CHECKING:
    from rclpy.publisher import Publisher

_LONGEST_SLEEP_S = 0.05  # then the player looks at the graph and at Ctrl-C again
_SETTLED_S = 2.0  # some topics never get a subscriber, such as truth masks and earlier results
_DELIVERY_S = 5.0


class Player(Node):
    """Publishes the messages of a recording with their recorded timing.

    Args:
        topics: the topics to publish.
        played_as: the name under which a recorded topic is played.
        context: the ROS context; None: the default one.
        goes_on: asked several times per second; what waits or plays ends where it says no.

    Attributes:
        skipped: one sentence for each topic that cannot be published, because its type is not installed.
    """

    def __init__(
        self,
        topics: Iterable[Topic],
        played_as: Callable[[str], str] = str,
        context: Context | None = None,
        goes_on: Callable[[], bool] = lambda: True,
    ) -> None:
        super().__init__('socialcircle_play', context=context)
        self._goes_on = goes_on
        self.skipped: list[str] = []
        # rclpy's Node already has an attribute `_publishers`.
        self._topic_publishers: dict[str, Publisher] = {}
        for topic in topics:
            try:
                message_type = message_class(topic.type)
            except RecordingError as error:
                self.skipped.append(f'{topic.name}: {error}')
                continue
            self._topic_publishers[topic.name] = self.create_publisher(
                message_type, played_as(topic.name), replay_qos(topic.qos)
            )
        self._clock_publisher: Publisher | None = None

    def wait_for_listeners(
        self, topics: Collection[str], timeout_s: float, settled_s: float = math.inf
    ) -> list[str]:
        """Wait until each topic has a compatible subscriber.

        Args:
            topics: names as recorded.
            timeout_s: longest wait.
            settled_s: longest wait for another subscriber, as soon as one topic has a subscriber.

        Returns:
            The topics that still have no subscriber.
        """
        publishers = {name: self._topic_publishers[name] for name in topics if name in self._topic_publishers}
        changed_at = time.monotonic()
        deadline, before = changed_at + timeout_s, list(publishers)
        while self._may_go_on():
            missing = [name for name, publisher in publishers.items() if publisher.get_subscription_count() == 0]
            now = time.monotonic()
            if missing != before:
                before, changed_at = missing, now
            settled = len(missing) < len(publishers) and now - changed_at > settled_s
            if not missing or now > deadline or settled:
                return missing
            time.sleep(_LONGEST_SLEEP_S)
        return []

    def play(
        self,
        messages: Iterable[Message],
        *,
        pace: Pace | None = None,
        clock_hz: float = 0.0,
        published: Callable[[Message], None] = lambda message: None,
    ) -> None:
        """Publish messages until they end or the context is shut down.

        Args:
            messages: in the order of their log times. Messages of topics without a publisher are skipped.
            pace: how fast recorded time passes; None: as recorded.
            clock_hz: how often per second to publish recorded time on /clock, for nodes with use_sim_time;
                0: never.
            published: called after each message.
        """
        pace, started = pace or Pace(), False
        for message in messages:
            publisher = self._topic_publishers.get(message.topic)
            if publisher is None:
                continue
            if not started:
                pace.start(message.log_time)
                started = True
            if not self._wait_for_moment(message.log_time, pace, clock_hz):
                return
            publisher.publish(bytes(message.data))
            published(message)

    def wait_until_delivered(self, timeout_s: float) -> bool:
        """Wait until reliable subscribers have acknowledged every message.

        Returns:
            Whether they did within `timeout_s` for each topic.
        """
        timeout = Duration(seconds=timeout_s)
        return all(publisher.wait_for_all_acked(timeout) for publisher in self._topic_publishers.values())

    def _wait_for_moment(self, log_time: int, pace: Pace, clock_hz: float) -> bool:
        """Sleep until a message is due, and publish recorded time meanwhile.

        Returns:
            Whether the player may go on.
        """
        while self._may_go_on():
            if pace.is_due(log_time):
                if clock_hz:
                    self._publish_clock(log_time)
                return True
            pause_s = min(pace.seconds_until(log_time), _LONGEST_SLEEP_S)
            if clock_hz:
                self._publish_clock(min(pace.now_ns(), log_time))
                pause_s = min(pause_s, 1 / clock_hz)
            time.sleep(pause_s)
        return False

    def _may_go_on(self) -> bool:
        return self._goes_on() and rclpy.ok(context=self.context)

    def _publish_clock(self, now: int) -> None:
        if self._clock_publisher is None:
            self._clock_publisher = self.create_publisher(Clock, '/clock', 10)
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(now, 1_000_000_000)
        self._clock_publisher.publish(message)


@dataclass(frozen=True)
class Replay:
    """What was played.

    Attributes:
        messages: the number of messages that were published.
        damage: one sentence if the recording is damaged.
        ended_by: the signal that ended the replay; None: its end, or the end of the context.
    """

    messages: int
    damage: str | None
    ended_by: signal.Signals | None


def play_recording(
    recording: Path,
    topics: OneOrSeveral[str] = (),
    *,
    namespace: str | None = None,
    prefix: str = '',
    pace: Pace | None = None,
    loop: bool = False,
    start_offset_s: float = 0.0,
    clock_hz: float = 0.0,
    wait_s: float = 10.0,
    tell: Callable[[str], None] = lambda sentence: None,
    progress: Callable[[int, int], None] = lambda played, total: None,
) -> Replay:
    """Publish a recording from a node of its own, until it ends or until Ctrl-C, SIGTERM or SIGHUP.

    The node uses the default context of rclpy, which must not be in use.

    Args:
        recording: an MCAP file or a rosbag2 directory.
        topics: the topics to play; none: all.
        namespace: where to play the topics of one cell; see `names_in_namespace`. '': the root, None: as recorded.
        prefix: put before the name of each topic; only without `namespace`.
        pace: how fast recorded time passes; None: as recorded.
        loop: whether to start again at the end.
        start_offset_s: leave out the messages of the first seconds.
        clock_hz: how often per second to publish recorded time on /clock; 0: never.
        wait_s: longest wait for the first subscriber.
        tell: called with a sentence for what is not played, and for what has no subscriber.
        progress: called after each message with the number of messages played in this round and the number of
            messages in the recording.

    Raises:
        RecordingError: the recording cannot be read, has no such topic, or no message after the first seconds.
    """
    # The signals are noted, so that none interrupts rclpy.
    with (
        open_recording(recording) as reader,
        noted_signals(signal.SIGINT, signal.SIGTERM, signal.SIGHUP) as noted,
    ):
        chosen = _chosen_topics(reader, several(topics))
        names = [topic.name for topic in chosen]
        if namespace is None:
            played = {name: prefix + name for name in names}
        else:
            played = names_in_namespace(names, namespace)
        since = _start(reader, names, start_offset_s)
        start_ros(signals=SignalHandlerOptions.NO)
        player = Player(chosen, played.__getitem__, goes_on=lambda: noted.first is None)
        try:
            if namespace and len(cells_of(names)) > 1:
                tell(f'Several cells were recorded, so {namespace} is put before the names of all topics.')
            for reason in player.skipped:
                tell(f'Not played: {reason}')
            for name, topic in reader.topics.items():
                if name != topic.name:
                    tell(f'Not played: {topic.name} with its second type {topic.type}.')
            missing = player.wait_for_listeners(names, wait_s, _SETTLED_S)
            if missing:
                listed = ', '.join(played[name] for name in missing)
                tell(f'No node subscribes to {listed}; playing anyway.')
            total = 0
            while True:
                count = _play_once(player, reader, names, since, pace or Pace(), clock_hz, progress)
                total += count
                if not loop or count == 0 or noted.first is not None or not rclpy.ok():
                    break
            if noted.first is None and rclpy.ok():
                player.wait_until_delivered(_DELIVERY_S)
            return Replay(total, reader.damage, noted.first)
        finally:
            player.destroy_node()
            rclpy.try_shutdown()


def _chosen_topics(reader: RecordingReader, topics: Collection[str]) -> list[Topic]:
    for name in topics:
        if name not in reader.topics:
            raise reader.refusal(f'{reader.path} has no topic {name}; it has: {", ".join(sorted(reader.topics))}.')
    # One publisher for each topic: messages of a second type on a topic are left out.
    return [
        topic for name, topic in reader.topics.items() if name == topic.name and (not topics or name in topics)
    ]


def _start(reader: RecordingReader, names: Collection[str], offset_s: float) -> int:
    """The log time from which to play.

    Raises:
        RecordingError: no message is as late.
    """
    if not offset_s:
        return 0
    since = next((message.log_time for message in reader.messages()), 0) + round(offset_s * 1e9)
    if next(iter(reader.messages(names, since)), None) is None:
        raise reader.refusal(
            f'{reader.path} has no message to play after the first {offset_s:g} s: leave out fewer seconds.'
        )
    return since


def _play_once(
    player: Player,
    reader: RecordingReader,
    names: Collection[str],
    since: int,
    pace: Pace,
    clock_hz: float,
    progress: Callable[[int, int], None],
) -> int:
    """Play the recording once; the number of messages that were published."""
    played = 0

    def published(_: Message) -> None:
        nonlocal played
        played += 1
        progress(played, reader.message_count)

    player.play(reader.messages(names, since), pace=pace, clock_hz=clock_hz, published=published)
    return played
