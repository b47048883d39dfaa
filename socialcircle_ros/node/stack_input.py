# SPDX-License-Identifier: Apache-2.0
"""Focus stacks in the node: frames and stage positions in, clouds out to be filtered.

The executor takes the frames. A thread of their own measures them in their order, so that no frame is lost while a
cloud is filtered.
"""

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from rclpy.lifecycle import LifecycleNode
from rclpy.subscription import Subscription

from socialcircle_ros.errors import StackError, printable
from socialcircle_ros.focus import count_reasons
from socialcircle_ros.interface import (
    STACK_FRAMES,
    STACK_IMAGE,
    STACK_JOINT_STATES,
    STACK_OUTPUTS,
    STACK_POINTS,
    STACK_PREVIEW,
)
from socialcircle_ros.kernels.memory import reserve_memory
from socialcircle_ros.pipeline.stack_cloud import StackCloud
from socialcircle_ros.pipeline.stacks import Refusal, StackAssembler, StackEvent

from .health import Health
from .lost_messages import LostMessages, lost_sentence
from .parameters import Configuration
from .rclpy_internals import MessageInput, RCLError, TakenMessage, listen, take, waiting_messages
from .topics import CLASSES, Publishers, qos_options
from .worker import QueueWorker, always

MOST_WAITING = 100
"""Frames that may wait for the worker: two seconds at 50 frames per second."""

MOST_STATES_WAITING = 2000
"""Items, frames and joint states, that may wait when a joint state comes: two seconds at 1 kHz."""

PAUSE_S = 0.02
"""Time between two checks whether a stack has timed out."""

_CLOUDS_AT_ONCE = 4
"""Memory that finishing and publishing needs, in sizes of the cloud: the depth, and the message three times."""

_KEEPING_S = 60.0  # how long the memory of the last stack is kept for the next one

_FINISHING_S = 30.0  # how long a caller of `finish` waits; the fit takes a hundredth of it

_LOG_PERIOD_S = 5.0


@dataclass(frozen=True)
class _Task:
    """Something to do on the worker's thread."""

    act: Callable[[StackAssembler], Iterator[StackEvent]]
    arrived_s: float = 0.0
    is_frame: bool = False
    done: threading.Event | None = None
    events: list[StackEvent] | None = None


