"""How long the live node takes, seen from outside: from a message's publisher to the answer's subscriber.

Publisher and subscriber are this process, the node and the relay that it is compared with one each, with the
shipped DDS profile and allocator everywhere. Times are from just before the call of publish() to the callback
of a raw subscription that holds the bytes of the answer: transport both ways is in them.
"""

import statistics
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Image, PointCloud2

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.messages.header import Header, stamp_of
from socialcircle_ros.messages.image import encode_image
from socialcircle_ros.messages.point_cloud import encode_point_cloud
from socialcircle_ros.simulation import make_scene

from .process import NodeProcess

SHAPE = (960, 1280)
"""Rows and columns of frames and clouds."""

FRAMES, FRAME_RATE = 100, 50.0
CLOUD_RATE = 25.0
BESIDE_RATE = 5.0
"""Clouds a second that are filtered while frames come."""

_PATIENCE = 60.0  # s for any one answer; the very first start compiles
_FIRST = 8  # clouds of either that do not count: for some seconds the node loads what is rarely needed
_KEPT = 10  # answers that may wait for this process: what the node has given must not be lost here
_SETTLED = 0.3  # s between two trips: what follows an answer must not count for the next


@dataclass(frozen=True)
class Times:
    """Trips of the same kind, in ms."""

    milliseconds: tuple[float, ...]

    @property
    def median(self) -> float:
        """Half of the trips took less."""
        return statistics.median(self.milliseconds)

    @property
    def least(self) -> float:
        """The shortest trip: what the machine gives when nobody else works on it."""
        return min(self.milliseconds)

    @property
    def most(self) -> float:
        """The longest trip."""
        return max(self.milliseconds)


@dataclass(frozen=True)
class Endurance:
    """What became of clouds at a steady rate."""

    sent: int
    answered: int
    megabytes_before: float
    """Resident memory of the node after its first ten clouds, in units of 10^6 bytes."""
    megabytes_after: float
    cloud_megabytes: float


def time_stacks(
    folder: Path, repeats: int, shape: tuple[int, int] = SHAPE, frames: int = FRAMES, beside: float = 0.0
) -> tuple[Times, int, int]:
    """From publishing the last frame of a stack to receiving `stack/points`, stack after stack.

    A stack ends with its last frame only if none was lost.

    Args:
        folder: where the node's log goes.
        repeats: how many stacks, after a first one that does not count.
        shape: rows and columns of a frame.
        frames: of a stack.
        beside: clouds a second that are sent to be filtered meanwhile.

    Returns:
        The trips, and how many clouds were sent beside them and filtered.

    Raises:
        SocialCircleError: the node did not answer, or lost a frame.
    """
    messages = _stack(shape, frames)
    parameters = {
        'stack.frames': str(frames),
        'stack.pitch_x': '1.0e-6',
        'stack.z_step': '1.0e-6',
        'stack.timeout': '0.0',
    }
    with (
        NodeProcess('/socialcircle_bench', folder / 'node.log', parameters) as node,
        _Peer('/socialcircle_bench', Image, 'stack/image', frames, 'stack/points') as peer,
        _Peer('/socialcircle_bench', PointCloud2, 'points', 1, 'points_filtered') as clouds,
    ):
        peer.wait_for_partner(node)
        clouds.wait_for_partner(node)
        with _Beside(clouds, _cloud(shape), beside) as stream:
            trips = [_time_stack(peer, messages) for _ in range(repeats + 1)]
        # What a stack became is filtered as well.
        clouds.wait(lambda: clouds.count >= stream.sent + len(trips), 2.0)
    return Times(tuple(trips[1:])), stream.sent, clouds.count - len(trips)


