# SPDX-License-Identifier: Apache-2.0
"""The lifecycle node `social_circle`: clouds and frames in; cleaned clouds, masks and measurements out.

The executor's thread only takes messages and answers services. Clouds are filtered and frames are measured on
threads of their own, so that a slow cloud delays neither a change of parameters nor the diagnostics.
"""

import functools
import time
from collections.abc import Callable
from typing import TypeVar

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from std_srvs.srv import Trigger

from socialcircle_ros.errors import StackError, printable
from socialcircle_ros.interface import (
    ACTIVE,
    DIAGNOSTICS,
    FINISH_STACK,
    NODE_NAME,
    POINTS,
    PUBLISH_LAST,
    RESET,
    SAVE_PARAMETERS,
)
from socialcircle_ros.kernels.compiled import is_compiling
from socialcircle_ros.pipeline.stack_cloud import StackCloud
from socialcircle_ros.pipeline.stacks import Refusal

from . import rclpy_internals
from .cloud_filter import DRAINING_S, LOG_PERIOD_S, CloudFilter
from .health import Health
from .health_report import NodeState, health_status
from .parameter_saving import ParameterSaver
from .parameters import Configuration, LiveParameters
from .stack_input import StackInput
from .warm_up import WarmUp
from .worker import always

_COMPILING_S = 2.0
"""How long the end of the node waits for a cloud at hand that may itself wait for a kernel to be compiled."""

AnyNode = TypeVar('AnyNode', bound='SocialCircleNode')
Transition = Callable[[AnyNode, LifecycleState], TransitionCallbackReturn]


def _reported(transition: Transition[AnyNode]) -> Transition[AnyNode]:
    """Log why a transition fails, and refuse it; rclpy would hide the reason."""

    @functools.wraps(transition)
    def reporting(node: AnyNode, state: LifecycleState) -> TransitionCallbackReturn:
        try:
            return transition(node, state)
        except Exception as error:  # noqa: BLE001 - the log tells any reason, and the node goes on
            node.transition_failed(transition.__name__, state, error)
            return TransitionCallbackReturn.FAILURE

    return reporting


