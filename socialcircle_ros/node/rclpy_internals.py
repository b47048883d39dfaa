# SPDX-License-Identifier: Apache-2.0
"""Every touch of rclpy's internals, what is expected of them, and rclpy's public way where that is not met.

Large messages: rclpy copies each serialized message and holds the interpreter's lock meanwhile. That takes 2 to 3
ms each way for a cloud of 20 MB, and no other thread of the process runs. `SerializedInput` and `publish` call the
functions of rcl that rclpy calls itself, with rclpy's own handles.

Facts without a public way: the state of the lifecycle, and the parameters that the node was started with.

`differences` names what an installed rclpy lacks; the node logs it and shows it in its diagnostics.
"""

import ctypes
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import Protocol, TypedDict

import numpy as np
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.exceptions import InvalidHandle
from rclpy.lifecycle import LifecycleNode, LifecyclePublisher
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.waitable import NumberOfEntities, Waitable

try:
    from rclpy._rclpy_pybind11 import RCLError as RCLError  # noqa: PLC0414 - other modules take it from here
except ImportError:  # its base in every version that was looked at
    RCLError = RuntimeError

# rcl/types.h: RCL_RET_OK, RCL_RET_PUBLISHER_INVALID, RCL_RET_SUBSCRIPTION_TAKE_FAILED
_OK, _PUBLISHER_INVALID, _NOTHING_TO_TAKE = 0, 300, 401

_NO_NUMBER = 2**64 - 1  # rmw/types.h: RMW_MESSAGE_INFO_SEQUENCE_NUMBER_UNSUPPORTED

UNKNOWN_STATE = 'unknown'

_EXPECTED = {
    '_state_machine': 'the state of the lifecycle is not shown',
    '_service_change_state': 'an invalid transition ends the node',
    '_parameter_overrides': 'misspelled parameters are not told, and qos_overrides are not saved',
}
"""Attributes of rclpy's nodes that are used here, and what is lost without each."""

_SETTING = (SetParameters, SetParametersAtomically)


class _Allocator(ctypes.Structure):
    """rcutils_allocator_t."""

    _fields_ = (('functions', ctypes.c_void_p * 4), ('state', ctypes.c_void_p))


class _Bytes(ctypes.Structure):
    """rcl_serialized_message_t: owns memory, and frees it with its last reference."""

    _fields_ = (
        ('buffer', ctypes.c_void_p),
        ('buffer_length', ctypes.c_size_t),
        ('buffer_capacity', ctypes.c_size_t),
        ('allocator', _Allocator),
    )

    def __del__(self) -> None:
        if self.allocator.functions[1]:  # without an allocator it is a view of memory that belongs elsewhere
            rcl = _rcl()
            if rcl is not None:
                rcl.free(ctypes.byref(self))


class _RmwMessageInfo(ctypes.Structure):
    """rmw_message_info_t."""

    _fields_ = (
        ('source_timestamp', ctypes.c_int64),
        ('received_timestamp', ctypes.c_int64),
        ('publication_sequence_number', ctypes.c_uint64),
        ('reception_sequence_number', ctypes.c_uint64),
        ('implementation', ctypes.c_char_p),
        ('publisher', ctypes.c_uint8 * 16),
        ('rest', ctypes.c_uint8 * 64),  # more than any version appends
    )


class _Rcl:
    """The functions of librcl and librcutils that are called here.

    Raises:
        OSError: a library is not found.
        AttributeError: a function is not in it.
    """

    def __init__(self) -> None:
        rcl, rcutils = ctypes.CDLL('librcl.so'), ctypes.CDLL('librcutils.so')
        handle, data, pointer = ctypes.c_size_t, ctypes.POINTER(_Bytes), ctypes.c_void_p
        self.default_allocator = rcutils.rcutils_get_default_allocator
        self.default_allocator.restype = _Allocator
        self.free = rcutils.rcutils_uint8_array_fini
        self.free.argtypes = [data]
        self.reset_error = rcutils.rcutils_reset_error
        self.take = rcl.rcl_take_serialized_message
        self.take.argtypes = [handle, data, pointer, pointer]
        self.publish = rcl.rcl_publish_serialized_message
        self.publish.argtypes = [handle, data, pointer]
        self.is_valid = rcl.rcl_publisher_is_valid_except_context
        self.is_valid.argtypes = [handle]
        self.is_valid.restype = ctypes.c_bool

    def check(self, code: int, *also_good: int) -> None:
        """Raise for an error code of rcl.

        Raises:
            RCLError: the code is not among the good ones.
        """
        if code != _OK:
            self.reset_error()
        if code not in (_OK, *also_good):
            raise RCLError(f'The middleware refused a serialized message (rcl error {code}).')


