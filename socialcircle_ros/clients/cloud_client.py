# SPDX-License-Identifier: Apache-2.0
"""A client that gives clouds and stacks to a node, and waits for its results."""

import threading
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from sensor_msgs.msg import PointCloud2

from socialcircle_ros import interface
from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.interface import NodeTopic
from socialcircle_ros.messages.diagnostics import Status
from socialcircle_ros.recording import Message, Topic
from socialcircle_ros.settings import RosValue

from .connection import Connection
from .health import NodeHealth, health_of
from .message_types import message_class
from .player import Player
from .process import NodeProcess, is_active, not_found
from .qos import reliable

_CLOUD_RESULTS = (interface.FILTERED, interface.MASK, interface.MEASUREMENT)
_STACK_RESULTS = (*_CLOUD_RESULTS, *interface.STACK_OUTPUTS)
_DISCOVERY_S = 15.0  # in which a node is found that is there to be found; it takes 2 s at most on an idle machine
_GRACE_S = 3.0  # a stack with a refused frame may still become a cloud


@dataclass(frozen=True)
class Response:
    """What the node published for one cloud.

    Attributes:
        filtered: the filtered cloud, serialized.
        mask: the outlier mask, serialized.
        measurement: the measurement.
        latency_ms: from publishing the cloud, or the last frame of a stack, to receiving the filtered cloud.
        stack_points: the cloud of a stack before filtering, serialized; None for other clouds.
        stack_image: the image in focus of a stack, serialized; None for other clouds.
    """

    filtered: bytes
    mask: bytes
    measurement: Status
    latency_ms: float
    stack_points: bytes | None
    stack_image: bytes | None