class SocialCircleNode(LifecycleNode):
    """The filter as a ROS 2 node; `interface` lists its topics and services, `settings` its parameters.

    Args:
        is_wanted: asked while kernels are compiled; False: the node is to end, and configuring is given up.
        options: arguments of rclpy's Node.

    Raises:
        SettingError: the node was started with invalid parameters.
    """

    def __init__(self, is_wanted: Callable[[], bool] = always, **options: object) -> None:
        super().__init__(NODE_NAME, **options)
        self._is_wanted = is_wanted
        rclpy_internals.refuse_invalid_transitions(self, self._transition_refused)
        self._differences = rclpy_internals.differences(self)
        self._health = Health()
        self._filter: CloudFilter | None = None
        self._stack: StackInput | None = None
        self._failure = ''
        self._active_since_s = float('inf')
        self.warm_up = WarmUp()
        self._live_parameters = LiveParameters(self, self._parameters_changed)
        for sentence in self._differences:
            self.get_logger().warning(sentence)
        self._warn_of(self._live_parameters.unknown())
        self._diagnostics = self.create_publisher(DiagnosticArray, DIAGNOSTICS.name, DIAGNOSTICS.depth)
        # A clock of its own: a paused replay stops ROS time, but not the diagnostics.
        self.create_timer(1.0, self._publish_diagnostics, clock=Clock(clock_type=ClockType.STEADY_TIME))
        answers = {
            FINISH_STACK: self._finish_stack,
            RESET: self._reset,
            PUBLISH_LAST: self._publish_last,
        }
        for service, answer in answers.items():
            self.create_service(Trigger, service.name, _triggered(answer))
        self._saver = ParameterSaver()
        # A group of its own: the other callbacks go on while the file is written.
        group = MutuallyExclusiveCallbackGroup()
        self.create_service(Trigger, SAVE_PARAMETERS.name, self._save_parameters, callback_group=group)

    def start(self) -> None:
        """Configure and activate, if `autostart` says so."""
        autostart = self._configuration().node.autostart
        if autostart and self.trigger_configure() == TransitionCallbackReturn.SUCCESS:
            self.trigger_activate()

    def close(self) -> bool:
        """Publish the cloud at hand, stop the workers, and destroy the node.

        Returns:
            Whether all threads have ended. One that filters for long, or that compiles, is not waited for.
        """
        began_s = time.monotonic()

        def patient() -> bool:
            return time.monotonic() - began_s < (_COMPILING_S if is_compiling() else DRAINING_S)

        try:
            ended = self._release(patient)
        finally:
            self.destroy_node()
        return ended and not self.warm_up.running

    # Lifecycle

    @_reported
    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Compile the filter, make the publishers, start the workers."""
        self._filter = CloudFilter(self, self._configuration, self._health)
        began_s = time.monotonic()
        circle = self._configuration().circle
        if not self.warm_up.wait(self._is_wanted, circle.mode, circle.judge, circle.provider):
            return TransitionCallbackReturn.FAILURE
        self.get_logger().info(f'The filter is compiled ({time.monotonic() - began_s:.1f} s).')
        self._filter.reserve()
        self._stack = StackInput(self, self._configuration, self._health, self._filter.filter_stack)
        return super().on_configure(state)

    @_reported
    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Listen to clouds and frames."""
        result = super().on_activate(state)
        self._failure = ''
        if self._filter is not None and self._stack is not None:
            self._filter.listen()
            self._stack.listen()
        self._warn_of(self._live_parameters.unknown_overrides())
        self._active_since_s = time.monotonic()
        self.get_logger().info(f'{ACTIVE} {self.resolve_topic_name(POINTS.name)}.')
        return result

    @_reported
    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End the subscriptions; the cloud at hand is still published, if it is filtered soon."""
        self._ignore()
        if self._filter is not None:
            self._filter.finish()
        return super().on_deactivate(state)

    @_reported
    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the workers, destroy the publishers, forget the last cloud."""
        self._release()
        return super().on_cleanup(state)

    @_reported
    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """As cleanup, from any state."""
        self._release()
        return super().on_shutdown(state)

    def transition_failed(self, name: str, state: LifecycleState, error: Exception) -> None:
        """Undo what a failed transition has begun, and tell why it failed."""
        # Of a wrong QoS rclpy names neither parameter nor what is allowed. But another fault may be the reason.
        wrong, reason = self._live_parameters.wrong_overrides(), f'{type(error).__name__}: {error}'
        self._failure = printable(f'{name} failed: {wrong} ({reason})' if wrong else f'{name} failed: {reason}')
        self.get_logger().error(self._failure)
        if name == 'on_activate':
            self._ignore()
            super().on_deactivate(state)
        elif name == 'on_configure':
            self._release()

    def _transition_refused(self, transition: str) -> None:
        state = rclpy_internals.lifecycle_state(self)
        self.get_logger().warning(f'Transition {transition} is not possible from state {state}; nothing is done.')

    def _ignore(self) -> None:
        """End the subscriptions to clouds and frames."""
        if self._filter is not None:
            self._filter.ignore()
        if self._stack is not None:
            self._stack.ignore()

    def _release(self, patient: Callable[[], bool] = always) -> bool:
        """Stop the workers, and destroy subscriptions and publishers; as `CloudFilter.close`."""
        ended = True
        try:
            if self._stack is not None:
                ended &= self._stack.close(patient)
                self._stack = None
        finally:
            if self._filter is not None:
                ended &= self._filter.close(patient)
                self._filter = None
        return ended

    def executor_failed(self, error: Exception) -> None:
        """Log and count an exception of rclpy's own callbacks; the node goes on."""
        if self.context.ok():
            reason = printable(f'A message could not be handled by rclpy: {type(error).__name__}: {error}')
            self._health.failed(reason)
            self.get_logger().error(reason, throttle_duration_sec=LOG_PERIOD_S)

    # Parameters

    def _warn_of(self, unknown: list[str]) -> None:
        for name in unknown:
            self.get_logger().warning(f'There is no parameter {name}; it has no effect. Is it misspelled?')

    def _configuration(self) -> Configuration:
        return self._live_parameters.configuration

    def _parameters_changed(self, before: Configuration) -> None:
        """Filter the last cloud again, where the change makes a difference to it."""
        now = self._configuration()
        different = (now.circle, now.repair, now.output, now.limits) != (
            before.circle,
            before.repair,
            before.output,
            before.limits,
        )
        if now.node.reprocess_last and different and self._filter is not None and self._filter.input is not None:
            self._filter.filter_again()

    # Services: each returns whether it did what was asked, and a sentence.

    def _finish_stack(self) -> tuple[bool, str]:
        try:
            events = self._stack.finish() if self._stack is not None else []
        except StackError as error:
            return False, str(error)
        if not events:
            return False, 'No stack is running.'
        refusals = [event.reason for event in events if isinstance(event, Refusal)]
        clouds = [event for event in events if isinstance(event, StackCloud)]
        made = [f'A cloud was made of {cloud.frames} frames.' for cloud in clouds]
        return bool(clouds), ' '.join([*refusals, *made])

    def _reset(self) -> tuple[bool, str]:
        try:
            if self._stack is not None:
                self._stack.forget()
        except StackError as error:
            return False, str(error)
        if self._filter is not None:
            self._filter.forget()
        self._health.reset()
        return True, 'All counts are 0; the last cloud and the running stack are discarded.'

    def _publish_last(self) -> tuple[bool, str]:
        if self._filter is None or self._filter.input is None:
            state = rclpy_internals.lifecycle_state(self)
            return False, f'The node is {state}; it publishes the last cloud only while it is active.'
        if not self._filter.publish_last():
            return False, 'There is no last cloud: none has come since the node was configured or reset.'
        return True, 'The last cloud is on ~/last_points, and is filtered again.'

    async def _save_parameters(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        values, own = self._live_parameters.to_save()
        response.success, response.message = await self._saver.save(self, values, own)
        return response

    # Diagnostics

    def _publish_diagnostics(self) -> None:
        if not self.context.ok():
            return
        if self._filter is not None:
            self._filter.look_after_memory(is_used=self._stack is not None and self._stack.reserves_memory)
        status, complaint = health_status(self, self._state(), self._health)
        if complaint:
            self.get_logger().warning(complaint, throttle_duration_sec=LOG_PERIOD_S)
        array = DiagnosticArray(
            status=[
                DiagnosticStatus(
                    level=bytes([status.level]),
                    name=status.name,
                    message=status.message,
                    hardware_id=status.hardware_id,
                    values=[KeyValue(key=key, value=value) for key, value in status.values.items()],
                )
            ]
        )
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(array)

    def _state(self) -> NodeState:
        subscriptions = []
        if self._filter is not None and self._filter.input is not None:
            subscriptions = [(self._filter.input.subscription, POINTS.type)]
            subscriptions += self._stack.subscriptions if self._stack is not None else []
        inputs = [each for each in (self._filter, self._stack) if each is not None]
        busy_s = max((each.busy_s for each in inputs), default=0.0)
        return NodeState(
            name=self.get_fully_qualified_name(),
            state=rclpy_internals.lifecycle_state(self),
            failure=self._failure,
            subscriptions=tuple(subscriptions),
            active_since_s=self._active_since_s,
            silence_s=self._configuration().node.silence,
            differences=' '.join(self._differences),
            busy_s=busy_s,
            compiling=is_compiling(),
        )


def _triggered(answer: Callable[[], tuple[bool, str]]) -> Callable[[Trigger.Request, Trigger.Response], object]:
    """The callback of a Trigger service, from a function that gives success and message."""

    def callback(_: Trigger.Request, response: Trigger.Response) -> object:
        response.success, response.message = answer()
        return response

    return callback
