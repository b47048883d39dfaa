"""Playing a recording into the graph, and recording from it; on rclpy.

Messages stay serialized both ways: what was recorded is what is published, byte for byte.
"""

import importlib
import math
import time
from collections.abc import Callable, Collection, Iterable
from typing import Any

import rclpy
import yaml
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
)
from rosgraph_msgs.msg import Clock

from socialcircle_ros.errors import RecordingError
from socialcircle_ros.recording import Message, RecordingWriter, Topic, ros_topic

CLOCK_PERIOD = 25_000_000  # ns of recorded time between two messages on /clock
_LONGEST_WAIT = 0.05  # s: how long a replay sleeps at most before it looks at the graph and at Ctrl-C again


def message_class(type_name: str) -> Any:
    """The Python class of a message type.

    Raises:
        RecordingError: its package is not installed.
    """
    package, _, name = type_name.replace('/msg/', '/').partition('/')
    try:
        return getattr(importlib.import_module(f'{package}.msg'), name)
    except (ImportError, AttributeError, ValueError):
        raise RecordingError(
            f'Type {type_name!r} is not installed here; install its package, or leave its topic out.'
        ) from None


class Player(Node):
    """Publishes the messages of a recording with their recorded timing.

    Args:
        topics: what the recording holds.
        remap: put before each topic's name, such as `/demo`; empty: as recorded.
    """

    def __init__(self, topics: Iterable[Topic], remap: str = '', **options: Any) -> None:
        super().__init__('socialcircle_play', **options)
        self.skipped: list[str] = []
        self._players: dict[str, Any] = {}
        for topic in topics:
            try:
                kind = message_class(topic.type)
            except RecordingError as error:
                self.skipped.append(f'{topic.name}: {error}')
                continue
            qos = recorded_qos(topic.qos)
            self._players[topic.name] = self.create_publisher(kind, remap + topic.name, qos)
        self._ticks: Any = None

    def wait_for_listeners(self, topics: Collection[str], timeout: float, settled: float = math.inf) -> list[str]:
        """Wait until each of `topics` has a subscriber that can hear it; the ones that have none by then.

        Args:
            topics: names as recorded.
            timeout: s to wait at most.
            settled: s to wait for the others once somebody listens, and nobody new comes.
        """
        players = {name: self._players[name] for name in topics if name in self._players}
        since = time.monotonic()
        end, before = since + timeout, list(players)
        while rclpy.ok(context=self.context):
            lonely = [name for name, player in players.items() if player.get_subscription_count() == 0]
            now = time.monotonic()
            if lonely != before:
                before, since = lonely, now
            if not lonely or now > end or (len(lonely) < len(players) and now - since > settled):
                return lonely
            time.sleep(_LONGEST_WAIT)
        return []

    def play(
        self,
        messages: Iterable[Message],
        *,
        rate: float = 1.0,
        clock: bool = False,
        published: Callable[[Message], None] = lambda message: None,
    ) -> None:
        """Publish `messages`, which come in the order of their times.

        Args:
            messages: of the topics given at the start; others are passed over.
            rate: 2 plays twice as fast as recorded.
            clock: whether to publish recorded time on /clock, for nodes with use_sim_time.
            published: called after each message.
        """
        if clock and self._ticks is None:
            self._ticks = self.create_publisher(Clock, '/clock', 10)
        began = first = now = None
        for message in messages:
            if message.topic not in self._players:
                continue
            if began is None or first is None or now is None:
                began, first, now = time.monotonic(), message.log_time, message.log_time
            while rclpy.ok(context=self.context):
                now = min(first + int((time.monotonic() - began) * rate * 1e9), message.log_time)
                if clock:
                    self._tick(now)
                if now >= message.log_time:
                    break
                pause = min((message.log_time - now) / rate / 1e9, _LONGEST_WAIT)
                time.sleep(min(pause, CLOCK_PERIOD / 1e9 / rate) if clock else pause)
            if not rclpy.ok(context=self.context):
                return
            self._players[message.topic].publish(bytes(message.data))
            published(message)

    def wait_until_delivered(self, timeout: float) -> bool:
        """Wait until reliable subscribers have acknowledged everything; whether they did in time."""
        end = rclpy.duration.Duration(seconds=timeout)
        return all(publisher.wait_for_all_acked(end) for publisher in self._players.values())

    def _tick(self, now: int) -> None:
        seconds, nanoseconds = divmod(now, 1_000_000_000)
        tick = Clock()
        tick.clock.sec, tick.clock.nanosec = seconds, nanoseconds
        self._ticks.publish(tick)


