# SPDX-License-Identifier: Apache-2.0
"""A running node, seen over the graph: its presence, its parameters, and its clouds with their results.

`RemoteNode` implements `panel.link.Link` on rclpy. Three kinds of threads use it: the thread of the connection
receives messages, a watcher checks the node every 0.3 s, and the page calls services from its own threads.
"""

import contextlib
import dataclasses
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import ParameterEvent
from rclpy.exceptions import NameValidationException
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import qos_profile_parameter_events
from rclpy.task import Future
from rclpy.validate_full_topic_name import validate_full_topic_name
from std_srvs.srv import Trigger

from socialcircle_ros import interface
from socialcircle_ros.errors import MessageError, SettingError
from socialcircle_ros.interface import NodeService, NodeTopic
from socialcircle_ros.messages.diagnostics import WARN
from socialcircle_ros.panel.link import LogEntry, ParameterKind, Presence, ShownCloud, Snapshot, StackMessage
from socialcircle_ros.settings import RosValue

from .connection import Connection
from .graph import full_name, nodes_of_the_filter
from .health import NodeHealth, health_of
from .matching import CloudMatcher, MatchedCloud
from .message_types import message_class
from .parameters import as_kind, descriptor_of, is_of_kind, python_value
from .qos import reliable
from .sending import Sender

_HEARTBEAT_TIMEOUT_S = 3.5  # the node publishes its diagnostics each second
_WATCH_PERIOD_S = 0.3
_CALL_TIMEOUT_S, _CALL_TRIES = 2.0, 3  # a response can be lost during discovery
_REQUEST_PERIOD_S, _REQUESTS = 1.0, 5  # for the last cloud
_LOG_LENGTH = 100


