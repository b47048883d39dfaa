# SPDX-License-Identifier: Apache-2.0
"""The programs on the two hosts of the network benchmark: `publish` and `subscribe`.

Both print one line per cloud: its number, and a time in s of the monotonic clock, which the processes of a machine
share. The publisher's time is that before the call of publish().
"""

import argparse
import contextlib
import sys
import threading
import time

import numpy as np

from socialcircle_ros.interface import POINTS
from socialcircle_ros.kernels.memory import keep_freed_memory
from socialcircle_ros.messages.cdr import CdrReader
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.point_cloud import encode_point_cloud

from .relay import RELAYED

LOST = 'lost'
"""First word of the subscriber's lines that give the number of clouds that the middleware reports as lost."""

NO_PARTNER = 3
"""Exit code: the other host was not discovered."""

_READY = 'ready'
"""Topic without messages: the subscriber offers it once it has discovered the publisher of the clouds."""

_DISCOVERY_S = 30.0
_ACKNOWLEDGED_S = 10.0  # how long the last cloud may be resent
_ROUND_S = 0.05
_LAST_ROUNDS = 10


def main() -> int:
    """Run one of the programs; gives its exit code."""
    parser = argparse.ArgumentParser()
    parser.add_argument('program', choices=('publish', 'subscribe'))
    parser.add_argument('--clouds', type=int, default=0)
    parser.add_argument('--rows', type=int, default=0)
    parser.add_argument('--columns', type=int, default=0)
    parser.add_argument('--interval-s', type=float, default=0.0)
    parser.add_argument('--both-ways', action='store_true')
    options = parser.parse_args()
    keep_freed_memory()  # as the node does
    if options.program == 'subscribe':
        return _subscribe(options.both_ways)
    shape = (options.rows, options.columns)
    return _publish(options.clouds, shape, options.interval_s, options.both_ways)


def _publish(clouds: int, shape: tuple[int, int], interval_s: float, both_ways: bool) -> int:
    import rclpy  # noqa: PLC0415 - this room imports without ROS
    from rclpy.duration import Duration  # noqa: PLC0415
    from rclpy.executors import ExternalShutdownException  # noqa: PLC0415
    from rclpy.node import Node  # noqa: PLC0415
    from rclpy.qos import QoSProfile, ReliabilityPolicy  # noqa: PLC0415
    from sensor_msgs.msg import PointCloud2  # noqa: PLC0415

    def spin() -> None:
        with contextlib.suppress(ExternalShutdownException):
            rclpy.spin(node)

    xyz = np.zeros((*shape, 3), np.float32)
    rclpy.init()
    node = Node('publisher')
    reliable = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
    publisher = node.create_publisher(PointCloud2, POINTS.name, reliable)
    if both_ways:
        node.create_subscription(PointCloud2, RELAYED, lambda _: None, reliable, raw=True)
    spinning = threading.Thread(target=spin)
    spinning.start()
    try:
        end_s = time.monotonic() + _DISCOVERY_S
        while not (publisher.get_subscription_count() and node.count_publishers(_READY)):
            if time.monotonic() > end_s:
                return NO_PARTNER
            time.sleep(_ROUND_S)
        begin_s = time.monotonic()
        for number in range(clouds):
            message = encode_point_cloud(Header(number), xyz, {'intensity': xyz[..., 2]})
            time.sleep(max(0.0, begin_s + number * interval_s - time.monotonic()))
            print(number, time.monotonic(), flush=True)  # noqa: T201 - the parent process reads it
            publisher.publish(message)
        publisher.wait_for_all_acked(Duration(seconds=_ACKNOWLEDGED_S))
    finally:
        rclpy.try_shutdown()
        spinning.join()
    return 0


def _subscribe(both_ways: bool) -> int:
    import rclpy  # noqa: PLC0415 - this room imports without ROS
    from rclpy.node import Node  # noqa: PLC0415
    from rclpy.qos import QoSProfile, ReliabilityPolicy  # noqa: PLC0415
    from sensor_msgs.msg import PointCloud2  # noqa: PLC0415

    from socialcircle_ros.node.lost_messages import LostMessages  # noqa: PLC0415
    from socialcircle_ros.node.rclpy_internals import TakenMessage, listen  # noqa: PLC0415

    rclpy.init()
    node = Node('subscriber')
    reliable = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
    relayed = node.create_publisher(PointCloud2, RELAYED, reliable) if both_ways else None

    def arrived(taken: TakenMessage) -> None:
        lost_clouds.arrived(taken)
        print(Header.read(CdrReader(taken.message)).seconds, time.monotonic(), flush=True)  # noqa: T201 - as above
        if relayed is not None:
            relayed.publish(bytes(taken.message))

    def lost(count: int) -> None:
        print(LOST, count, flush=True)  # noqa: T201 - as above

    lost_clouds = LostMessages(lost)
    listen(node, PointCloud2, POINTS.name, arrived, qos_profile=reliable, event_callbacks=lost_clouds)
    ended = threading.Event()

    def wait_for_end() -> None:
        sys.stdin.read()  # returns when the parent closes it or ends
        ended.set()

    threading.Thread(target=wait_for_end, daemon=True).start()
    ready = None
    while not ended.is_set():
        rclpy.spin_once(node, timeout_sec=_ROUND_S)
        if ready is None and node.count_publishers(POINTS.name):
            ready = node.create_publisher(PointCloud2, _READY, reliable)
    for _ in range(_LAST_ROUNDS):  # what has arrived already
        rclpy.spin_once(node, timeout_sec=0.0)
    rclpy.try_shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main())