@cache
def _rcl() -> _Rcl | None:
    """The functions of rcl; None where they are not as expected."""
    try:
        return _Rcl()
    except (OSError, AttributeError):
        return None


def differences(node: Node) -> list[str]:
    """What this rclpy lacks of what is expected here, and what is lost by it, one sentence each."""
    sentences = []
    if _rcl() is None:
        sentences.append('rcl is not as expected, so messages go through rclpy: large clouds are slower.')
    if len(services_that_set_parameters(node)) != len(_SETTING):
        sentences.append('rclpy has no services that set parameters as expected: it words refusals itself.')
    missing = [name for name in _EXPECTED if not hasattr(node, name)]
    return [*sentences, *(f'rclpy has no {name} as expected: {_EXPECTED[name]}.' for name in missing)]


# Serialized messages


def publish(publisher: LifecyclePublisher, message: bytes | memoryview) -> bool:
    """Publish a serialized message through a lifecycle publisher; it is read during the call only.

    Returns:
        Whether it was published: as with rclpy, nothing is while the publisher is not active, and once the context
        has ended. rclpy's own way does not tell the latter.

    Raises:
        RCLError: it cannot be published.
    """
    if not publisher.is_activated:
        return False
    # From Kilted on a publisher ends with its context.
    with suppress(InvalidHandle):
        rcl = _rcl()
        if rcl is not None:
            return _publish_by_rcl(rcl, publisher, message)
        publisher.publish(bytes(message))
        return True
    return False


def _publish_by_rcl(rcl: _Rcl, publisher: LifecyclePublisher, message: bytes | memoryview) -> bool:
    values = np.frombuffer(message, np.uint8)
    given = _Bytes(values.ctypes.data, len(values), len(values))
    with publisher.handle:
        pointer = publisher.handle.pointer
        code = rcl.publish(pointer, ctypes.byref(given), None)
        if code == _PUBLISHER_INVALID and rcl.is_valid(pointer):
            rcl.reset_error()
            return False
    rcl.check(code)
    return True


@dataclass(frozen=True)
class TakenMessage:
    """A message that was taken from a subscription.

    Attributes:
        message: serialized, in memory of its own.
        publisher: identifies the publisher; empty if rclpy does not tell it.
        number: the publisher numbers its messages one by one; None if rclpy or the middleware does not tell it.
        published_ns: when it was published, by the clock of its publisher, ns since 1970; 0 if unknown.
    """

    message: memoryview
    publisher: bytes = b''
    number: int | None = None
    published_ns: int = 0


def take(subscription: Subscription) -> TakenMessage | None:
    """The next message of a subscription; None: there is none.

    Raises:
        RCLError: it cannot be taken.
    """
    rcl = _rcl()
    if rcl is None:
        message = next(waiting_messages(subscription), None)
        return None if message is None else TakenMessage(memoryview(message))
    taken, info = _Bytes(allocator=rcl.default_allocator()), _RmwMessageInfo()
    with subscription.handle:
        pointer = subscription.handle.pointer
        rcl.check(rcl.take(pointer, ctypes.byref(taken), ctypes.byref(info), None), _NOTHING_TO_TAKE)
    if not taken.buffer:
        return None
    array = (ctypes.c_uint8 * taken.buffer_length).from_address(taken.buffer)
    array.owner = taken
    number = info.publication_sequence_number
    return TakenMessage(
        np.frombuffer(array, np.uint8).data,
        bytes(info.publisher),
        None if number == _NO_NUMBER else number,
        info.source_timestamp,
    )


def waiting_messages(subscription: Subscription) -> Iterator[bytes]:
    """Take the messages that the middleware has delivered and the executor has not taken yet, serialized."""
    with subscription.handle:
        while (taken := subscription.handle.take_message(subscription.msg_type, True)) is not None:
            yield taken[0]


class _MessageInfo(TypedDict, total=False):
    """What rclpy tells of a message; the middleware may leave the source's time out."""

    source_timestamp: int


class MessageInput(Protocol):
    """A subscription that hands serialized messages to a callback."""

    subscription: Subscription

    def destroy(self) -> None:
        """End the subscription."""


def listen(
    node: Node,
    kind: type,
    topic: str,
    callback: Callable[[TakenMessage], None],
    **options: object,
) -> MessageInput:
    """Subscribe, and hand each serialized message to `callback` on the executor's thread.

    Args:
        node: the node that subscribes.
        kind: class of the messages.
        topic: its name.
        callback: takes each message, with what is known of it.
        options: further arguments of `create_subscription`.
    """
    if _rcl() is None:
        return PublicInput(node, kind, topic, callback, **options)
    return SerializedInput(node, kind, topic, callback, **options)