class Client:
    """Publishes clouds to a node, and waits for what the node publishes for them; a context manager.

    Args:
        namespace: of the node.
    """

    def __init__(self, namespace: str) -> None:
        self._connection = Connection('socialcircle_client', namespace)
        node = self._connection.node
        self._namespace = node.get_namespace()
        self._name = f'{self._namespace.rstrip("/")}/{interface.NODE_NAME}'
        self._changed = threading.Condition()
        self._received: dict[NodeTopic, tuple[bytes, float]] = {}  # the newest message, and when it came
        self._health: NodeHealth | None = None
        self._parameters = AsyncParameterClient(node, self._name)
        self._clouds = node.create_publisher(PointCloud2, interface.POINTS.within(self._namespace), reliable())
        for topic in _STACK_RESULTS:
            node.create_subscription(
                message_class(topic.type), topic.within(self._namespace), self._keep(topic), reliable(), raw=True
            )
        diagnostics = interface.DIAGNOSTICS
        node.create_subscription(DiagnosticArray, diagnostics.name, self._on_diagnostics, diagnostics.depth)
        self._connection.start()

    def wait_for_node(self, process: NodeProcess, timeout_s: float) -> None:
        """Wait until the node subscribes to clouds, answers services and has published its diagnostics.

        The diagnostics tell how many refusals there were before the first cloud.

        Raises:
            SocialCircleError: the node ended, is not ready in time, or is not found although it says that it is
                active; the message names its log.
        """
        deadline = time.monotonic() + timeout_s
        active_since_s: float | None = None
        while not self._is_heard():
            if active_since_s is None and is_active(process.log):
                active_since_s = time.monotonic()
            waited_s = 0.0 if active_since_s is None else time.monotonic() - active_since_s
            if waited_s > _DISCOVERY_S and not self._is_found():
                raise not_found(process.log)
            if process.process.poll() is not None:
                raise SocialCircleError(f'The node ended at its start; read {process.log}.')
            if time.monotonic() > deadline:
                raise SocialCircleError(f'The node is not ready after {timeout_s:.0f} s; read {process.log}.')
            time.sleep(0.02)

    def _is_found(self) -> bool:
        """Whether anything of the node was found."""
        services = self._parameters.services_are_ready()
        return bool(self._clouds.get_subscription_count() or services or self._health is not None)

    def _is_heard(self) -> bool:
        has_listener = self._clouds.get_subscription_count() > 0
        return has_listener and self._parameters.services_are_ready() and self._health is not None

    def clean(self, cloud: bytes, timeout_s: float = 30.0) -> Response:
        """Publish one serialized cloud, and wait for its results.

        Raises:
            SocialCircleError: the node refused the cloud, or did not answer in time.
        """

        def publish() -> float:
            published_at = time.monotonic()
            self._clouds.publish(cloud)
            return published_at

        return self._response(publish, _CLOUD_RESULTS, timeout_s)

    def measure(self, player: Player, messages: Iterable[Message], timeout_s: float = 60.0) -> Response:
        """Play the frames and joint states of one stack, and wait for its results.

        Raises:
            SocialCircleError: the node refused the stack, or did not answer in time.
        """

        def publish() -> float:
            player.play(messages)
            return time.monotonic()

        return self._response(publish, _STACK_RESULTS, timeout_s, _GRACE_S)

    def change(self, name: str, value: RosValue, timeout_s: float = 30.0) -> Response:
        """Set a parameter of the node, and wait for the results of the last cloud with the new value.

        Raises:
            SocialCircleError: the node refused the value, or did not answer in time.
        """

        def publish() -> float:
            requested_at, done = time.monotonic(), threading.Event()
            future = self._parameters.set_parameters([Parameter(name, value=value)])
            future.add_done_callback(lambda _: done.set())
            if not done.wait(timeout_s):
                raise _no_answer(timeout_s)
            (result,) = future.result().results
            if not result.successful:
                raise SocialCircleError(result.reason)
            return requested_at

        return self._response(publish, _CLOUD_RESULTS, timeout_s)

    def player(self, topics: Iterable[Topic]) -> Player:
        """A player that publishes into the namespace of this client."""
        return Player(topics, lambda name: self._namespace + name, context=self._connection.context)

    def close(self) -> None:
        """Leave the graph."""
        self._connection.close()

    def __enter__(self) -> 'Client':  # noqa: PYI034 - Self is not in Python 3.10
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _response(
        self, publish: Callable[[], float], wanted: Sequence[NodeTopic], timeout_s: float, grace_s: float = 0.0
    ) -> Response:
        """Publish, and wait for the results.

        Args:
            publish: publishes the input, and gives the time from which the latency counts.
            wanted: the topics of the results.
            timeout_s: longest wait.
            grace_s: longest wait after the node has refused something.
        """

        def complete() -> bool:
            return all(topic in self._received for topic in wanted)

        with self._changed:
            self._received.clear()
            before = self._health.refusals if self._health else 0
        published_at = publish()
        with self._changed:
            self._changed.wait_for(lambda: complete() or self._refusal_since(before) is not None, timeout_s)
            if not self._changed.wait_for(complete, grace_s):
                reason = self._refusal_since(before)
                raise SocialCircleError(reason) if reason else _no_answer(timeout_s)
            results = {topic: message for topic, (message, _) in self._received.items()}
            _, received_at = self._received[interface.FILTERED]
        return Response(
            filtered=results[interface.FILTERED],
            mask=results[interface.MASK],
            measurement=Status.decode(results[interface.MEASUREMENT]),
            latency_ms=1e3 * (received_at - published_at),
            stack_points=results.get(interface.STACK_POINTS),
            stack_image=results.get(interface.STACK_IMAGE),
        )

    def _refusal_since(self, before: int) -> str | None:
        """The reason of the last refusal, if there were more than `before`."""
        health = self._health
        return health.last_reason if health and health.refusals > before else None

    def _keep(self, topic: NodeTopic) -> Callable[[bytes], None]:
        """The callback that keeps the newest message of a topic."""

        def keep(message: bytes) -> None:
            with self._changed:
                self._received[topic] = (message, time.monotonic())
                self._changed.notify_all()

        return keep

    def _on_diagnostics(self, array: DiagnosticArray) -> None:
        health = health_of(self._name, array)
        if health is not None:
            with self._changed:
                self._health = health
                self._changed.notify_all()


def _no_answer(timeout_s: float) -> SocialCircleError:
    return SocialCircleError(f'The node did not answer within {timeout_s:.0f} s.')
