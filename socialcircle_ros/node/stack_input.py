"""Focus stacks in the node: frames and stage positions in, clouds out to be filtered.

Frames are taken by the executor, and measured in their order on a thread of their own, so that a cloud that
is being filtered loses no frame.
"""

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import Image, JointState, PointCloud2

from socialcircle_ros.errors import StackError, printable
from socialcircle_ros.focus import count_reasons
from socialcircle_ros.kernels.memory import reserve_memory
from socialcircle_ros.pipeline.stacks import Refusal, StackAssembler, StackCloud, StackEvent

from .health import Health
from .parameters import Configuration
from .serialized import publish
from .worker import QueueWorker

FRAME_DEPTH, JOINT_DEPTH = 50, 500
"""Frames and joint states that DDS keeps for us: unlike clouds, each one counts."""

WAITING = 100
"""Jobs that may wait for the worker: two seconds at 50 frames per second."""

PAUSE = 0.02
"""Seconds between two looks whether a stack has fallen silent."""

_CLOUDS_AT_ONCE = 4
"""What finishing and publishing takes, in sizes of the cloud: the measured depth, and the message three times."""

_FINISHING = 30.0  # s that a caller of finish waits; the fit takes a hundredth of it


@dataclass(frozen=True)
class _Job:
    """Something to do on the worker's thread."""

    act: Callable[[StackAssembler], Iterator[StackEvent]]
    arrived: float = 0.0
    done: threading.Event | None = None
    events: list[StackEvent] | None = None