class PublicInput:
    """Hands each message of a subscription to its callback by rclpy's public way."""

    def __init__(
        self, node: Node, kind: type, topic: str, callback: Callable[[TakenMessage], None], **options: object
    ) -> None:
        def arrived(message: bytes, info: _MessageInfo) -> None:
            callback(TakenMessage(memoryview(message), published_ns=info.get('source_timestamp', 0)))

        self._node = node
        self.subscription: Subscription = node.create_subscription(kind, topic, arrived, raw=True, **options)

    def destroy(self) -> None:
        """End the subscription."""
        self._node.destroy_subscription(self.subscription)


class _WaitSet(Protocol):
    """rclpy's wait set, as far as it is used here."""

    def add_subscription(self, handle: object) -> int:
        """Add a subscription; its place in the set."""

    def is_ready(self, kind: str, place: int) -> bool:
        """Whether what was added at a place is ready."""


class SerializedInput(Waitable):
    """Hands each message of a subscription to its callback by `take`, in place of the executor's own way."""

    def __init__(
        self,
        node: Node,
        kind: type,
        topic: str,
        callback: Callable[[TakenMessage], None],
        **options: object,
    ) -> None:
        super().__init__(node.default_callback_group)
        self._node = node
        self._callback = callback
        self._place: int | None = None
        self.subscription: Subscription = node.create_subscription(
            kind, topic, callback, callback_group=_EventsOnly(), raw=True, **options
        )
        node.add_waitable(self)

    def destroy(self) -> None:
        """End the subscription."""
        self._node.remove_waitable(self)
        self._node.destroy_subscription(self.subscription)

    # The interface of a Waitable, called by the executor.

    def __enter__(self) -> None:
        self.subscription.handle.__enter__()

    def __exit__(self, *raised: object) -> None:
        self.subscription.handle.__exit__(*raised)

    def get_num_entities(self) -> NumberOfEntities:
        """How much room this needs in the wait set."""
        return NumberOfEntities(num_subs=1)

    def add_to_wait_set(self, wait_set: _WaitSet) -> None:
        """Add the subscription to the wait set."""
        self._place = wait_set.add_subscription(self.subscription.handle)

    def is_ready(self, wait_set: _WaitSet) -> bool:
        """Whether a message has come."""
        return self._place is not None and wait_set.is_ready('subscription', self._place)

    def take_data(self) -> TakenMessage | None:
        """Take the message."""
        return take(self.subscription)

    async def execute(self, taken: TakenMessage | None) -> None:
        """Hand the message to the callback."""
        if taken is not None:
            self._callback(taken)


class _EventsOnly(ReentrantCallbackGroup):
    """Lets the executor attend to a subscription's events, such as incompatible QoS, but not to its messages."""

    def can_execute(self, entity: object) -> bool:
        return not isinstance(entity, Subscription)


# The lifecycle


def lifecycle_state(node: LifecycleNode) -> str:
    """The state of a node, such as `active`."""
    machine = getattr(node, '_state_machine', None)
    return UNKNOWN_STATE if machine is None else str(machine.current_state[1])


def refuse_invalid_transitions(node: LifecycleNode, refused: Callable[[str], None]) -> None:
    """Answer an invalid transition with a refusal; rclpy raises, which ends spin() (ros2/rclpy #1209).

    Args:
        node: the node of the service.
        refused: called with the transition that is not possible.
    """
    service = getattr(node, '_service_change_state', None)
    if service is None:
        return
    change_state = service.callback

    def guarded(request: ChangeState.Request, response: ChangeState.Response) -> ChangeState.Response:
        try:
            return change_state(request, response)
        except RCLError:
            refused(str(request.transition.label or request.transition.id))
            response.success = False
            return response

    service.callback = guarded


def release_context(node: LifecycleNode) -> None:
    """Free a destroyed node's context, and with it the shared memory, before the interpreter exits."""
    machine = getattr(node, '_state_machine', None)
    if machine is not None:
        machine.destroy_when_not_in_use()  # it holds the node, and the node holds the context
    node.context.destroy()


# Parameters


def given_parameters(node: Node) -> dict[str, Parameter]:
    """The parameters that the node was started with, declared or not."""
    return dict(getattr(node, '_parameter_overrides', {}))


def services_that_set_parameters(node: Node) -> dict[type, Service]:
    """The services of rclpy that set parameters, by their types; their `callback` can be replaced."""
    services = [each for each in getattr(node, 'services', ()) if hasattr(each, 'callback')]
    return {each.srv_type: each for each in services if each.srv_type in _SETTING}