class RemoteNode:
    """A connection to one node, which may come and go; a context manager that ends the connection.

    Args:
        target: name of the node, absolute or relative to the namespace that `arguments` give.
        arguments: of ROS, as on the command line (--ros-args ...).

    Raises:
        SettingError: no node can have this name.
    """

    def __init__(self, target: str, arguments: Sequence[str] = ()) -> None:
        is_absolute = target.startswith('/')
        try:
            validate_full_topic_name(target if is_absolute else f'/{target}')
        except NameValidationException:
            raise SettingError(
                f'{target!r} cannot be the name of a node; use a name such as /cell1/social_circle.'
            ) from None
        namespace = target.rpartition('/')[0] if is_absolute else ''
        self._connection = Connection('socialcircle_tune', namespace, arguments, self._on_failure)
        self._node = self._connection.node
        self._name = target if is_absolute else f'{self._node.get_namespace().rstrip("/")}/{target}'
        self._namespace, _, self._base_name = self._name.rpartition('/')
        self._changed = threading.Condition()
        # The condition guards what follows, up to the matcher.
        self._snapshot = Snapshot(sentence=self._absent_sentence())
        self._log: deque[LogEntry] = deque(maxlen=_LOG_LENGTH)
        self._log_count = 0
        self._requested: Mapping[str, RosValue] = {}  # values of the change that is under way
        self._health: NodeHealth | None = None
        self._heartbeat_at = float('-inf')
        self._matcher = CloudMatcher()
        # Only the watcher uses these.
        self._known_endpoints: set[bytes] = set()
        self._requested_at, self._requests_left = 0.0, 0
        self._parameters = AsyncParameterClient(self._node, self._name)
        self._saving = self._node.create_client(Trigger, self._service(interface.SAVE_PARAMETERS))
        self._showing = self._node.create_client(Trigger, self._service(interface.PUBLISH_LAST))
        self._finishing = self._node.create_client(Trigger, self._service(interface.FINISH_STACK))
        self._stopping = threading.Event()
        self._sender = Sender(self._node, self._topic, self._stopping)
        self._subscribe()
        self._connection.start(self._watch)

    # What the page asks

    @property
    def name(self) -> str:
        """The full name of the node."""
        return self._name

    @property
    def newest(self) -> Snapshot:
        """The newest snapshot; a change that was accepted is in it."""
        with self._changed:
            return self._snapshot

    def wait(self, revision: int, timeout_s: float) -> Snapshot:
        """The newest snapshot, as soon as it is newer than `revision`, or after `timeout_s` seconds."""
        with self._changed:
            self._changed.wait_for(lambda: self._snapshot.revision > revision, timeout_s)
            return self._snapshot

    def change(self, values: Mapping[str, RosValue]) -> str:
        """Set parameters, all or none.

        Returns:
            '' if the node accepted them, else the reason of the refusal.
        """
        if not self._parameters.services_are_ready():
            return f'{self._name} is not running; nothing was changed.'
        kinds = self._kinds()
        requested = {name: as_kind(value, kinds.get(name)) for name, value in values.items()}
        messages = [Parameter(name, value=value) for name, value in requested.items()]
        with self._changed:
            self._requested = requested
        try:
            future = self._call(lambda: self._parameters.set_parameters_atomically(messages))
            if future is None:
                return f'{self._name} does not answer; the change may not be in force.'
            result = future.result().result
            if not result.successful:
                return str(result.reason) or 'The node gave no reason.'
            self._take_values(requested)
        finally:
            with self._changed:
                self._requested = {}
        return ''

    def publish(self, cloud: bytes) -> str:
        """Send a serialized PointCloud2 to the node.

        Returns:
            '' if the cloud was delivered, else one sentence that says why not.
        """
        return self._sender.send_cloud(cloud)

    def publish_stack(self, messages: Iterable[StackMessage]) -> str:
        """Send the frames of a stack to the node, and let it end the stack.

        Returns:
            '' if they were delivered, else one sentence that says why not.
        """
        problem = self._sender.send_stack(messages)
        if not problem and self._call(lambda: self._finishing.call_async(Trigger.Request())) is None:
            problem = f'{self._name} does not answer.'
        return problem

    def save(self) -> str:
        """Ask the node to write its parameters to its file; the node's answer in words."""
        if not self._saving.service_is_ready():
            return f'{self._name} is not running; its parameters were not saved.'
        future = self._call(lambda: self._saving.call_async(Trigger.Request()))
        return future.result().message if future is not None else f'{self._name} does not answer.'

    def close(self) -> None:
        """Leave the graph."""
        self._stopping.set()
        self._connection.close()

    def __enter__(self) -> 'RemoteNode':  # noqa: PYI034 - Self is not in Python 3.10
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # Messages, on the thread of the connection

    def _subscribe(self) -> None:
        add = {
            interface.POINTS: self._matcher.add_cloud,
            interface.STACK_POINTS: self._matcher.add_cloud,
            interface.LAST_POINTS: self._matcher.add_cloud,
            interface.MASK: self._matcher.add_mask,
            interface.MEASUREMENT: self._matcher.add_measurement,
        }
        for topic, add_message in add.items():
            self._node.create_subscription(
                message_class(topic.type), self._topic(topic), self._match_with(add_message), reliable(), raw=True
            )
        diagnostics = interface.DIAGNOSTICS
        self._node.create_subscription(DiagnosticArray, diagnostics.name, self._on_diagnostics, diagnostics.depth)
        self._node.create_subscription(
            ParameterEvent, '/parameter_events', self._on_parameter_event, qos_profile_parameter_events
        )

    def _match_with(self, add_message: Callable[[bytes], MatchedCloud | None]) -> Callable[[bytes], None]:
        """The callback that gives messages to the matcher, and shows a cloud when its results are complete."""

        def receive(message: bytes) -> None:
            # The node refuses a bad cloud, and says why.
            with contextlib.suppress(MessageError), self._changed:
                matched = add_message(message)
                if matched is not None:
                    before = self._snapshot.shown_cloud
                    number = before.number + 1 if before else 1
                    shown = ShownCloud(number, matched.cloud, matched.mask, matched.measurement)
                    self._show(dataclasses.replace(self._snapshot, shown_cloud=shown))

        return receive

    def _on_diagnostics(self, array: DiagnosticArray) -> None:
        health = health_of(self._name, array)
        if health is not None:
            with self._changed:
                self._heartbeat_at, self._health = time.monotonic(), health
                if health.refusals != self._snapshot.refusals:
                    self._show(
                        dataclasses.replace(
                            self._snapshot, refusals=health.refusals, last_reason=health.last_reason
                        )
                    )

    def _on_parameter_event(self, event: ParameterEvent) -> None:
        # New parameters are those that a node declares when it starts; the watcher reads them.
        if event.node == self._name:
            values = {item.name: python_value(item.value) for item in event.changed_parameters}
            self._take_values({name: value for name, value in values.items() if value is not None})

    def _on_failure(self, text: str) -> None:
        self._add_to_log(text, bad=True)

    # The watcher

    def _watch(self) -> None:
        """Check the node until the connection is closed."""
        while not self._stopping.wait(_WATCH_PERIOD_S):
            self._connection.guarded(self._sender.retire)
            self._connection.guarded(self._check_node)

    def _check_node(self) -> None:
        """Note whether the node runs, and read the parameters of a node that has started."""
        has_heartbeat = time.monotonic() - self._heartbeat_at < _HEARTBEAT_TIMEOUT_S
        is_alive = has_heartbeat and self._parameters.services_are_ready()
        if is_alive:
            self._read_parameters_of_new_node()
        with self._changed:
            presence, level, sentence = self._presence(is_alive=is_alive)
            before = self._snapshot
            if (presence, level, sentence) != (before.presence, before.level, before.sentence):
                if not is_alive and before.presence in (Presence.ACTIVE, Presence.INACTIVE):
                    self._add_to_log('The node no longer answers.', bad=True)
                self._show(dataclasses.replace(self._snapshot, presence=presence, level=level, sentence=sentence))
        if presence is Presence.ACTIVE:
            self._request_last_cloud()

    def _read_parameters_of_new_node(self) -> None:
        """Read the parameters unless those of this process of the node are known."""
        # The graph may name the publisher some time after its first message. Until then the process is not known.
        endpoints = self._diagnostics_endpoints()
        if endpoints - self._known_endpoints and self._read_parameters():
            restarted = bool(self._known_endpoints)
            self._known_endpoints |= endpoints
            self._requests_left = _REQUESTS
            self._add_to_log('The node was started again.' if restarted else 'The node is running.')

    def _diagnostics_endpoints(self) -> set[bytes]:
        """The node's publishers of diagnostics; a node that is started again has new ones."""
        return {
            bytes(publisher.endpoint_gid)
            for publisher in self._node.get_publishers_info_by_topic(interface.DIAGNOSTICS.name)
            if full_name(publisher.node_namespace, publisher.node_name) == self._name
        }

    def _read_parameters(self) -> bool:
        """Ask the node for every parameter; whether it has answered."""
        listed = self._call(self._parameters.list_parameters)
        if listed is None:
            return False
        names = list(listed.result().result.names)
        described = self._call(lambda: self._parameters.describe_parameters(names))
        got = self._call(lambda: self._parameters.get_parameters(names))
        if described is None or got is None:
            return False
        descriptors, values = [], {}
        for message, value in zip(described.result().descriptors, got.result().values, strict=False):
            descriptor, plain = descriptor_of(message, value.type), python_value(value)
            if descriptor is not None and plain is not None:
                descriptors.append(descriptor)
                values[descriptor.name] = as_kind(plain, descriptor.kind)
        with self._changed:
            is_first = not self._snapshot.values
            starts = self._snapshot.starts + 1
            self._show(dataclasses.replace(self._snapshot, descriptors=tuple(descriptors), starts=starts))
            if is_first:
                self._show(dataclasses.replace(self._snapshot, values=values))
            else:
                self._take_values(values)
        return True

    def _request_last_cloud(self) -> None:
        """Ask for the cloud that came before this page.

        The request is repeated, because the cloud can be lost during discovery.
        """
        is_due = self._requests_left and time.monotonic() - self._requested_at > _REQUEST_PERIOD_S
        if self._snapshot.shown_cloud is None and is_due and self._showing.service_is_ready():
            self._requested_at = time.monotonic()
            future = self._call(lambda: self._showing.call_async(Trigger.Request()))
            has_no_cloud = future is not None and not future.result().success
            self._requests_left = 0 if has_no_cloud else self._requests_left - 1

    # What is known of the node

    def _presence(self, *, is_alive: bool) -> tuple[Presence, int, str]:
        """The node's presence, its level and one sentence."""
        if not is_alive or self._health is None:
            if self._parameters.services_are_ready():
                return Presence.SILENT, WARN, self._silent_sentence()
            return Presence.ABSENT, WARN, self._absent_sentence()
        if not self._snapshot.descriptors:
            return Presence.SILENT, WARN, 'Waiting for the parameters of the node.'
        level, sentence = self._health.level, self._health.message
        if self._snapshot.values.get('output.mask') is False:
            level = max(level, WARN)
            sentence = 'Switch output.mask on: without the mask this page cannot show outliers.'
        presence = Presence.ACTIVE if self._health.state == 'active' else Presence.INACTIVE
        return presence, level, sentence

    def _silent_sentence(self) -> str:
        if self._known_endpoints:
            return 'Waiting: the node has stopped answering; if it has ended, start it again.'
        return 'Waiting: the node does not answer yet. Its first start compiles for up to half a minute.'

    def _absent_sentence(self) -> str:
        others = [name for name in nodes_of_the_filter(self._node) if name != self._name]
        elsewhere = f' There is {" and ".join(others)}: choose it with --node.' if others else ''
        remapping = f' --ros-args -r __ns:={self._namespace}' if self._namespace else ''
        return f'Waiting for {self._name}; start it with: socialcircle node{remapping}.{elsewhere}'

    def _take_values(self, values: Mapping[str, RosValue]) -> None:
        """Note values that are in force, and log each change with its origin."""
        kinds = self._kinds()
        with self._changed:
            known = dict(self._snapshot.values)
            for name, value in values.items():
                new = as_kind(value, kinds.get(name))
                if name in kinds and is_of_kind(new, kinds[name]) and known.get(name) != new:
                    origin = 'this page' if self._requested.get(name) == value else 'elsewhere'
                    self._add_to_log(f'{name}: {known.get(name)} → {new} ({origin})')
                    known[name] = new
            if known != self._snapshot.values:
                self._show(dataclasses.replace(self._snapshot, values=known))

    def _kinds(self) -> dict[str, ParameterKind]:
        return {descriptor.name: descriptor.kind for descriptor in self._snapshot.descriptors}

    def _add_to_log(self, text: str, *, bad: bool = False) -> None:
        with self._changed:
            self._log.append(LogEntry(time.time(), text, bad))
            self._log_count += 1
            self._show(dataclasses.replace(self._snapshot, log=tuple(self._log), log_total=self._log_count))

    def _show(self, snapshot: Snapshot) -> None:
        """Make `snapshot` the newest one. The caller holds the condition."""
        self._snapshot = dataclasses.replace(snapshot, revision=self._snapshot.revision + 1)
        self._changed.notify_all()

    # The graph

    def _topic(self, topic: NodeTopic) -> str:
        return topic.within(self._namespace, self._base_name)

    def _service(self, service: NodeService) -> str:
        return service.name.replace('~', self._name, 1)

    def _call(self, request: Callable[[], Future]) -> Future | None:
        """Call a service, and wait. The thread must not be that of the connection.

        Returns:
            The completed future; None if no response came.
        """
        for _ in range(_CALL_TRIES):
            done = threading.Event()
            future = request()
            future.add_done_callback(lambda _, done=done: done.set())
            if done.wait(_CALL_TIMEOUT_S):
                return future
            if self._stopping.is_set():
                return None
        return None
