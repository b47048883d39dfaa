# SPDX-License-Identifier: Apache-2.0
"""Clouds and frames for a node: publishers that are there only while something is sent."""

import threading
import time
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from rclpy.duration import Duration
from rclpy.node import Node

from socialcircle_ros import interface
from socialcircle_ros.interface import NodeTopic
from socialcircle_ros.panel.link import StackMessage

from .message_types import message_class
from .qos import reliable

if TYPE_CHECKING:
    from rclpy.publisher import Publisher

_DELIVERY_TIMEOUT_S = 5.0  # to discover the subscribers of a topic, and to deliver to them
_IDLE_S = 2.0  # less than the time after which the node reports a publisher without clouds
_LONGEST_PAUSE_S = 0.05  # between two frames, which the recording may have further apart


class Sender:
    """Sends messages to the topics of one node.

    Args:
        node: makes the publishers.
        topic_name: gives the full name of a topic of the node.
        stopping: ends each wait.
    """

    def __init__(self, node: Node, topic_name: Callable[[NodeTopic], str], stopping: threading.Event) -> None:
        self._node, self._topic_name, self._stopping = node, topic_name, stopping
        self._sending = threading.Lock()
        self._publishers: dict[NodeTopic, Publisher] = {}
        self._sent_at = 0.0

    def send_cloud(self, cloud: bytes) -> str:
        """Send a serialized PointCloud2; return '' if it was delivered, else one sentence that says why not."""
        with self._sending:
            # The first subscriber is the page, which sees all clouds; the second is the node.
            problem = self._find_subscribers(interface.POINTS, 2)
            if not problem:
                self._publishers[interface.POINTS].publish(cloud)
                problem = self._deliver()
            self._sent_at = time.monotonic()
            return problem

    def send_stack(self, messages: Iterable[StackMessage]) -> str:
        """Send frames and stage positions, at most as fast as they were recorded.

        Returns:
            '' if they were delivered, else one sentence that says why not.
        """
        with self._sending:
            try:
                problem = self._find_subscribers(interface.STACK_FRAMES, 1)
                problem = problem or self._find_subscribers(interface.STACK_JOINT_STATES, 1)
                if problem:
                    return problem
                before: int | None = None
                for message in messages:
                    pause_s = 0.0 if before is None else (message.time - before) / 1e9
                    before = message.time
                    if self._stopping.wait(min(max(pause_s, 0.0), _LONGEST_PAUSE_S)):
                        return 'The page ends; the frames were not all sent.'
                    self._sent_at = time.monotonic()
                    self._publishers[message.topic].publish(message.data)
                return self._deliver()
            finally:
                self._sent_at = time.monotonic()

    def retire(self) -> None:
        """Destroy the publishers when they are idle: the node reports publishers without clouds."""
        with self._sending:
            if self._publishers and time.monotonic() - self._sent_at > _IDLE_S:
                for publisher in self._publishers.values():
                    self._node.destroy_publisher(publisher)
                self._publishers.clear()

    def _find_subscribers(self, topic: NodeTopic, count: int) -> str:
        name = self._topic_name(topic)
        if topic not in self._publishers:
            profile = reliable(topic.depth)
            self._publishers[topic] = self._node.create_publisher(message_class(topic.type), name, profile)
        deadline = time.monotonic() + _DELIVERY_TIMEOUT_S
        while self._publishers[topic].get_subscription_count() < count:
            if time.monotonic() > deadline or self._stopping.wait(0.02):
                return f'No node but this page subscribes to {name}; nothing was sent.'
        return ''

    def _deliver(self) -> str:
        timeout = Duration(seconds=_DELIVERY_TIMEOUT_S)
        late = [
            self._topic_name(topic)
            for topic, publisher in self._publishers.items()
            if not publisher.wait_for_all_acked(timeout)
        ]
        return f'Not every subscriber of {" and ".join(late)} has received what was sent.' if late else ''
