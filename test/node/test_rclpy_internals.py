# SPDX-License-Identifier: Apache-2.0
"""Serialized messages by rcl's functions and by rclpy's public way: the same bytes; what an rclpy lacks."""

import contextlib
import ctypes
import gc
import time
from types import SimpleNamespace

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import LifecycleNode
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import String

from socialcircle_ros.node import rclpy_internals
from socialcircle_ros.node.rclpy_internals import PublicInput, RCLError, SerializedInput, listen, publish, take

pytestmark = pytest.mark.live

TEXTS = ('', 'short', 'x' * 3_000_000, 'short again')


class Pair:
    """An active lifecycle publisher, and an input that hears it."""

    def __init__(self):
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = LifecycleNode('pair', context=self.context)
        self.publisher = self.node.create_lifecycle_publisher(String, 'words', 10)
        self.node.trigger_configure()
        self.node.trigger_activate()
        self.heard = []
        self.input = self.listen()
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)

    def listen(self):
        return listen(self.node, String, 'words', self.heard.append, qos_profile=QoSProfile(depth=10))

    def spin_until(self, condition):
        end = time.monotonic() + 120
        while time.monotonic() < end:
            if condition():
                return
            self.executor.spin_once(timeout_sec=0.01)
        pytest.fail('nothing came')

    def close(self):
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


@pytest.fixture(params=['rcl', 'no librcl.so', 'no symbol'])
def pair(request, monkeypatch):
    """With rcl's functions, and by rclpy's public way where the library or one function is missing."""
    hide(request.param, monkeypatch)
    pair = Pair()
    assert isinstance(pair.input, SerializedInput if request.param == 'rcl' else PublicInput)
    pair.spin_until(lambda: pair.publisher.get_subscription_count() == 1)
    yield pair
    pair.close()
    rclpy_internals._rcl.cache_clear()


def hide(what, monkeypatch):
    """Make ctypes find no librcl.so, or not the function that publishes."""
    load = ctypes.CDLL

    def loaded(name, *arguments):
        if name == 'librcl.so' and what == 'no librcl.so':
            raise OSError(f'{name}: cannot open shared object file')
        library = load(name, *arguments)
        if name == 'librcl.so' and what == 'no symbol':
            return SimpleNamespace(rcl_take_serialized_message=library.rcl_take_serialized_message)
        return library

    monkeypatch.setattr(ctypes, 'CDLL', loaded)
    rclpy_internals._rcl.cache_clear()


def said(taken):
    return deserialize_message(bytes(taken.message), String).data


def test_messages_of_any_length_arrive_as_they_were_published(pair):
    for text in TEXTS:
        publish(pair.publisher, serialize_message(String(data=text)))
    pair.spin_until(lambda: len(pair.heard) == len(TEXTS))

    assert tuple(said(taken) for taken in pair.heard) == TEXTS


def test_a_message_that_was_taken_has_memory_of_its_own_and_can_be_published(pair):
    for text in ('one', 'two'):
        publish(pair.publisher, serialize_message(String(data=text)))
    pair.spin_until(lambda: len(pair.heard) == 2)

    del pair.heard[0]
    gc.collect()
    publish(pair.publisher, pair.heard[0].message)
    pair.spin_until(lambda: len(pair.heard) == 2)

    assert [said(taken) for taken in pair.heard] == ['two', 'two']


def test_a_publisher_that_is_not_active_is_silent(pair):
    pair.node.trigger_deactivate()
    assert not publish(pair.publisher, serialize_message(String(data='unheard')))
    pair.node.trigger_activate()
    assert publish(pair.publisher, serialize_message(String(data='heard')))
    pair.spin_until(lambda: pair.heard)

    assert [said(taken) for taken in pair.heard] == ['heard']


def test_each_message_tells_its_time_and_by_rcl_its_publisher_and_its_number(pair):
    began = time.time_ns()
    for text in ('one', 'two', 'three'):
        publish(pair.publisher, serialize_message(String(data=text)))
    pair.spin_until(lambda: len(pair.heard) == 3)

    assert all(began <= taken.published_ns <= time.time_ns() for taken in pair.heard)
    publishers = {taken.publisher for taken in pair.heard}
    numbers = [taken.number for taken in pair.heard]
    if isinstance(pair.input, PublicInput):
        assert (publishers, numbers) == ({b''}, [None] * 3)
    else:
        assert len(publishers) == 1
        assert numbers == [1, 2, 3]


def test_there_is_nothing_to_take_where_nothing_came(pair):
    assert take(pair.input.subscription) is None


def test_an_input_that_was_destroyed_hears_no_more_and_can_be_made_anew(pair):
    pair.input.destroy()
    pair.spin_until(lambda: pair.publisher.get_subscription_count() == 0)
    again = pair.listen()
    pair.spin_until(lambda: pair.publisher.get_subscription_count() == 1)
    publish(pair.publisher, serialize_message(String(data='once')))
    pair.spin_until(lambda: pair.heard)

    assert [said(taken) for taken in pair.heard] == ['once']
    again.destroy()


def test_a_publisher_whose_context_has_ended_is_silent():
    pair = Pair()
    rclpy.shutdown(context=pair.context)
    assert not publish(pair.publisher, serialize_message(String(data='too late')))
    pair.node.destroy_node()

    assert pair.heard == []


def test_what_the_middleware_refuses_is_an_error_with_its_number():
    class NoHandle(contextlib.nullcontext):
        pointer = 0

    with pytest.raises(RCLError, match=r'rcl error \d+'):
        take(SimpleNamespace(handle=NoHandle()))


# What an rclpy lacks


def test_the_installed_rclpy_is_as_expected(pair):
    by_rcl = isinstance(pair.input, SerializedInput)
    assert len(rclpy_internals.differences(pair.node)) == (0 if by_rcl else 1)


def test_each_missing_attribute_is_told_with_what_is_lost():
    sentences = rclpy_internals.differences(SimpleNamespace())
    for name in (
        '_state_machine',
        '_service_change_state',
        '_parameter_overrides',
        'services that set parameters',
    ):
        assert any(name in sentence for sentence in sentences)


def test_a_missing_attribute_is_no_error():
    destroyed = []
    bare = SimpleNamespace(context=SimpleNamespace(destroy=lambda: destroyed.append(True)))
    assert rclpy_internals.lifecycle_state(bare) == rclpy_internals.UNKNOWN_STATE
    assert rclpy_internals.given_parameters(bare) == {}
    assert rclpy_internals.services_that_set_parameters(bare) == {}
    rclpy_internals.refuse_invalid_transitions(bare, pytest.fail)
    rclpy_internals.release_context(bare)
    assert destroyed
