# SPDX-License-Identifier: Apache-2.0
"""The node's topics in rclpy: classes of their messages, QoS, and the publishers of several topics together."""

import time
from collections.abc import Iterable
from typing import TypedDict

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleNode, LifecyclePublisher
from rclpy.qos import QoSPolicyKind, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import Image, JointState, PointCloud2

from socialcircle_ros.interface import NodeTopic
from socialcircle_ros.messages import diagnostics, image, joint_state, point_cloud

from .rclpy_internals import RCLError, publish

CLASSES: dict[str, type] = {
    point_cloud.TYPE: PointCloud2,
    image.TYPE: Image,
    joint_state.TYPE: JointState,
    diagnostics.TYPE: DiagnosticStatus,
}
"""Class of a message by the name of its type."""

_ARRIVING_S = 1.0  # how long messages are waited for that a subscription does not acknowledge

_OVERRIDABLE = (QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY, QoSPolicyKind.DURABILITY)


class QoSOptions(TypedDict):
    """Arguments of rclpy's functions that subscribe or make a publisher."""

    qos_profile: QoSProfile
    qos_overriding_options: QoSOverridingOptions


def qos_options(topic: NodeTopic) -> QoSOptions:
    """The QoS of a topic, which `qos_overrides` parameters change."""
    return {
        'qos_profile': QoSProfile(depth=topic.depth, reliability=ReliabilityPolicy.RELIABLE),
        'qos_overriding_options': QoSOverridingOptions(_OVERRIDABLE),
    }


class Publishers:
    """Lifecycle publishers of several topics, made and destroyed together.

    Args:
        node: the lifecycle node.
        topics: one publisher each.
    """

    def __init__(self, node: LifecycleNode, topics: Iterable[NodeTopic]) -> None:
        self._node = node
        self._publishers: dict[NodeTopic, LifecyclePublisher] = {}
        try:
            for topic in topics:
                kind = CLASSES[topic.type]
                options = qos_options(topic)
                self._publishers[topic] = node.create_lifecycle_publisher(kind, topic.name, **options)
        except Exception:
            self.destroy()
            raise

    def publish(self, topic: NodeTopic, message: bytes | memoryview) -> bool:
        """Publish a serialized message, read during the call only; False: the node is not active, or has ended."""
        publisher = self._publishers.get(topic)
        return publisher is not None and publish(publisher, message)

    def destroy(self) -> None:
        """Destroy all of them, once what they published has arrived: a message ends with its publisher."""
        try:
            self._wait_for_arrival()
        except RCLError as error:  # a middleware may not support it
            self._node.get_logger().warning(f'Whether the last messages have arrived is not known: {error}')
        for topic in list(self._publishers):
            self._node.destroy_lifecycle_publisher(self._publishers.pop(topic))

    def _wait_for_arrival(self) -> None:
        until_s = time.monotonic() + _ARRIVING_S
        if self._node.context.ok():
            for publisher in self._publishers.values():
                left_s = max(0.0, until_s - time.monotonic())
                publisher.wait_for_all_acked(Duration(nanoseconds=int(1e9 * left_s)))