class Recorder(Node):
    """Subscribes to topics as they appear, and writes what they send.

    Args:
        writer: where to.
        topics: names, or none for every topic that is published.
        received: called after each message that was written.
    """

    def __init__(
        self,
        writer: RecordingWriter,
        topics: Collection[str],
        received: Callable[[Message], None] = lambda message: None,
        **options: Any,
    ) -> None:
        super().__init__('socialcircle_record', **options)
        self.refused: dict[str, str] = {}
        self._writer = writer
        self._wanted = {self.resolve_topic_name(name) for name in topics}
        self._received = received
        self._heard: dict[str, Any] = {}
        self.look_for_topics()
        self.create_timer(0.2, self.look_for_topics)

    @property
    def heard(self) -> Collection[str]:
        """The topics that are being recorded."""
        return self._heard.keys()

    def look_for_topics(self) -> None:
        """Subscribe to the wanted topics that have appeared since."""
        for name, types in self.get_topic_names_and_types():
            wanted = name in self._wanted if self._wanted else not name.endswith(('/_action/status',))
            if not wanted or name in self._heard or name in self.refused:
                continue
            publishers = self.get_publishers_info_by_topic(name)
            if not publishers:
                continue
            try:
                kind = message_class(types[0])
                self._writer.add_topic(ros_topic(name, types[0], _qos_text(publishers)))
            except RecordingError as error:
                self.refused[name] = str(error)
                self.get_logger().warning(f'{name} is not recorded: {error}')
                continue
            self._heard[name] = self.create_subscription(
                kind, name, self._writing(name), _hearing(publishers), raw=True
            )

    def _writing(self, topic: str) -> Callable[[bytes, dict[str, Any]], None]:
        def write(data: bytes, info: dict[str, Any]) -> None:
            now = time.time_ns()
            message = Message(topic, data, now, info.get('source_timestamp') or now, 0)
            self._writer.write(*message)
            self._received(message)

        return write


def recorded_qos(text: str) -> QoSProfile:
    """The QoS with which a recorded topic is played: what it offered, but for times and unknown depths.

    Args:
        text: `offered_qos_profiles` as rosbag2 writes it; empty or odd: reliable, keep last 10.
    """
    try:
        offered = yaml.safe_load(text)[0]
        reliability = ReliabilityPolicy[_word(offered['reliability'], ReliabilityPolicy)]
        durability = DurabilityPolicy[_word(offered['durability'], DurabilityPolicy)]
        history = HistoryPolicy[_word(offered['history'], HistoryPolicy)]
        depth = int(offered['depth'])
    except (KeyError, IndexError, TypeError, ValueError, yaml.YAMLError):
        return QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
    if history != HistoryPolicy.KEEP_ALL:
        history = HistoryPolicy.KEEP_LAST
    return QoSProfile(history=history, depth=max(depth, 1), reliability=reliability, durability=durability)


def _word(value: Any, policy: Any) -> str:
    """A policy's name; older recordings hold its number. What leaves the choice open is reliable, volatile."""
    name = policy(value).name if isinstance(value, int) else str(value).upper()
    if name in ('SYSTEM_DEFAULT', 'UNKNOWN', 'BEST_AVAILABLE'):
        name = {ReliabilityPolicy: 'RELIABLE', DurabilityPolicy: 'VOLATILE', HistoryPolicy: 'KEEP_LAST'}[policy]
    return name


def _hearing(publishers: list[Any]) -> QoSProfile:
    """The strictest QoS that hears all of `publishers`."""
    profiles = [publisher.qos_profile for publisher in publishers]
    reliable = all(profile.reliability == ReliabilityPolicy.RELIABLE for profile in profiles)
    latched = all(profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for profile in profiles)
    return QoSProfile(
        depth=100,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def _qos_text(publishers: list[Any]) -> str:
    """What the publishers offer, as the YAML of rosbag2."""
    return yaml.safe_dump([_offered(publisher.qos_profile) for publisher in publishers], sort_keys=False)


def _offered(profile: QoSProfile) -> dict[str, Any]:
    def duration(value: Any) -> dict[str, int]:
        seconds, nanoseconds = divmod(value.nanoseconds, 1_000_000_000)
        return {'sec': seconds, 'nsec': nanoseconds}

    # The graph does not tell history and depth; rosbag2 writes the same.
    history = profile.history
    known = history in (HistoryPolicy.KEEP_LAST, HistoryPolicy.KEEP_ALL)
    liveliness = profile.liveliness
    return {
        'history': history.name.lower() if known else 'unknown',
        'depth': profile.depth,
        'reliability': profile.reliability.name.lower(),
        'durability': profile.durability.name.lower(),
        'deadline': duration(profile.deadline),
        'lifespan': duration(profile.lifespan),
        'liveliness': liveliness.name.lower() if isinstance(liveliness, LivelinessPolicy) else 'automatic',
        'liveliness_lease_duration': duration(profile.liveliness_lease_duration),
        'avoid_ros_namespace_conventions': profile.avoid_ros_namespace_conventions,
    }
