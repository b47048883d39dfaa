# SPDX-License-Identifier: Apache-2.0
"""Latency of the live node, seen from outside: from a publisher through the node to a subscriber.

Publisher and subscriber are in this process. The node and the bare relay, with which it is compared, are processes
of their own. All use the shipped DDS profile and allocator.
"""

import statistics
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from socialcircle_ros import interface
from socialcircle_ros.clients.process import NodeProcess
from socialcircle_ros.interface import NodeTopic
from socialcircle_ros.messages import point_cloud
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.image import encode_image
from socialcircle_ros.messages.point_cloud import encode_point_cloud
from socialcircle_ros.simulation import make_scene

from .relay import RELAYED

if TYPE_CHECKING:
    from socialcircle_ros.clients.round_trip import RoundTrip

SHAPE = (960, 1280)
"""Rows and columns of frames and clouds."""

FRAMES, FRAME_RATE = 100, 50.0
"""Frames of a stack, and frames per second."""

CLOUD_RATE = 25.0
"""Clouds per second in the endurance test."""

SIDE_RATE = 5.0
"""Clouds per second that are filtered while the frames of stacks come."""

_NODE, _RELAY = '/socialcircle_bench', '/socialcircle_relay'
_EXACT = {'circle.mode': 'paper'}
_RELAY_MODULE = 'socialcircle_ros.studies.bench.relay'
_RELAYED = NodeTopic(RELAYED, point_cloud.TYPE, 'out', 1, 'per cloud', 'The cloud, byte for byte.')
_WARM_UP_CLOUDS = 8
_WARM_UP_ENDURANCE = 10
_PAUSE_S = 0.3  # between two trips: work that follows an answer must not count for the next trip
_LAST_ANSWERS_S = 2.0


@dataclass(frozen=True)
class Times:
    """Durations of round trips of the same kind, in ms."""

    milliseconds: tuple[float, ...]

    @property
    def median(self) -> float:
        """The median, in ms."""
        return statistics.median(self.milliseconds)

    @property
    def least(self) -> float:
        """The shortest trip, in ms; it depends least on other work on the machine."""
        return min(self.milliseconds)

    @property
    def most(self) -> float:
        """The longest trip, in ms."""
        return max(self.milliseconds)


@dataclass(frozen=True)
class Endurance:
    """What became of clouds at a steady rate.

    Attributes:
        sent: clouds that were published.
        answered: clouds that came back filtered.
        before: memory of the node after the warm-up.
        after: memory of the node after the last cloud.
        cloud_megabytes: size of one message, in 10^6 bytes.
    """

    sent: int
    answered: int
    before: 'ProcessMemory'
    after: 'ProcessMemory'
    cloud_megabytes: float


@dataclass(frozen=True)
class ProcessMemory:
    """Resident memory of a process, in 10^6 bytes.

    Attributes:
        whole: with all of what it shares with other processes.
        proportional: with its part of that: a page that three processes use counts as a third for each.
    """

    whole: float
    proportional: float


