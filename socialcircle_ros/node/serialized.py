"""Serialized messages taken and published where they lie: rclpy copies them, and holds the interpreter meanwhile.

For a cloud of 20 MB that is 2 to 3 ms each way, in which no other thread of this process can run. These are
rclpy's own handles, and the functions of rcl that rclpy calls itself.
"""

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np
from rclpy._rclpy_pybind11 import RCLError
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.subscription import Subscription
from rclpy.waitable import NumberOfEntities, Waitable

# rcl/types.h: RCL_RET_OK, RCL_RET_PUBLISHER_INVALID, RCL_RET_SUBSCRIPTION_TAKE_FAILED
_OK, _PUBLISHER_INVALID, _NOTHING_TO_TAKE = 0, 300, 401

_rcl = ctypes.CDLL('librcl.so')
_rcutils = ctypes.CDLL('librcutils.so')


class _Allocator(ctypes.Structure):
    """rcutils_allocator_t."""

    _fields_ = (('functions', ctypes.c_void_p * 4), ('state', ctypes.c_void_p))


class _Bytes(ctypes.Structure):
    """rcl_serialized_message_t: owns memory, and gives it back with the last who looks at it."""

    _fields_ = (
        ('buffer', ctypes.c_void_p),
        ('buffer_length', ctypes.c_size_t),
        ('buffer_capacity', ctypes.c_size_t),
        ('allocator', _Allocator),
    )

    def __del__(self) -> None:
        if self.allocator.functions[1]:  # it came from rcl, and is not a view of somebody else's memory
            _rcutils.rcutils_uint8_array_fini(ctypes.byref(self))


_HANDLE, _BYTES, _POINTER = ctypes.c_size_t, ctypes.POINTER(_Bytes), ctypes.c_void_p
_rcutils.rcutils_get_default_allocator.restype = _Allocator
_rcutils.rcutils_uint8_array_fini.argtypes = [_BYTES]
_rcl.rcl_take_serialized_message.argtypes = [_HANDLE, _BYTES, _POINTER, _POINTER]
_rcl.rcl_publish_serialized_message.argtypes = [_HANDLE, _BYTES, _POINTER]
_rcl.rcl_publisher_is_valid_except_context.argtypes = [_HANDLE]
_rcl.rcl_publisher_is_valid_except_context.restype = ctypes.c_bool


def take(subscription: Subscription) -> memoryview | None:
    """The next message of a subscription, serialized, in memory of its own that may be written to; None: none.

    Raises:
        RCLError: it cannot be taken.
    """
    taken = _Bytes(allocator=_rcutils.rcutils_get_default_allocator())
    with subscription.handle:
        pointer = subscription.handle.pointer
        _check(_rcl.rcl_take_serialized_message(pointer, ctypes.byref(taken), None, None), _NOTHING_TO_TAKE)
    if not taken.buffer:
        return None
    array = (ctypes.c_uint8 * taken.buffer_length).from_address(taken.buffer)
    array.owner = taken
    return np.frombuffer(array, np.uint8).data


def publish(publisher: Any, message: bytes | memoryview) -> None:
    """Publish a serialized message through a lifecycle publisher.

    As with rclpy, nothing is said while it is not active, and once the context has ended.

    Raises:
        RCLError: it cannot be published.
    """
    if not publisher.is_activated:
        return
    values = np.frombuffer(message, np.uint8)
    given = _Bytes(values.ctypes.data, len(values), len(values))
    with publisher.handle:
        pointer = publisher.handle.pointer
        code = _rcl.rcl_publish_serialized_message(pointer, ctypes.byref(given), None)
        if code == _PUBLISHER_INVALID and _rcl.rcl_publisher_is_valid_except_context(pointer):
            _rcutils.rcutils_reset_error()
            return
    _check(code)


def _check(code: int, *also_good: int) -> None:
    if code != _OK:
        _rcutils.rcutils_reset_error()
    if code not in (_OK, *also_good):
        raise RCLError(f'The middleware refused a serialized message (rcl error {code}).')


class SerializedInput(Waitable):
    """Hands each message of a subscription to its callback, by `take`, which the executor would do by rclpy.

    Args:
        node: who subscribes.
        kind: type of the messages.
        topic: where.
        callback: gets each message, on the executor's thread.
        options: the rest of what `create_subscription` takes.
    """

    def __init__(
        self, node: Any, kind: Any, topic: str, callback: Callable[[memoryview], None], **options: Any
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
        """Listen no more."""
        self._node.remove_waitable(self)
        self._node.destroy_subscription(self.subscription)

    # What the executor asks of a Waitable.

    def __enter__(self) -> None:
        self.subscription.handle.__enter__()

    def __exit__(self, *raised: object) -> None:
        self.subscription.handle.__exit__(*raised)

    def get_num_entities(self) -> NumberOfEntities:
        """How much room in the wait set."""
        return NumberOfEntities(num_subs=1)

    def add_to_wait_set(self, wait_set: Any) -> None:
        """Have the executor wait for a message."""
        self._place = wait_set.add_subscription(self.subscription.handle)

    def is_ready(self, wait_set: Any) -> bool:
        """Whether there is one."""
        return self._place is not None and wait_set.is_ready('subscription', self._place)

    def take_data(self) -> memoryview | None:
        """Take it."""
        return take(self.subscription)

    async def execute(self, taken: memoryview | None) -> None:
        """Hand it over."""
        if taken is not None:
            self._callback(taken)


class _EventsOnly(ReentrantCallbackGroup):
    """Has the executor attend to a subscription's events, such as incompatible QoS, but not to its messages."""

    def can_execute(self, entity: Any) -> bool:
        return not isinstance(entity, Subscription)
