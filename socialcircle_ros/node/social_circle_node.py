"""The lifecycle node `social_circle`: clouds in, cleaned clouds, masks, measurements and diagnostics out.

The executor's thread only takes messages and answers services; one worker filters the newest cloud, so that
a slow cloud delays neither a parameter change nor the heartbeat.
"""

import functools
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy._rclpy_pybind11 import RCLError
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.qos import QoSPolicyKind, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import Image, PointCloud2
from std_srvs.srv import Trigger

from socialcircle_ros.errors import SocialCircleError, StackError, printable
from socialcircle_ros.messages import diagnostics, image, joint_state
from socialcircle_ros.messages.point_cloud import TYPE
from socialcircle_ros.pipeline.clouds import Filtering
from socialcircle_ros.pipeline.stacks import Refusal, StackCloud

from .connections import SILENT, complaints, node_of
from .health import Health
from .parameters import Configuration, LiveParameters
from .serialized import SerializedInput, publish
from .stack_input import StackInput
from .transport import PROFILE
from .warm_up import WarmUp
from .worker import LatestWorker

NAME = 'social_circle'

_OVERRIDABLE = (
    QoSPolicyKind.HISTORY,
    QoSPolicyKind.DEPTH,
    QoSPolicyKind.RELIABILITY,
    QoSPolicyKind.DURABILITY,
)
STACK_TYPES = (image.TYPE, joint_state.TYPE)
_DRAINING = 5.0  # s that deactivation waits for the cloud at hand
_LOG_PERIOD = 5.0  # seconds between two log lines of one kind


@dataclass
class _Arrival:
    """A cloud to be filtered: its bytes, and when it came."""

    message: bytes | memoryview
    at: float
    depth_of_field: float | None = None
    """In metres, of a cloud that was a stack."""
    again: bool = False
    """Whether it has been filtered before, and is filtered again for a change of parameters."""
    put_back: Callable[[], None] = lambda: None
    """Makes the bytes again what they were; who filtered them may have done so in place."""


def _reported(transition: Callable[..., Any]) -> Callable[..., Any]:
    """Log what goes wrong in a transition, and refuse it; rclpy would swallow the reason."""

    @functools.wraps(transition)
    def reporting(node: Any, state: LifecycleState) -> Any:
        try:
            return transition(node, state)
        except Exception as error:  # noqa: BLE001 - any reason is to be read in the log, and ends no node
            node.transition_failed(transition.__name__, state, error)
            return TransitionCallbackReturn.FAILURE

    return reporting