def time_clouds(folder: Path, repeats: int, shape: tuple[int, int] = SHAPE) -> tuple[Times, Times]:
    """From publishing a cloud of 16 bytes a point to receiving it filtered, and to receiving it relayed.

    Both are measured in turn, each alone: the other process waits meanwhile.

    Args:
        folder: where the logs go.
        repeats: how many clouds each, after those that do not count.
        shape: rows and columns of a cloud.

    Returns:
        The node's trips and the relay's.

    Raises:
        SocialCircleError: one of them did not answer.
    """
    cloud = _cloud(shape)
    trips: dict[str, list[float]] = {'points_filtered': [], 'relayed': []}
    with (
        NodeProcess('/socialcircle_bench', folder / 'node.log') as node,
        NodeProcess(
            '/socialcircle_relay', folder / 'relay.log', module='socialcircle_ros.studies.bench.relay'
        ) as relay,
        _Peer('/socialcircle_bench', PointCloud2, 'points', 1, 'points_filtered') as to_node,
        _Peer('/socialcircle_relay', PointCloud2, 'points', 1, 'relayed') as to_relay,
    ):
        to_node.wait_for_partner(node)
        to_relay.wait_for_partner(relay)
        for _ in range(_FIRST + repeats):
            for peer in (to_node, to_relay):
                trips[peer.hears].append(peer.trip(cloud))
                time.sleep(_SETTLED)
    filtered, relayed = (Times(tuple(times[_FIRST:])) for times in trips.values())
    return filtered, relayed


def endure(folder: Path, seconds: float, shape: tuple[int, int] = SHAPE, rate: float = CLOUD_RATE) -> Endurance:
    """Send clouds at a steady rate, and count the answers and the node's memory.

    Raises:
        SocialCircleError: the node did not answer its first clouds.
    """
    scene = make_scene('metal_groove', *shape).points
    extra = {'intensity': scene[..., 2]}
    # Two in turn: an answer that is still under way must not pass for the next one.
    clouds = [encode_point_cloud(Header.at(stamp, 'bench'), scene, extra) for stamp in (1, 2)]
    with (
        NodeProcess('/socialcircle_bench', folder / 'node.log') as node,
        _Peer('/socialcircle_bench', PointCloud2, 'points', 1, 'points_filtered') as peer,
    ):
        peer.wait_for_partner(node)
        for number in range(10):
            peer.trip(clouds[number % 2])
        before, answered_before = _resident(node), peer.count
        count, begin = int(seconds * rate), time.monotonic()
        for number in range(count):
            _sleep_until(begin + number / rate)
            peer.publish(clouds[number % 2])
        peer.wait(lambda: peer.count - answered_before >= count, 2.0)
        return Endurance(count, peer.count - answered_before, before, _resident(node), len(clouds[0]) / 1e6)