def time_stacks(
    folder: Path, repeats: int, shape: tuple[int, int] = SHAPE, frames: int = FRAMES, side_rate: float = 0.0
) -> tuple[Times, int, int]:
    """Time stacks: from publishing the last frame to receiving the cloud of the stack.

    A stack ends with its last frame only if no frame was lost.

    Args:
        folder: where the log of the node goes.
        repeats: the number of stacks, after one that does not count.
        shape: rows and columns of a frame.
        frames: of a stack.
        side_rate: clouds per second that are published to be filtered at the same time; 0: none.

    Returns:
        The times, the number of clouds published at the same time, and the number of these that were filtered.

    Raises:
        SocialCircleError: the node did not answer, or lost a frame.
    """
    messages = _stack(shape, frames)
    (cloud,) = _clouds(shape, 1)
    parameters = {
        'stack.frames': str(frames),
        'stack.pitch_x': '1.0e-6',
        'stack.z_step': '1.0e-6',
        'stack.timeout': '0.0',
        **_EXACT,
    }
    with (
        NodeProcess(_NODE, folder / 'node.log', parameters) as node,
        _round_trip(_NODE, interface.STACK_FRAMES, frames, interface.STACK_POINTS) as stacks,
        _round_trip(_NODE, interface.POINTS, 1, interface.FILTERED) as clouds,
    ):
        stacks.wait_for_node(node)
        clouds.wait_for_node(node)
        with _CloudStream(clouds, cloud, side_rate) as stream:
            trips = [_time_stack(stacks, messages) for _ in range(repeats + 1)]
        # The node filters the clouds of the stacks, too.
        clouds.wait(lambda: clouds.received >= stream.sent + len(trips), _LAST_ANSWERS_S)
    return Times(tuple(trips[1:])), stream.sent, clouds.received - len(trips)


def time_clouds(folder: Path, repeats: int, shape: tuple[int, int] = SHAPE) -> tuple[Times, Times]:
    """Time clouds of 16 bytes per point through the node, and through a bare relay.

    The two take turns: the other process is idle meanwhile.

    Args:
        folder: where the logs go.
        repeats: the number of clouds for each, after those of the warm-up.
        shape: rows and columns of a cloud.

    Returns:
        The times of the node and of the relay.

    Raises:
        SocialCircleError: one of them did not answer.
    """
    (cloud,) = _clouds(shape, 1)
    filtered: list[float] = []
    relayed: list[float] = []
    with (
        NodeProcess(_NODE, folder / 'node.log', _EXACT) as node,
        NodeProcess(_RELAY, folder / 'relay.log', module=_RELAY_MODULE) as relay,
        _round_trip(_NODE, interface.POINTS, 1, interface.FILTERED) as through_node,
        _round_trip(_RELAY, interface.POINTS, 1, _RELAYED) as through_relay,
    ):
        through_node.wait_for_node(node)
        through_relay.wait_for_node(relay)
        for _ in range(_WARM_UP_CLOUDS + repeats):
            for trip, times in ((through_node, filtered), (through_relay, relayed)):
                times.append(trip.trip_ms(cloud))
                time.sleep(_PAUSE_S)
    return Times(tuple(filtered[_WARM_UP_CLOUDS:])), Times(tuple(relayed[_WARM_UP_CLOUDS:]))


def time_starts(folder: Path, starts: int, shape: tuple[int, int] = SHAPE) -> tuple[Times, Times]:
    """Time the first and the tenth cloud of a node that has just started.

    Publisher and subscriber have exchanged clouds through the relay before, so that the node alone is new.

    Args:
        folder: where the logs go.
        starts: the number of nodes, one after another.
        shape: rows and columns of a cloud.

    Returns:
        The times of the first and of the tenth clouds.

    Raises:
        SocialCircleError: a node or the relay did not answer.
    """
    clouds = _clouds(shape, 2)
    answers = ['-r', f'{RELAYED}:={interface.FILTERED.name}']
    first, tenth = [], []
    with _round_trip(_NODE, interface.POINTS, 1, interface.FILTERED) as trip:
        with NodeProcess(_NODE, folder / 'relay.log', arguments=answers, module=_RELAY_MODULE) as relay:
            trip.wait_for_node(relay)
            _trips(trip, clouds)
        for _ in range(starts):
            with NodeProcess(_NODE, folder / 'node.log', _EXACT) as node:
                trip.wait_for_node(node)
                times = _trips(trip, clouds)
            first.append(times[0])
            tenth.append(times[-1])
    return Times(tuple(first)), Times(tuple(tenth))


def _trips(trip: 'RoundTrip', clouds: list[bytes]) -> list[float]:
    """Times of ten clouds, in ms, one after another: two take turns."""
    times = []
    for number in range(10):
        times.append(trip.trip_ms(clouds[number % 2]))
        time.sleep(_PAUSE_S)
    return times