class SocialCircleNode(LifecycleNode):
    """The filter as a ROS 2 node; see DESIGN in the README for topics, services and parameters.

    Raises:
        SettingError: the node was started with parameters that cannot be.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(NAME, **options)
        self._guard_transitions()
        self._health = Health()
        self._worker: LatestWorker[_Arrival] | None = None
        self._clouds: SerializedInput | None = None
        self._writing = threading.Lock()  # held by who writes to a cloud, or reads what others write to
        self._stack: StackInput | None = None
        self._last: _Arrival | None = None
        self._failure = ''
        self.warm_up = WarmUp()
        self._active_since = float('inf')
        self._live_parameters = LiveParameters(self, self._parameters_changed)
        for name in self._live_parameters.unknown():
            self.get_logger().warning(f'There is no parameter {name}; it has no effect. Is it misspelled?')
        # A clock of its own: a paused replay stops ROS time, but not the heartbeat.
        self._heartbeat = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(1.0, self._publish_diagnostics, clock=steady)
        self.create_service(Trigger, '~/finish_stack', self._finish_stack)
        self.create_service(Trigger, '~/reset', self._reset)
        self.create_service(Trigger, '~/save_parameters', self._save_parameters)
        self.create_service(Trigger, '~/publish_last', self._publish_last)

    def start(self) -> None:
        """Configure and activate, if `autostart` says so."""
        if self._live_parameters.configuration.node.autostart:
            try:
                if self.trigger_configure() == TransitionCallbackReturn.SUCCESS:
                    self.trigger_activate()
            except RCLError:
                if self.context.ok():  # a signal ends the context, and with it the transition
                    raise

    def close(self) -> None:
        """Stop the worker and free what the node holds."""
        self._stop_workers()
        self.destroy_node()

    # Lifecycle

    @_reported
    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Make the publishers, compile the filter, start the worker."""
        self._filtered = self._publisher(PointCloud2, 'points_filtered')
        self._mask = self._publisher(Image, 'outlier_mask')
        self._score = self._publisher(Image, 'outlier_score')
        self._repaired = self._publisher(PointCloud2, 'points_repaired')
        self._measurement = self._publisher(DiagnosticStatus, '~/measurement')
        self._last_points = self._publisher(PointCloud2, '~/last_points')
        began = time.monotonic()
        if not self.warm_up.wait(self.context.ok, self._live_parameters.configuration.circle.mode):
            return TransitionCallbackReturn.FAILURE
        self.get_logger().info(f'The filter is compiled ({time.monotonic() - began:.1f} s).')
        self._worker = LatestWorker(self._process, self._overtaken, self._filter_again)
        self._stack = StackInput(
            self, lambda: self._live_parameters.configuration, self._health, self._filter, _OVERRIDABLE
        )
        return super().on_configure(state)

    @_reported
    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Listen for clouds."""
        result = super().on_activate(state)
        self._failure = ''
        self._clouds = SerializedInput(
            self,
            PointCloud2,
            'points',
            self._cloud_arrived,
            qos_profile=QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE),
            qos_overriding_options=QoSOverridingOptions(_OVERRIDABLE),
        )
        if self._stack is not None:
            self._stack.listen()
        self._active_since = time.monotonic()
        self.get_logger().info(f'Active: waiting for clouds on {self._clouds.subscription.topic_name}.')
        return result

    @_reported
    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Listen no more; the cloud at hand is still published."""
        self._ignore()
        if self._worker is not None:
            self._worker.forget()
            self._worker.drain(_DRAINING)
        return super().on_deactivate(state)

    @_reported
    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the worker, give the publishers back, forget the last cloud."""
        self._release()
        return super().on_cleanup(state)

    @_reported
    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """As cleanup, from any state."""
        self._ignore()
        self._release()
        return super().on_shutdown(state)

    def transition_failed(self, name: str, state: LifecycleState, error: Exception) -> None:
        """Undo what a failed transition has begun, and say why it failed."""
        self._failure = printable(f'{name} failed: {type(error).__name__}: {error}')
        self.get_logger().error(self._failure)
        if name == 'on_activate':
            self._ignore()
            super().on_deactivate(state)
        elif name == 'on_configure':
            self._release()

    def _ignore(self) -> None:
        """Listen to clouds and frames no more."""
        if self._clouds is not None:
            self._clouds.destroy()
            self._clouds = None
        if self._stack is not None:
            self._stack.ignore()

    def _release(self) -> None:
        self._stop_workers()
        self._last = None
        for name in ('_filtered', '_mask', '_score', '_repaired', '_measurement', '_last_points'):
            publisher = self.__dict__.pop(name, None)
            if publisher is not None:
                self.destroy_lifecycle_publisher(publisher)

    def _stop_workers(self) -> None:
        if self._stack is not None:
            self._stack.close()
            self._stack = None
        if self._worker is not None:
            self._worker.stop()
            self._worker = None

    def _publisher(self, kind: Any, topic: str) -> Any:
        return self.create_lifecycle_publisher(
            kind,
            topic,
            QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE),
            qos_overriding_options=QoSOverridingOptions(_OVERRIDABLE),
        )

    def _guard_transitions(self) -> None:
        """Answer an invalid transition with a refusal; rclpy raises, which ends spin() (ros2/rclpy #1209)."""
        service = self._service_change_state
        change_state = service.callback

        def guarded(request: Any, response: Any) -> Any:
            try:
                return change_state(request, response)
            except RCLError:
                _, state = self._state_machine.current_state
                wanted = request.transition.label or request.transition.id
                self.get_logger().warning(f'Transition {wanted} is not possible from state {state}; nothing done.')
                response.success = False
                return response

        service.callback = guarded

    # Clouds

    def _cloud_arrived(self, message: memoryview) -> None:
        self._health.received()
        self._filter(message)

    def _filter(self, message: bytes | memoryview, depth_of_field: float | None = None) -> None:
        """Hand a cloud to the worker: one that arrived, or one that a stack became."""
        if self._worker is not None:
            self._worker.put(_Arrival(message, time.monotonic(), depth_of_field))

    def _overtaken(self, arrival: _Arrival) -> None:
        if not arrival.again:
            self._health.dropped()

    def _process(self, arrival: _Arrival) -> None:
        """Filter one cloud and publish; on the worker's thread, so nothing may escape."""
        with self._writing:
            arrival.put_back()
        # Also a cloud that is refused is filtered again: the change may be the mend.
        self._last = last = replace(arrival, again=True)
        configuration = self._live_parameters.configuration
        try:
            filtering = Filtering(arrival.message, configuration.circle, arrival.depth_of_field)
            last.put_back = filtering.put_back
            self._publish_filtered(arrival.message, filtering)
            cleaned = filtering.answers(configuration.output, configuration.repair)
            if cleaned.mask is not None:
                self._mask.publish(cleaned.mask)
            if cleaned.score is not None:
                self._score.publish(cleaned.score)
            if cleaned.repaired is not None:
                self._repaired.publish(cleaned.repaired)
            self._measurement.publish(cleaned.measurement.encode())
        except SocialCircleError as refusal:
            self._health.refused(str(refusal))
            self.get_logger().warning(f'Cloud refused: {refusal}', throttle_duration_sec=_LOG_PERIOD)
            return
        except Exception as error:  # noqa: BLE001 - whatever it is, the next cloud must be filtered
            if self.context.ok():
                reason = printable(f'A cloud could not be filtered: {type(error).__name__}: {error}')
                self._health.failed(reason)
                self.get_logger().error(reason, throttle_duration_sec=_LOG_PERIOD)
            return
        if not arrival.again:
            self._health.published(time.monotonic() - arrival.at)
        if cleaned.status.level != diagnostics.OK:
            self.get_logger().warning(cleaned.status.message, throttle_duration_sec=_LOG_PERIOD)

    def _publish_filtered(self, message: bytes | memoryview, filtering: Filtering) -> None:
        """Publish the filtered cloud, before all else that becomes of it is made."""
        if isinstance(message, bytes):  # made of a stack, and not to be altered
            publish(self._filtered, filtering.filtered())
            return
        with self._writing:
            filtering.filter_in_place()
            publish(self._filtered, message)

    def _parameters_changed(self, before: Configuration) -> None:
        """Have the last cloud filtered again, where the change makes a difference to it."""
        now = self._live_parameters.configuration
        different = (now.circle, now.repair, now.output) != (before.circle, before.repair, before.output)
        if now.node.reprocess_last and different and self._worker is not None and self._clouds is not None:
            self._worker.put_again()

    def _filter_again(self) -> None:
        if self._last is not None:
            self._process(self._last)

    # Services and diagnostics

    def _finish_stack(self, _: Any, response: Any) -> Any:
        try:
            events = self._stack.finish() if self._stack is not None else []
        except StackError as error:
            response.success, response.message = False, str(error)
            return response
        if not events:
            response.success, response.message = False, 'No stack is running.'
            return response
        refusals = [event.reason for event in events if isinstance(event, Refusal)]
        clouds = [event for event in events if isinstance(event, StackCloud)]
        response.success = bool(clouds)
        response.message = ' '.join(
            [*refusals, *(f'A cloud was made of {cloud.frames} frames.' for cloud in clouds)]
        )
        return response

    def _reset(self, _: Any, response: Any) -> Any:
        try:
            if self._stack is not None:
                self._stack.forget()
        except StackError as error:
            response.success, response.message = False, str(error)
            return response
        if self._worker is not None:
            self._worker.forget()
            self._worker.drain(_DRAINING)
        self._last = None
        self._health.reset()
        response.success, response.message = (
            True,
            'Counters are zero; the last cloud and the stack that ran are forgotten.',
        )
        return response

    def _publish_last(self, _: Any, response: Any) -> Any:
        """Give the last cloud and its answer again, to somebody who came after it."""
        if self._last is None or self._worker is None or self._clouds is None:
            response.success, response.message = False, 'No cloud has come yet.'
            return response
        with self._writing:
            self._last.put_back()
            publish(self._last_points, self._last.message)
        self._worker.put_again()
        response.success, response.message = True, 'The last cloud is on ~/last_points, and is filtered again.'
        return response

    def _save_parameters(self, _: Any, response: Any) -> Any:
        try:
            path = self._live_parameters.save()
        except (OSError, RuntimeError, ValueError) as error:
            where = getattr(error, 'filename', None) or self._live_parameters.configuration.node.parameters_file
            why = getattr(error, 'strerror', None) or str(error)
            response.success = False
            response.message = f'Cannot write {where}: {why}; set parameters_file elsewhere.'
        else:
            response.success = True
            response.message = f'Saved to {path}; start with --ros-args --params-file {path}.'
        return response

    def _publish_diagnostics(self) -> None:
        if not self.context.ok():
            return
        name = self.get_fully_qualified_name()
        level, message, values = self._state_of_health()
        status = DiagnosticStatus(
            level=bytes([level]),
            name=f'{name.strip("/")}: filter',
            message=message,
            hardware_id=name,
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = self.get_clock().now().to_msg()
        self._heartbeat.publish(array)

    def _state_of_health(self) -> tuple[int, str, dict[str, str]]:
        """Level, sentence and values for /diagnostics."""
        _, state = self._state_machine.current_state
        values = {'state': state, **self._health.values()}
        if self._clouds is None and self._failure:
            return diagnostics.ERROR, self._failure, values
        if self._clouds is None:
            return diagnostics.OK, f'The node is {state}; it filters once it is active.', values
        subscription = self._clouds.subscription
        topic = subscription.topic_name
        publishers = self.get_publishers_info_by_topic(topic)
        values['publishers'] = str(len(publishers))
        unheard = complaints(topic, TYPE, subscription.qos_profile, publishers)
        for heard, kind in zip(self._stack.subscriptions if self._stack else (), STACK_TYPES, strict=False):
            name = heard.topic_name
            unheard += complaints(name, kind, heard.qos_profile, self.get_publishers_info_by_topic(name))
        values['connections'] = ' '.join(unheard)
        silent = min(self._health.seconds_silent(), time.monotonic() - self._active_since)
        limit = self._live_parameters.configuration.node.silence
        if unheard:
            self.get_logger().warning(unheard[0], throttle_duration_sec=_LOG_PERIOD)
            return diagnostics.ERROR, unheard[0], values
        if self._health.in_trouble():
            return diagnostics.ERROR, self._health.last_reason, values
        if publishers and limit and silent > limit:
            who = ', '.join(node_of(publisher) for publisher in publishers)
            sentence = SILENT.format(who=who, topic=topic, seconds=silent, profile=PROFILE)
            return diagnostics.WARN, sentence, values
        if self._health.had_trouble():
            return diagnostics.WARN, self._health.last_reason, values
        if not publishers:
            return diagnostics.OK, f'Waiting: nobody publishes on {topic} yet.', values
        return diagnostics.OK, 'Clouds are filtered as they come.', values