class _Peer:
    """Publishes on one topic and hears one other, raw; a context manager.

    Args:
        namespace: of the node that answers.
        kind: type of what is published.
        topic: where it is published.
        depth: how many messages are kept until they are delivered.
        hears: topic of the answers, clouds.
    """

    def __init__(self, namespace: str, kind: Any, topic: str, depth: int, hears: str) -> None:
        self.hears = hears
        self.count = 0
        self._arrived, self._answer = 0.0, b''
        self._changed = threading.Condition()
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        self._node = Node('socialcircle_bench', namespace=namespace, context=self._context)
        reliable = ReliabilityPolicy.RELIABLE
        self._publisher = self._node.create_publisher(kind, topic, QoSProfile(depth=depth, reliability=reliable))
        self._node.create_subscription(
            PointCloud2, hears, self._heard, QoSProfile(depth=_KEPT, reliability=reliable), raw=True
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, name='bench')
        self._thread.start()

    def wait_for_partner(self, process: NodeProcess) -> None:
        """Wait until the other process hears what is published here, and is heard.

        Raises:
            SocialCircleError: it does not in time.
        """
        end = time.monotonic() + _PATIENCE
        while not (self._publisher.get_subscription_count() and self._node.count_publishers(self.hears)):
            if process.process.poll() is not None or time.monotonic() > end:
                raise SocialCircleError(f'The node does not listen; read {process.log}.')
            time.sleep(0.02)
        time.sleep(_SETTLED)

    def publish(self, message: bytes) -> float:
        """Publish; when that began, on the monotonic clock."""
        began = time.monotonic()
        self._publisher.publish(message)
        return began

    def trip(self, message: bytes) -> float:
        """Publish, and wait for the answer of the same stamp; ms between.

        Raises:
            SocialCircleError: there was none.
        """
        stamp, heard = stamp_of(message), self.count
        began = self.publish(message)
        if not self.wait(lambda: self.count > heard and stamp_of(self._answer) == stamp, _PATIENCE):
            raise SocialCircleError(f'No answer came on {self.hears} within {_PATIENCE:.0f} s.')
        return 1e3 * (self._arrived - began)

    def wait(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Wait for answers until a condition holds; whether it does in time."""
        with self._changed:
            return self._changed.wait_for(condition, timeout)

    def _heard(self, message: bytes) -> None:
        with self._changed:
            self._arrived, self._answer = time.monotonic(), message
            self.count += 1
            self._changed.notify_all()

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            return

    def __enter__(self) -> '_Peer':  # noqa: PYI034 - Self is not in Python 3.10
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        rclpy.shutdown(context=self._context)
        self._thread.join()
        self._node.destroy_node()


class _Beside:
    """Sends a cloud again and again on a thread of its own, while the `with` block lasts; not at all at rate 0."""

    def __init__(self, peer: _Peer, cloud: bytes, rate: float) -> None:
        self.sent = 0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._send, args=(peer, cloud, rate), name='clouds')

    def _send(self, peer: _Peer, cloud: bytes, rate: float) -> None:
        while rate and not self._ended.wait(1 / rate):
            peer.publish(cloud)
            self.sent += 1

    def __enter__(self) -> '_Beside':  # noqa: PYI034 - Self is not in Python 3.10
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()
        self._thread.join()


def _time_stack(peer: _Peer, messages: list[bytes]) -> float:
    begin = time.monotonic() + _SETTLED
    for number, message in enumerate(messages[:-1]):
        _sleep_until(begin + number / FRAME_RATE)
        peer.publish(message)
    _sleep_until(begin + (len(messages) - 1) / FRAME_RATE)
    return peer.trip(messages[-1])


def _stack(shape: tuple[int, int], frames: int) -> list[bytes]:
    """A tilted, textured plane with camera noise, in focus from a quarter to three quarters of the scan."""
    rng = np.random.default_rng(0)
    rows, columns = np.mgrid[: shape[0], : shape[1]].astype(np.float32)
    focus = frames * (0.25 + 0.25 * (rows / shape[0] + columns / shape[1]))
    texture = rng.normal(0, 40, shape).astype(np.float32)
    noise = rng.normal(0, 1.5, shape).astype(np.float32)
    messages = []
    for number in range(frames):
        sharpness = np.exp(-(((number - focus) / 3) ** 2))
        pixels = 110 + texture * sharpness + np.roll(noise, 7919 * number)
        header = Header.at(round((number + 1) * 1e9 / FRAME_RATE), 'camera')
        messages.append(encode_image(header, np.clip(pixels, 0, 255).astype(np.uint8)))
    return messages


def _cloud(shape: tuple[int, int]) -> bytes:
    xyz = make_scene('metal_groove', *shape).points
    return encode_point_cloud(Header.at(1, 'bench'), xyz, {'intensity': xyz[..., 2]})


def _sleep_until(moment: float) -> None:
    time.sleep(max(0.0, moment - time.monotonic()))


def _resident(process: NodeProcess) -> float:
    """Resident memory of a process in 10^6 bytes."""
    status = Path(f'/proc/{process.process.pid}/status').read_text(encoding='utf-8')
    line = next(line for line in status.splitlines() if line.startswith('VmRSS:'))
    return int(line.split()[1]) * 1024 / 1e6
