# SPDX-License-Identifier: Apache-2.0
"""A relay that publishes each cloud of `points` on `relayed` without reading it.

Its trip time is the lower bound of any rclpy node that receives and publishes a cloud.
"""

import sys

from socialcircle_ros.interface import POINTS
from socialcircle_ros.node.transport import prepare_process

RELAYED = 'relayed'
"""The topic on which the relay publishes."""


def main() -> int:
    """Run the relay until SIGINT; returns the exit status."""
    prepare_process()
    import rclpy  # noqa: PLC0415 - after the environment is set
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor  # noqa: PLC0415
    from rclpy.node import Node  # noqa: PLC0415
    from rclpy.qos import QoSProfile, ReliabilityPolicy  # noqa: PLC0415
    from sensor_msgs.msg import PointCloud2  # noqa: PLC0415

    node = None
    try:
        rclpy.init()
        node = Node('relay')
        reliable = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
        publisher = node.create_publisher(PointCloud2, RELAYED, reliable)
        node.create_subscription(PointCloud2, POINTS.name, publisher.publish, reliable, raw=True)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main())
