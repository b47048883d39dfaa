# SPDX-License-Identifier: Apache-2.0
"""A client that times a message's round trip: from a publisher here through a node to a subscriber here."""

import threading
import time
from collections.abc import Callable

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.interface import NodeTopic
from socialcircle_ros.messages.header import stamp_of

from .connection import Connection
from .message_types import message_class
from .process import NodeProcess, is_active, not_found
from .qos import reliable

_TIMEOUT_S = 60.0  # the first start of a node compiles
_QUEUE_DEPTH = 10  # answers that may wait for this process; none may be lost here
_SETTLING_S = 0.3  # after discovery


class RoundTrip:
    """Publishes on one topic and subscribes to another, raw; a context manager.

    A round trip begins just before the call of publish(), and ends in the callback that receives the bytes of the
    answer. The transport in both directions is part of it.

    Args:
        namespace: of the node that answers.
        sends: the topic of the node's input.
        depth: how many messages the publisher keeps until they are delivered.
        hears: the topic of the node's answers.

    Attributes:
        received: the number of answers so far.
    """

    def __init__(self, namespace: str, sends: NodeTopic, depth: int, hears: NodeTopic) -> None:
        self.received = 0
        self._received_at, self._answer = 0.0, b''
        self._changed = threading.Condition()
        self._connection = Connection('socialcircle_bench', namespace)
        node = self._connection.node
        self._answers_topic = hears.within(node.get_namespace())
        self._publisher = node.create_publisher(
            message_class(sends.type), sends.within(node.get_namespace()), reliable(depth)
        )
        node.create_subscription(
            message_class(hears.type), self._answers_topic, self._on_answer, reliable(_QUEUE_DEPTH), raw=True
        )
        self._connection.start()

    def wait_for_node(self, process: NodeProcess) -> None:
        """Wait until the node subscribes to the input and publishes the answers.

        Raises:
            SocialCircleError: it ended, or does not do so in time.
        """
        deadline = time.monotonic() + _TIMEOUT_S
        node = self._connection.node
        while not (self._publisher.get_subscription_count() and node.count_publishers(self._answers_topic)):
            ended = process.process.poll() is not None
            if not ended and time.monotonic() > deadline and is_active(process.log):
                raise not_found(process.log)
            if ended or time.monotonic() > deadline:
                raise SocialCircleError(f'The node is not ready; read {process.log}.')
            time.sleep(0.02)
        time.sleep(_SETTLING_S)

    def publish(self, message: bytes) -> float:
        """Publish a message; when the call began, in s on the monotonic clock."""
        published_at = time.monotonic()
        self._publisher.publish(message)
        return published_at

    def trip_ms(self, message: bytes) -> float:
        """Publish a message, and wait for the answer with the same stamp; the time between, in ms.

        Raises:
            SocialCircleError: no answer came in time.
        """
        stamp, before = stamp_of(message), self.received
        published_at = self.publish(message)
        if not self.wait(lambda: self.received > before and stamp_of(self._answer) == stamp, _TIMEOUT_S):
            raise SocialCircleError(f'No answer came on {self._answers_topic} within {_TIMEOUT_S:.0f} s.')
        return 1e3 * (self._received_at - published_at)

    def wait(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Wait for answers until a condition holds; whether it held in time."""
        with self._changed:
            return self._changed.wait_for(condition, timeout_s)

    def close(self) -> None:
        """Leave the graph."""
        self._connection.close()

    def __enter__(self) -> 'RoundTrip':  # noqa: PYI034 - Self is not in Python 3.10
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _on_answer(self, message: bytes) -> None:
        with self._changed:
            self._received_at, self._answer = time.monotonic(), message
            self.received += 1
            self._changed.notify_all()