class StackInput:
    """What the node does with `stack/image` and `stack/joint_states`.

    Args:
        node: the lifecycle node, unconfigured or inactive.
        configuration: gives the settings in force.
        health: counts arrivals, refusals and latencies.
        filter_cloud: takes each cloud of a finished stack, with its depth of field in m.
    """

    def __init__(
        self,
        node: LifecycleNode,
        configuration: Callable[[], Configuration],
        health: Health,
        filter_cloud: Callable[[bytes, float | None], None],
    ) -> None:
        self._node = node
        self._configuration = configuration
        self._health = health
        self._filter_cloud = filter_cloud
        self._assembler = StackAssembler()
        self._reserved = 0
        self._last_arrival_s = float('-inf')
        self._closing_arrival_s = float('-inf')
        self._frames: MessageInput | None = None
        self._joint_states: Subscription | None = None
        self._lost = LostMessages(self._frames_lost)
        self._frames_at_hand = 0  # of the running stack, with the one that is being measured
        self._missing = 0  # frames, lost or dropped, since the last one that waits or was measured
        self._publishers = Publishers(node, (*STACK_OUTPUTS, STACK_PREVIEW))
        self._worker = QueueWorker[_Task](self._work, self._check_timeout, PAUSE_S)

    def listen(self) -> None:
        """Subscribe to frames and joint states."""
        self._lost, self._missing = LostMessages(self._frames_lost), 0
        self._frames = listen(
            self._node,
            CLASSES[STACK_FRAMES.type],
            STACK_FRAMES.name,
            self._frame_arrived,
            event_callbacks=self._lost,
            **qos_options(STACK_FRAMES),
        )
        self._joint_states = self._node.create_subscription(
            CLASSES[STACK_JOINT_STATES.type],
            STACK_JOINT_STATES.name,
            self._joint_state_arrived,
            raw=True,
            **qos_options(STACK_JOINT_STATES),
        )

    @property
    def busy_s(self) -> float:
        """For how long the frame at hand has been measured; at most 0 where there is none."""
        return self._worker.busy_s

    @property
    def subscriptions(self) -> list[tuple[Subscription, str]]:
        """The subscriptions in force, with the types of their messages."""
        subscriptions = []
        if self._frames is not None:
            subscriptions.append((self._frames.subscription, STACK_FRAMES.type))
        if self._joint_states is not None:
            subscriptions.append((self._joint_states, STACK_JOINT_STATES.type))
        return subscriptions

    @property
    def reserves_memory(self) -> bool:
        """Whether memory is reserved for the clouds of stacks."""
        return self._reserved > 0

    def ignore(self) -> None:
        """End the subscriptions, and drop the stack that runs once all that has come is measured."""
        self._take_last()
        self._unsubscribe()
        self._tell_dropped(self._forget_running(), 'deactivated')

    def forget(self) -> None:
        """Forget the running stack and the frames that wait."""
        self._missing = 0
        self._worker.forget()
        self._forget_running()

    def _forget_running(self) -> int:
        """Forget the running stack once what waits is measured, and return the number of its frames."""
        frames = []

        def forget(assembler: StackAssembler) -> Iterator[StackEvent]:
            frames.append(assembler.frames)
            self._assembler = StackAssembler()
            return iter(())

        self._ask(forget)
        return sum(frames)

    def finish(self) -> list[StackEvent]:
        """Close the running stack, and wait for what comes of it; nothing where none runs.

        Frames that the middleware has delivered belong to the stack: the executor takes one per round, and may
        reach a service call before the last of them.

        Raises:
            StackError: it did not end in time.
        """
        self._take_delivered()
        return self._ask(StackAssembler.finish)

    def close(self, patient: Callable[[], bool] = always) -> bool:
        """Stop the worker, and destroy subscriptions and publishers; as `CloudFilter.close`."""
        try:
            if self._node.context.ok():
                self._take_last()
            self._unsubscribe()
        finally:
            ended = self._worker.stop(patient)
        waiting = sum(task.is_frame for task in self._worker.forget())
        at_hand = self._assembler.frames if ended else self._frames_at_hand
        self._tell_dropped(waiting + at_hand, 'shut down')
        self._publishers.destroy()
        return ended

    def _take_last(self) -> None:
        """Take what the middleware has delivered before the subscriptions end; if it refuses, they end anyway."""
        try:
            self._take_delivered()
        except RCLError as error:
            reason = printable(f'The last frames of a stack could not be taken: {error}')
            self._health.failed(reason)
            self._node.get_logger().error(reason)

    def _take_delivered(self) -> None:
        """Take what the middleware has delivered and the executor has not taken yet."""
        if self._frames is not None:
            while (taken := take(self._frames.subscription)) is not None:
                self._frame_arrived(taken)
        if self._joint_states is not None:
            for message in waiting_messages(self._joint_states):
                self._joint_state_arrived(message)

    def _unsubscribe(self) -> None:
        if self._frames is not None:
            self._frames.destroy()
            self._frames = None
        if self._joint_states is not None:
            self._node.destroy_subscription(self._joint_states)
            self._joint_states = None

    def _frame_arrived(self, taken: TakenMessage) -> None:
        self._health.frame_received()
        self._last_arrival_s = time.monotonic()
        # Read-only, as bytes are: the kernels of colours are compiled for that.
        message, missing = taken.message.toreadonly(), self._missing + self._lost.arrived(taken)
        task = _Task(lambda assembler: assembler.add_frame(message, missing), self._last_arrival_s, is_frame=True)
        if self._worker.put_if_room(task, MOST_WAITING):
            self._missing = 0
        else:
            self._missing = missing + 1
            self._health.frame_dropped()

    def _tell_dropped(self, frames: int, what: str) -> None:
        """Count the frames of a stack that ran when something became of the node, and say so."""
        if not frames:
            return
        were = 'A frame of a stack was' if frames == 1 else f'{frames} frames of a stack were'
        reason = f'{were} dropped: the stack was not finished when the node was {what}.'
        self._health.stack_dropped(frames, reason)
        self._node.get_logger().warning(reason)

    def _frames_lost(self, count: int) -> None:
        reason = lost_sentence(count, self._node.resolve_topic_name(STACK_FRAMES.name), 'frame')
        self._health.frames_lost(count, reason)
        self._node.get_logger().warning(reason, throttle_duration_sec=_LOG_PERIOD_S)

    def _joint_state_arrived(self, message: bytes) -> None:
        task = _Task(lambda assembler: assembler.add_joint_state(message), time.monotonic())
        if not self._worker.put_if_room(task, MOST_STATES_WAITING):
            self._health.joint_state_dropped()

    def _ask(self, act: Callable[[StackAssembler], Iterator[StackEvent]]) -> list[StackEvent]:
        """Let the worker do something after all that waits, and wait for it.

        Raises:
            StackError: it was not done in time.
        """
        done, events = threading.Event(), list[StackEvent]()
        self._worker.put(_Task(act, time.monotonic(), done=done, events=events))
        if not done.wait(_FINISHING_S):
            raise StackError(f'Too many frames wait to be measured; nothing came of it in {_FINISHING_S:.0f} s.')
        return events

    def _work(self, task: _Task) -> None:
        """Do a task and publish what comes of it; on the worker's thread, so no exception may escape."""
        self._frames_at_hand = self._assembler.frames + task.is_frame
        configuration = self._configuration()
        self._assembler.configure(configuration.focus, configuration.stack)
        self._closing_arrival_s = task.arrived_s
        try:
            for event in task.act(self._assembler):
                self._handle(event)
                if task.events is not None:
                    task.events.append(event)
            self._reserve()
        except Exception as error:  # noqa: BLE001 - whatever it is, the next frame must be taken
            reason = printable(f'A frame could not be used: {type(error).__name__}: {error}')
            self._health.failed(reason)
            self._node.get_logger().error(reason, throttle_duration_sec=_LOG_PERIOD_S)
        finally:
            if task.done is not None:
                task.done.set()

    def _reserve(self) -> None:
        """Reserve the memory for the cloud after a stack's first frame, so that its last does not wait for it."""
        size = self._assembler.cloud_size
        if size > self._reserved:
            reserve_memory(_CLOUDS_AT_ONCE * size)
            self._reserved = size

    def _check_timeout(self) -> None:
        timeout_s, silent_s = self._assembler.timeout, time.monotonic() - self._last_arrival_s
        if self._assembler.running:
            if timeout_s and silent_s > timeout_s:
                self._work(_Task(StackAssembler.finish, time.monotonic()))
        elif self._reserved and silent_s > _KEEPING_S:
            self._assembler.release_memory()
            self._reserved = 0

    def _handle(self, event: StackEvent) -> None:
        if isinstance(event, Refusal):
            self._health.frame_refused(event.reason)
            self._node.get_logger().warning(event.reason, throttle_duration_sec=_LOG_PERIOD_S)
        elif event.preview:
            self._publishers.publish(STACK_PREVIEW, event.points)
        else:
            self._publish(event)

    def _publish(self, cloud: StackCloud) -> None:
        if cloud.warning:
            self._node.get_logger().warning(cloud.warning, throttle_duration_sec=_LOG_PERIOD_S)
        self._publishers.publish(STACK_POINTS, cloud.points)
        latency_s = time.monotonic() - self._closing_arrival_s
        self._health.stack_finished(latency_s, cloud.flicker, cloud.focus_step, cloud.drift, cloud.registered)
        self._filter_cloud(cloud.points, cloud.depth_of_field)
        self._publishers.publish(STACK_IMAGE, cloud.image)
        self._health.pixels_judged(count_reasons(cloud.reasons))