class StackInput:
    """What the node does with `stack/image` and `stack/joint_states`.

    Args:
        node: the lifecycle node, unconfigured or inactive.
        configuration: gives the settings in force.
        health: where arrivals, refusals and latencies are counted.
        publish: called with each cloud of a finished stack, to be filtered.
        overridable: the QoS policies that qos_overrides may change.
    """

    def __init__(
        self,
        node: Any,
        configuration: Callable[[], Configuration],
        health: Health,
        publish: Callable[[bytes, float | None], None],
        overridable: tuple[Any, ...],
    ) -> None:
        self._node = node
        self._configuration = configuration
        self._health = health
        self._filter = publish
        self._overridable = overridable
        self._assembler = StackAssembler()
        self._reserved = 0
        self._last_arrival = float('-inf')
        self._closing_arrival = float('-inf')
        self._subscriptions: list[Any] = []
        self._publishers: list[Any] = []
        try:
            self._points = self._publisher(PointCloud2, 'stack/points')
            self._image = self._publisher(Image, 'stack/image_in_focus')
            self._preview = self._publisher(PointCloud2, 'stack/preview')
        except Exception:
            self._destroy_publishers()
            raise
        self._worker = QueueWorker[_Job](self._work, self._look_for_silence, WAITING, PAUSE)

    def listen(self) -> None:
        """Subscribe."""
        for kind, topic, depth, arrived in (
            (Image, 'stack/image', FRAME_DEPTH, self._frame_arrived),
            (JointState, 'stack/joint_states', JOINT_DEPTH, self._joint_state_arrived),
        ):
            subscription = self._node.create_subscription(
                kind,
                topic,
                arrived,
                QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE),
                qos_overriding_options=QoSOverridingOptions(self._overridable),
                raw=True,
            )
            self._subscriptions.append(subscription)

    @property
    def subscriptions(self) -> list[Any]:
        """What is being listened to."""
        return self._subscriptions

    def ignore(self) -> None:
        """Subscribe no more, and forget the stack that runs."""
        while self._subscriptions:
            self._node.destroy_subscription(self._subscriptions.pop())
        self.forget()

    def forget(self) -> None:
        """Forget the stack that runs."""
        self._ask(self._forget)

    def finish(self) -> list[StackEvent]:
        """Close the stack that runs, and wait for what comes of it; nothing where none runs.

        Frames that DDS has already delivered belong to it: the executor takes one a round, and a service call
        may come before the last of them.

        Raises:
            StackError: it did not end in time.
        """
        for subscription in self._subscriptions:
            with subscription.handle:
                while (taken := subscription.handle.take_message(subscription.msg_type, True)) is not None:
                    subscription.callback(taken[0])
        return self._ask(StackAssembler.finish)

    def close(self) -> None:
        """Stop the worker, give subscriptions and publishers back."""
        while self._subscriptions:
            self._node.destroy_subscription(self._subscriptions.pop())
        self._worker.stop()
        self._destroy_publishers()

    def _publisher(self, kind: Any, topic: str) -> Any:
        publisher = self._node.create_lifecycle_publisher(
            kind,
            topic,
            QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE),
            qos_overriding_options=QoSOverridingOptions(self._overridable),
        )
        self._publishers.append(publisher)
        return publisher

    def _destroy_publishers(self) -> None:
        while self._publishers:
            self._node.destroy_lifecycle_publisher(self._publishers.pop())

    def _frame_arrived(self, message: bytes) -> None:
        self._health.frame_received()
        self._last_arrival = time.monotonic()
        if not self._worker.put_if_room(_Job(lambda assembler: assembler.add_frame(message), self._last_arrival)):
            self._health.frame_dropped()

    def _joint_state_arrived(self, message: bytes) -> None:
        self._worker.put(_Job(lambda assembler: assembler.add_joint_state(message), time.monotonic()))

    def _ask(self, act: Callable[[StackAssembler], Iterator[StackEvent]]) -> list[StackEvent]:
        """Have something done after what waits, and wait for it.

        Raises:
            StackError: it was not done in time.
        """
        done, events = threading.Event(), list[StackEvent]()
        self._worker.put(_Job(act, time.monotonic(), done, events))
        if not done.wait(_FINISHING):
            raise StackError(f'Too many frames wait to be measured; nothing came of it in {_FINISHING:.0f} s.')
        return events

    def _forget(self, _: StackAssembler) -> Iterator[StackEvent]:
        self._assembler = StackAssembler()
        return iter(())

    def _work(self, job: _Job) -> None:
        """Do a job and publish what comes of it; on the worker's thread, so nothing may escape."""
        configuration = self._configuration()
        self._assembler.configure(configuration.focus, configuration.stack)
        self._closing_arrival = job.arrived
        try:
            for event in job.act(self._assembler):
                self._handle(event)
                if job.events is not None:
                    job.events.append(event)
            self._reserve()
        except Exception as error:  # noqa: BLE001 - whatever it is, the next frame must be taken
            reason = printable(f'A frame could not be used: {type(error).__name__}: {error}')
            self._health.failed(reason)
            self._node.get_logger().error(reason, throttle_duration_sec=5.0)
        finally:
            if job.done is not None:
                job.done.set()

    def _reserve(self) -> None:
        """Take the memory for the cloud behind the first frame of a stack: the last need not wait for it."""
        size = self._assembler.cloud_size
        if size > self._reserved:
            reserve_memory(_CLOUDS_AT_ONCE * size)
            self._reserved = size

    def _look_for_silence(self) -> None:
        timeout = self._assembler.timeout
        if self._assembler.running and timeout and time.monotonic() - self._last_arrival > timeout:
            self._work(_Job(StackAssembler.finish, time.monotonic()))

    def _handle(self, event: StackEvent) -> None:
        if isinstance(event, Refusal):
            self._health.frame_refused(event.reason)
            self._node.get_logger().warning(event.reason, throttle_duration_sec=5.0)
        elif event.preview:
            self._preview.publish(event.points)
        else:
            self._publish(event)

    def _publish(self, cloud: StackCloud) -> None:
        if cloud.warning:
            self._node.get_logger().warning(cloud.warning, throttle_duration_sec=5.0)
        publish(self._points, cloud.points)
        self._health.stack_finished(time.monotonic() - self._closing_arrival)
        self._filter(cloud.points, cloud.depth_of_field)
        self._image.publish(cloud.image)
        self._health.pixels_judged(count_reasons(cloud.reasons))
