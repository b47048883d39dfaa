"""The node as a process of its own, and a client that hands it clouds and waits for the answers."""

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Image, PointCloud2

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.messages.diagnostics import Status
from socialcircle_ros.recording import Message, Topic
from socialcircle_ros.settings import RosValue

from .replay import Player

_CLOUD = ('points_filtered', 'outlier_mask', 'social_circle/measurement')
_STACK = (*_CLOUD, 'stack/points', 'stack/image_in_focus')

_GRACE = 3.0  # s that a stack of which something was refused may still take to become a cloud


class NodeProcess:
    """`social_circle_node` in a process of its own; a context manager that ends it with SIGINT.

    Args:
        namespace: the cell, such as `/demo`.
        log: where its output goes.
        parameters: full names to values, as YAML writes them.
        arguments: more of --ros-args, such as remappings.
        module: what is run.
    """

    def __init__(
        self,
        namespace: str,
        log: Path,
        parameters: dict[str, str] | None = None,
        arguments: tuple[str, ...] = (),
        module: str = 'socialcircle_ros.node.main',
    ) -> None:
        given = [item for name, value in (parameters or {}).items() for item in ('-p', f'{name}:={value}')]
        command = [sys.executable, '-m', module, '--ros-args', '-r', f'__ns:={namespace}']
        self.log = log
        with log.open('wb') as output:
            self.process = subprocess.Popen([*command, *given, *arguments], stdout=output, stderr=output)  # noqa: S603

    def stop(self, timeout: float = 10.0) -> int:
        """End the node as Ctrl-C does, and give its exit code."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            return self.process.wait(timeout)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return self.process.wait()

    def __enter__(self) -> 'NodeProcess':  # noqa: PYI034 - Self is not in Python 3.10
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()


@dataclass(frozen=True)
class Answer:
    """What the node published of one cloud."""

    filtered: bytes
    mask: bytes
    measurement: Status
    latency: float
    """Seconds from publishing the cloud, or the last frame, to receiving the filtered one."""
    stack_points: bytes | None
    """The cloud that was made of a stack, before filtering."""
    stack_image: bytes | None


class Client:
    """Publishes clouds to a node, and waits for what it makes of them; a context manager.

    Args:
        namespace: the node's.
    """

    def __init__(self, namespace: str) -> None:
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        self._node = Node('socialcircle_client', namespace=namespace, context=self._context)
        self._changed = threading.Condition()
        self._answers: dict[str, tuple[bytes, float]] = {}
        self._refusals: tuple[int, str] | None = None
        reliable = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
        self._clouds = self._node.create_publisher(PointCloud2, 'points', reliable)
        for kind, topic in (
            (PointCloud2, 'points_filtered'),
            (Image, 'outlier_mask'),
            (DiagnosticStatus, 'social_circle/measurement'),
            (PointCloud2, 'stack/points'),
            (Image, 'stack/image_in_focus'),
        ):
            self._node.create_subscription(kind, topic, self._keeping(topic), reliable, raw=True)
        self._name = f'{self._node.get_namespace().rstrip("/")}/social_circle'
        self._node.create_subscription(DiagnosticArray, '/diagnostics', self._diagnosed, 10)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, name='client')
        self._thread.start()

    def wait_for_node(self, process: NodeProcess, timeout: float) -> None:
        """Wait until the node listens and has said how it is, so that a refusal is told from earlier ones.

        Raises:
            SocialCircleError: it ended, or does not listen in time; says where its log is.
        """
        end = time.monotonic() + timeout
        while self._clouds.get_subscription_count() == 0 or self._refusals is None:
            if process.process.poll() is not None:
                raise SocialCircleError(f'The node ended at its start; read {process.log}.')
            if time.monotonic() > end:
                raise SocialCircleError(f'The node does not listen after {timeout:.0f} s; read {process.log}.')
            time.sleep(0.02)

    def clean(self, cloud: bytes, timeout: float = 30.0) -> Answer:
        """Publish one serialized cloud, and wait for its answer.

        Raises:
            SocialCircleError: the node refused it, or did not answer in time.
        """

        def publish() -> float:
            began = time.monotonic()
            self._clouds.publish(cloud)
            return began

        return self._answer(publish, _CLOUD, timeout, 0.0)

    def measure(self, player: Player, messages: Iterable[Message], timeout: float = 60.0) -> Answer:
        """Play the frames of one stack with their joint states, and wait for what becomes of it.

        Raises:
            SocialCircleError: the node refused it, or did not answer in time.
        """

        def publish() -> float:
            player.play(messages)
            return time.monotonic()

        return self._answer(publish, _STACK, timeout, _GRACE)

    def change(self, name: str, value: RosValue, timeout: float = 30.0) -> Answer:
        """Set a parameter of the node, and wait for its new answer to the last cloud.

        Raises:
            SocialCircleError: the node refused the value, or did not answer in time.
        """
        parameters = AsyncParameterClient(self._node, self._name)

        def publish() -> float:
            began, done = time.monotonic(), threading.Event()
            future = parameters.set_parameters([Parameter(name, value=value)])
            future.add_done_callback(lambda _: done.set())
            if not done.wait(timeout):
                raise SocialCircleError(f'The node did not answer within {timeout:.0f} s.')
            (result,) = future.result().results
            if not result.successful:
                raise SocialCircleError(result.reason)
            return began

        return self._answer(publish, _CLOUD, timeout, 0.0)

    def player(self, topics: Iterable[Topic]) -> Player:
        """A player into this client's namespace."""
        return Player(topics, self._node.get_namespace(), context=self._context)

    def _answer(
        self, publish: Callable[[], float], wanted: tuple[str, ...], timeout: float, grace: float
    ) -> Answer:
        """Publish, which gives when the last message went out, and wait for `wanted`.

        Once something was refused, no longer than `grace`.
        """

        def complete() -> bool:
            return all(topic in self._answers for topic in wanted)

        with self._changed:
            self._answers.clear()
            before, _ = self._refusals or (0, '')
        began = publish()
        with self._changed:
            self._changed.wait_for(lambda: complete() or self._refusal_since(before) is not None, timeout)
            if not self._changed.wait_for(complete, grace):
                reason = self._refusal_since(before)
                raise SocialCircleError(reason or f'The node did not answer within {timeout:.0f} s.')
            answers = {topic: message for topic, (message, _) in self._answers.items()}
            _, at = self._answers['points_filtered']
        return Answer(
            answers['points_filtered'],
            answers['outlier_mask'],
            Status.decode(answers['social_circle/measurement']),
            at - began,
            answers.get('stack/points'),
            answers.get('stack/image_in_focus'),
        )

    def _refusal_since(self, before: int) -> str | None:
        """The reason of the last refusal, if there were more than `before`."""
        count, reason = self._refusals or (0, '')
        return reason if count > before else None

    def close(self) -> None:
        """Leave the graph."""
        rclpy.shutdown(context=self._context)
        self._thread.join()
        self._node.destroy_node()

    def __enter__(self) -> 'Client':  # noqa: PYI034 - Self is not in Python 3.10
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            return

    def _keeping(self, topic: str) -> Any:
        def keep(message: bytes) -> None:
            with self._changed:
                self._answers[topic] = (message, time.monotonic())
                self._changed.notify_all()

        return keep

    def _diagnosed(self, array: DiagnosticArray) -> None:
        for status in array.status:
            if status.hardware_id == self._name:
                values = {pair.key: pair.value for pair in status.values}
                with self._changed:
                    kinds = ('clouds_refused', 'clouds_failed', 'stack_refusals', 'frames_dropped')
                    count = sum(int(values[kind]) for kind in kinds)
                    self._refusals = (count, values['last_reason'])
                    self._changed.notify_all()
