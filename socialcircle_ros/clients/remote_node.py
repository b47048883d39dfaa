"""Another node of ours, seen over the graph: its parameters, its clouds and answers, whether it is there.

What the tuning page asks of a node (`panel.link.Link`), on rclpy. Messages are taken on the executor's thread,
which only keeps the newest; a watcher looks after the node; services are called from any other thread.
"""

import contextlib
import dataclasses
import threading
import time
from collections import OrderedDict, deque
from collections.abc import Callable, Mapping
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import ParameterDescriptor, ParameterEvent, ParameterType
from rclpy.duration import Duration
from rclpy.exceptions import NameValidationException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import QoSProfile, ReliabilityPolicy, qos_profile_parameter_events
from rclpy.validate_full_topic_name import validate_full_topic_name
from sensor_msgs.msg import Image as ImageMessage
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import Trigger

from socialcircle_ros.errors import MessageError, SettingError
from socialcircle_ros.messages.diagnostics import OK, WARN, Status
from socialcircle_ros.messages.header import stamp_of
from socialcircle_ros.messages.image import Image, decode_mono8
from socialcircle_ros.panel.link import Descriptor, LogEntry, ParameterKind, Presence, ShownCloud, Snapshot
from socialcircle_ros.settings import RosValue, choices_in, sentence_and_unit

_HEARTBEAT_LOST = 3.5  # s; the node's comes each second
_WATCHING = 0.3  # s between two looks at the graph
_CALL, _TRIES = (
    2.0,
    3,
)  # s for an answer of a service, and how often it is asked: an answer can be lost at discovery
_LISTENING = 5.0  # s in which a subscriber of our clouds is found, and has one delivered
_QUIET = 2.0  # s after which we no longer count as a publisher, before the node misses our clouds
_ASKING, _ASKS = 1.0, 5  # s between two tries to see the last cloud, and how many there are
_CLOUDS = 12  # that wait for their answer, at most
_CLOUD_BYTES = 512 << 20
_EVENTS = 100

_KINDS = {
    ParameterType.PARAMETER_BOOL: ParameterKind.BOOLEAN,
    ParameterType.PARAMETER_INTEGER: ParameterKind.INTEGER,
    ParameterType.PARAMETER_DOUBLE: ParameterKind.REAL,
    ParameterType.PARAMETER_STRING: ParameterKind.TEXT,
    ParameterType.PARAMETER_INTEGER_ARRAY: ParameterKind.INTEGERS,
}