def endure(folder: Path, seconds: float, shape: tuple[int, int] = SHAPE, rate: float = CLOUD_RATE) -> Endurance:
    """Publish clouds at a steady rate, and count the answers and the memory of the node.

    Args:
        folder: where the log of the node goes.
        seconds: how long clouds are published.
        shape: rows and columns of a cloud.
        rate: clouds per second.

    Raises:
        SocialCircleError: the node did not answer the clouds of the warm-up.
    """
    # Two clouds take turns, so that a late answer does not count as that of the next cloud.
    clouds = _clouds(shape, 2)
    with (
        NodeProcess(_NODE, folder / 'node.log', _EXACT) as node,
        _round_trip(_NODE, interface.POINTS, 1, interface.FILTERED) as trip,
    ):
        trip.wait_for_node(node)
        for number in range(_WARM_UP_ENDURANCE):
            trip.trip_ms(clouds[number % 2])
        before, received_before = _memory(node), trip.received
        count, begin = int(seconds * rate), time.monotonic()
        for number in range(count):
            _sleep_until(begin + number / rate)
            trip.publish(clouds[number % 2])
        trip.wait(lambda: trip.received - received_before >= count, _LAST_ANSWERS_S)
        return Endurance(
            sent=count,
            answered=trip.received - received_before,
            before=before,
            after=_memory(node),
            cloud_megabytes=len(clouds[0]) / 1e6,
        )


class _CloudStream:
    """Publishes a cloud at a steady rate on a thread while the `with` block lasts; rate 0: not at all."""

    def __init__(self, trip: 'RoundTrip', cloud: bytes, rate: float) -> None:
        self.sent = 0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._publish, args=(trip, cloud, rate), name='clouds')

    def _publish(self, trip: 'RoundTrip', cloud: bytes, rate: float) -> None:
        while rate and not self._ended.wait(1 / rate):
            trip.publish(cloud)
            self.sent += 1

    def __enter__(self) -> '_CloudStream':  # noqa: PYI034 - Self is not in Python 3.10
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()


def _round_trip(namespace: str, sends: NodeTopic, depth: int, hears: NodeTopic) -> 'RoundTrip':
    from socialcircle_ros.clients.round_trip import RoundTrip  # noqa: PLC0415 - needs ROS

    return RoundTrip(namespace, sends, depth, hears)


def _time_stack(trip: 'RoundTrip', messages: list[bytes]) -> float:
    """Publish the frames of a stack at the frame rate; ms from the last one to the cloud of the stack."""
    begin = time.monotonic() + _PAUSE_S
    for number, message in enumerate(messages[:-1]):
        _sleep_until(begin + number / FRAME_RATE)
        trip.publish(message)
    _sleep_until(begin + (len(messages) - 1) / FRAME_RATE)
    return trip.trip_ms(messages[-1])


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


def _clouds(shape: tuple[int, int], count: int) -> list[bytes]:
    """The same cloud with stamps from 1 ns on, serialized: x, y, z and intensity, float32, 16 bytes per point."""
    xyz = make_scene('metal_groove', *shape).points
    return [
        encode_point_cloud(Header.at(stamp, 'bench'), xyz, {'intensity': xyz[..., 2]})
        for stamp in range(1, count + 1)
    ]


def _sleep_until(moment: float) -> None:
    time.sleep(max(0.0, moment - time.monotonic()))


def _memory(node: NodeProcess) -> ProcessMemory:
    lines = Path(f'/proc/{node.process.pid}/smaps_rollup').read_text(encoding='utf-8').splitlines()
    kilobytes = {line.split(':')[0]: int(line.split()[1]) for line in lines if line.endswith('kB')}
    return ProcessMemory(*(1024 * kilobytes[name] / 1e6 for name in ('Rss', 'Pss')))