class RemoteNode:
    """A connection to one node, which may come and go; a context manager that ends it.

    Args:
        target: the node's name, absolute or relative to the namespace that `arguments` give.
        arguments: of ROS, as on the command line (--ros-args ...).

    Raises:
        SettingError: no node can have that name.
    """

    def __init__(self, target: str, arguments: list[str] | None = None) -> None:
        try:
            validate_full_topic_name(target if target.startswith('/') else f'/{target}')
        except NameValidationException:
            raise SettingError(
                f'{target!r} cannot be the name of a node; give one such as /cell1/social_circle.'
            ) from None
        self._context = rclpy.Context()
        rclpy.init(args=arguments or [], context=self._context)
        namespace = target.rpartition('/')[0] if target.startswith('/') else ''
        self._node = Node('socialcircle_tune', namespace=namespace, context=self._context)
        own = self._node.get_namespace().rstrip('/')
        self._name = target if target.startswith('/') else f'{own}/{target}'
        self._namespace = self._name.rpartition('/')[0]
        self._changed = threading.Condition()
        self._snapshot = Snapshot(sentence=self._absent())
        self._events: deque[LogEntry] = deque(maxlen=_EVENTS)
        self._event_count = 0
        self._asked: Mapping[str, RosValue] = {}
        self._heartbeat = float('-inf')
        self._health = (OK, '', '')  # level, sentence, state
        self._seen: set[bytes] = set()  # endpoints of the node's incarnations that have told their parameters
        self._inputs: OrderedDict[int, bytes] = OrderedDict()
        self._mask: tuple[int, Any] | None = None
        self._measurement: tuple[int, Status] | None = None
        self._publisher: Any = None
        self._published_at = 0.0
        self._publishing = threading.Lock()
        self._subscribe()
        self._parameters = AsyncParameterClient(self._node, self._name)
        self._saving = self._node.create_client(Trigger, f'{self._name}/save_parameters')
        self._showing = self._node.create_client(Trigger, f'{self._name}/publish_last')
        self._asked_at, self._asks_left = 0.0, 0
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._stopping = threading.Event()
        self._threads = [
            threading.Thread(target=self._spin, name='remote'),
            threading.Thread(target=self._watch, name='watcher'),
        ]
        for thread in self._threads:
            thread.start()

    # What the page asks

    @property
    def name(self) -> str:
        """The node's full name."""
        return self._name

    def wait(self, revision: int, timeout_s: float) -> Snapshot:
        """The newest snapshot, as soon as it is newer than `revision`, or after `timeout_s`."""
        with self._changed:
            self._changed.wait_for(lambda: self._snapshot.revision > revision, timeout_s)
            return self._snapshot

    def change(self, values: Mapping[str, RosValue]) -> str:
        """Set parameters, all or none; '' where they were accepted, else the reason of the refusal."""
        if not self._parameters.services_are_ready():
            return f'{self._name} is not there to be changed.'
        kinds = {row.name: row.kind for row in self._snapshot.descriptors}
        wanted = {
            name: float(value) if kinds.get(name) is ParameterKind.REAL and type(value) is int else value
            for name, value in values.items()
        }
        messages = [Parameter(name, value=value) for name, value in wanted.items()]
        with self._changed:
            self._asked = wanted
        try:
            response = self._call(lambda: self._parameters.set_parameters_atomically(messages))
            if response is None:
                return f'{self._name} does not answer, so that the change may not be in force.'
            if not response.result.successful:
                return str(response.result.reason) or 'The node gave no reason.'
            self._take_values(wanted)
        finally:
            with self._changed:
                self._asked = {}
        return ''

    def publish(self, cloud: bytes) -> str:
        """Send a serialized PointCloud2 to the node; '' where it was delivered, else what was in the way."""
        topic = f'{self._namespace}/points'
        with self._publishing:
            if self._publisher is None:
                self._publisher = self._node.create_publisher(PointCloud2, topic, _reliable())
            self._published_at = time.monotonic()
            end = time.monotonic() + _LISTENING
            # We listen to our own clouds; the node is the other subscriber.
            while self._publisher.get_subscription_count() < 2:
                if time.monotonic() > end or self._stopping.wait(0.02):
                    return f'Nobody but this page listens on {topic}; the cloud was not sent.'
            self._publisher.publish(cloud)
            delivered = self._publisher.wait_for_all_acked(Duration(seconds=_LISTENING))
            self._published_at = time.monotonic()
            return '' if delivered else f'Not every listener on {topic} has received the cloud.'

    def save(self) -> str:
        """Have the node write its parameters to its file; its answer in words."""
        if not self._saving.service_is_ready():
            return f'{self._name} is not there to save its parameters.'
        response = self._call(lambda: self._saving.call_async(Trigger.Request()))
        return response.message if response is not None else f'{self._name} does not answer.'

    def close(self) -> None:
        """Leave the graph."""
        self._stopping.set()
        rclpy.shutdown(context=self._context)
        for thread in self._threads:
            thread.join()
        self._node.destroy_node()

    def __enter__(self) -> 'RemoteNode':  # noqa: PYI034 - Self is not in Python 3.10
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # What comes in, on the executor's thread

    def _subscribe(self) -> None:
        node, space = self._node, self._namespace
        for topic in (f'{space}/points', f'{space}/stack/points', f'{self._name}/last_points'):
            node.create_subscription(PointCloud2, topic, self._cloud_arrived, _reliable(), raw=True)
        node.create_subscription(ImageMessage, f'{space}/outlier_mask', self._mask_arrived, _reliable(), raw=True)
        node.create_subscription(
            DiagnosticStatus, f'{self._name}/measurement', self._measured, _reliable(), raw=True
        )
        node.create_subscription(DiagnosticArray, '/diagnostics', self._diagnosed, 10)
        node.create_subscription(
            ParameterEvent, '/parameter_events', self._parameters_changed, qos_profile_parameter_events
        )

    def _spin(self) -> None:
        with contextlib.suppress(ExternalShutdownException):
            self._executor.spin()

    def _cloud_arrived(self, message: bytes) -> None:
        with contextlib.suppress(MessageError), self._changed:  # the node refuses it, and says why
            self._inputs[stamp_of(message)] = message
            self._inputs.move_to_end(stamp_of(message))
            while len(self._inputs) > _CLOUDS or sum(map(len, self._inputs.values())) > _CLOUD_BYTES:
                self._inputs.popitem(last=False)
            self._pair()

    def _mask_arrived(self, message: bytes) -> None:
        with contextlib.suppress(MessageError), self._changed:
            self._mask = (Image.decode(message).header.stamp, decode_mono8(message))
            self._pair()

    def _measured(self, message: bytes) -> None:
        with contextlib.suppress(MessageError, ValueError), self._changed:
            status = Status.decode(message)
            seconds, _, nanoseconds = status.values.get('stamp', '').partition('.')
            self._measurement = (int(seconds) * 1_000_000_000 + int(nanoseconds), status)
            self._pair()

    def _pair(self) -> None:
        """Make an answer of a cloud, its mask and its measurement, which come in any order."""
        if self._mask is None or self._measurement is None:
            return
        stamp, mask = self._mask
        measured_stamp, measurement = self._measurement
        cloud = self._inputs.get(stamp)
        before = self._snapshot.shown_cloud
        if cloud is None or measured_stamp != stamp:
            return
        # A cloud that is filtered again has the stamp that it had, so that one of the two may be the last time's.
        if before and (before.mask is mask or before.measurement is measurement):
            return
        self._update(shown_cloud=ShownCloud(before.number + 1 if before else 1, cloud, mask, measurement))

    def _diagnosed(self, array: DiagnosticArray) -> None:
        for status in array.status:
            if status.hardware_id == self._name:
                state = next((pair.value for pair in status.values if pair.key == 'state'), '')
                with self._changed:
                    self._heartbeat = time.monotonic()
                    self._health = (int.from_bytes(status.level, 'little'), status.message, state)

    def _parameters_changed(self, event: ParameterEvent) -> None:
        if event.node == self._name:
            changed = {item.name: item.value for item in [*event.new_parameters, *event.changed_parameters]}
            self._take_values(
                {name: plain for name, value in changed.items() if (plain := _plain(value)) is not None}
            )

    # The node itself

    def _watch(self) -> None:
        """Look after the node: whether it is there, and what its parameters are."""
        try:
            while not self._stopping.wait(_WATCHING):
                self._look()
        except Exception:
            if self._context.ok():  # else the graph was left meanwhile
                raise

    def _look(self) -> None:
        self._retire_publisher()
        beating = time.monotonic() - self._heartbeat < _HEARTBEAT_LOST
        alive = beating and self._parameters.services_are_ready()
        if alive:
            endpoints = self._endpoints()
            if (endpoints - self._seen or not self._snapshot.descriptors) and self._describe():
                again = bool(self._seen)
                self._seen |= endpoints
                self._asks_left = _ASKS
                self._happened('The node was started again.' if again else 'The node is there.')
        with self._changed:
            presence, level, sentence = self._presence(alive)
            before = self._snapshot.presence
            if (presence, level, sentence) != (before, self._snapshot.level, self._snapshot.sentence):
                if not alive and before in (Presence.ACTIVE, Presence.INACTIVE):
                    self._happened('The node no longer answers.', bad=True)
                self._update(presence=presence, level=level, sentence=sentence)
        if presence is Presence.ACTIVE:
            self._ask_for_the_last_cloud()

    def _ask_for_the_last_cloud(self) -> None:
        """See the cloud that came before this page; again where it was lost while we were being discovered."""
        due = self._asks_left and time.monotonic() - self._asked_at > _ASKING
        if self._snapshot.shown_cloud is None and due and self._showing.service_is_ready():
            self._asked_at = time.monotonic()
            response = self._call(lambda: self._showing.call_async(Trigger.Request()))
            told = response is not None and not response.success  # that there is none
            self._asks_left = 0 if told else self._asks_left - 1

    def _presence(self, alive: bool) -> tuple[Presence, int, str]:
        level, message, state = self._health
        if alive and not self._snapshot.descriptors:
            return Presence.SILENT, WARN, 'Waiting for the node to tell its parameters.'
        if alive:
            if self._snapshot.values.get('output.mask') is False:
                level, message = max(level, WARN), 'Switch output.mask on: without it this page sees no outliers.'
            return (Presence.ACTIVE if state == 'active' else Presence.INACTIVE), level, message
        if self._parameters.services_are_ready():
            return Presence.SILENT, WARN, self._silent()
        return Presence.ABSENT, WARN, self._absent()

    def _silent(self) -> str:
        if self._seen:
            return 'Waiting: the node has stopped answering; if it was ended, start it again.'
        return 'Waiting: the node does not answer yet. Its very first start compiles for about 20 s.'

    def _absent(self) -> str:
        others = [
            f'{space.rstrip("/")}/{name}'
            for name, space in self._node.get_node_names_and_namespaces()
            if name == self._name.rpartition('/')[2] and f'{space.rstrip("/")}/{name}' != self._name
        ]
        elsewhere = f' There is {" and ".join(sorted(others))}: choose with --node.' if others else ''
        remap = f' --ros-args -r __ns:={self._namespace}' if self._namespace else ''
        return f'Waiting for {self._name}; start it with: socialcircle node{remap}.{elsewhere}'

    def _endpoints(self) -> set[bytes]:
        """What tells one incarnation of the node from the next."""
        return {
            bytes(publisher.endpoint_gid)
            for publisher in self._node.get_publishers_info_by_topic('/diagnostics')
            if f'{publisher.node_namespace.rstrip("/")}/{publisher.node_name}' == self._name
        }

    def _describe(self) -> bool:
        """Ask for every parameter; whether the node has told them."""
        listed = self._call(self._parameters.list_parameters)
        if listed is None:
            return False
        names = list(listed.result.names)
        described = self._call(lambda: self._parameters.describe_parameters(names))
        got = self._call(lambda: self._parameters.get_parameters(names))
        if described is None or got is None:
            return False
        rows, values = [], {}
        for message, value in zip(described.descriptors, got.values, strict=False):
            row, plain = descriptor_of(message, value.type), _plain(value)
            if row is not None and plain is not None:
                rows.append(row)
                values[row.name] = float(plain) if row.kind is ParameterKind.REAL else plain  # type: ignore[arg-type]
        with self._changed:
            if not self._snapshot.values:
                self._update(descriptors=tuple(rows), values=values)
            else:
                self._update(descriptors=tuple(rows))
                self._take_values(values)
        return True

    def _take_values(self, values: Mapping[str, RosValue]) -> None:
        """Note values in force, and who changed them."""
        kinds = {row.name: row.kind for row in self._snapshot.descriptors}
        with self._changed:
            known = dict(self._snapshot.values)
            for name, value in values.items():
                if name not in kinds:
                    continue
                taken = float(value) if kinds[name] is ParameterKind.REAL else value  # type: ignore[arg-type]
                if known.get(name) != taken:
                    who = 'this page' if self._asked.get(name) == value else 'elsewhere'
                    self._happened(f'{name}: {known.get(name)} → {taken} ({who})')
                    known[name] = taken
            if known != self._snapshot.values:
                self._update(values=known)

    def _retire_publisher(self) -> None:
        """No longer count as a publisher of clouds, whose silence the node would report."""
        with self._publishing:
            if self._publisher is not None and time.monotonic() - self._published_at > _QUIET:
                self._node.destroy_publisher(self._publisher)
                self._publisher = None

    def _call(self, ask: Callable[[], Any]) -> Any:
        """Call a service from a thread that is not the executor's; None where no answer comes."""
        for _ in range(_TRIES):
            answered = threading.Event()
            future = ask()
            future.add_done_callback(lambda _, answered=answered: answered.set())
            if answered.wait(_CALL):
                return future.result()
            if self._stopping.is_set():
                return None
        return None

    def _happened(self, text: str, *, bad: bool = False) -> None:
        with self._changed:
            self._events.append(LogEntry(time.time(), text, bad))
            self._event_count += 1
            self._update(log=tuple(self._events), log_total=self._event_count)

    def _update(self, **changes: Any) -> None:
        with self._changed:
            revision = self._snapshot.revision + 1
            self._snapshot = dataclasses.replace(self._snapshot, revision=revision, **changes)
            self._changed.notify_all()


def descriptor_of(message: ParameterDescriptor, kind: int) -> Descriptor | None:
    """What a node says of a parameter; None where it is of a kind that has no control.

    Args:
        message: its descriptor.
        kind: type of its value, of ParameterType: that of the descriptor is not set where typing is dynamic.
    """
    if kind not in _KINDS:
        return None
    sentence, unit = sentence_and_unit(message.description)
    real = message.dynamic_typing and kind in (ParameterType.PARAMETER_INTEGER, ParameterType.PARAMETER_DOUBLE)
    ranges = message.floating_point_range or message.integer_range
    allowed = message.additional_constraints
    return Descriptor(
        name=message.name,
        kind=ParameterKind.REAL if real else _KINDS[kind],
        sentence=sentence,
        unit=unit,
        allowed=allowed,
        choices=choices_in(allowed) if kind == ParameterType.PARAMETER_STRING else (),
        low=ranges[0].from_value if ranges else None,
        high=ranges[0].to_value if ranges else None,
        step=ranges[0].step if ranges else 0,
        read_only=message.read_only,
    )


def _plain(value: Any) -> RosValue | None:
    """A ParameterValue with Python's own types; None where it is not set, or of a kind without a control."""
    if value.type not in _KINDS:
        return None
    plain = parameter_value_to_python(value)
    return plain if isinstance(plain, (bool, int, float, str)) else [int(item) for item in plain]


def _reliable() -> QoSProfile:
    return QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
