# SPDX-License-Identifier: Apache-2.0
"""What waits for the thread that measures frames is bounded and counted."""

import threading
import time

import pytest
import rclpy
from rclpy.lifecycle import LifecycleNode
from sensor_msgs.msg import Image

from socialcircle_ros.node import stack_input
from socialcircle_ros.node.health import Health
from socialcircle_ros.node.parameters import Configuration
from socialcircle_ros.node.rclpy_internals import RCLError, TakenMessage
from socialcircle_ros.node.stack_input import MOST_STATES_WAITING, MOST_WAITING, StackInput


@pytest.fixture
def node():
    context = rclpy.Context()
    rclpy.init(context=context)
    node = LifecycleNode('stacks', context=context)
    yield node
    node.destroy_node()
    rclpy.shutdown(context=context)


def wait_for(condition):
    until = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < until


@pytest.mark.parametrize(
    ('arrived', 'dropped', 'most'),
    [('_joint_state_arrived', 'joint_states_dropped', MOST_STATES_WAITING),
     ('_frame_arrived', 'frames_dropped', MOST_WAITING)],
)  # fmt: skip
def test_what_comes_while_too_much_waits_is_dropped_and_counted(node, arrived, dropped, most):
    message = TakenMessage(memoryview(b'')) if arrived == '_frame_arrived' else b''
    begun, through = threading.Semaphore(0), threading.Event()

    def configuration():
        begun.release()
        through.wait()
        return Configuration()

    health = Health()
    stacks = StackInput(node, configuration, health, lambda *_: None)
    take = getattr(stacks, arrived)
    take(message)
    begun.acquire()
    for _ in range(most + 5):
        take(message)
    assert getattr(health.counts, dropped) == 5
    through.set()
    stacks.close()


class Assembler:
    """Takes frames, and notes how many are missing before each."""

    running, timeout, cloud_size = False, 0.0, 0

    def __init__(self):
        self.missing = []

    @property
    def frames(self):
        return len(self.missing)

    def configure(self, *settings):
        pass

    def add_frame(self, _, missing):
        self.missing.append(missing)
        return iter(())

    def finish(self):
        return iter(())


class Stacks(StackInput):
    """What a node does with frames, with a worker that can be made to wait."""

    def __init__(self, node):
        self.health, self.begun, self.through = Health(), threading.Event(), threading.Event()
        self.through.set()
        super().__init__(node, self.settings, self.health, lambda *_: None)

    def settings(self):
        self.begun.set()
        self.through.wait()
        return Configuration()

    def hold(self, number):
        """Let a frame arrive with which the worker is busy until it is let through."""
        self.wait()
        self.begun.clear()
        self.through.clear()
        self.arrives(number)
        self.begun.wait()

    def arrives(self, *numbers):
        for number in numbers:
            self._frame_arrived(TakenMessage(memoryview(b''), b'camera', number))

    def wait(self):
        self._ask(lambda _: iter(()))


@pytest.fixture
def stacks(node, monkeypatch):
    monkeypatch.setattr(stack_input, 'StackAssembler', Assembler)
    stacks = Stacks(node)
    yield stacks
    stacks.through.set()
    stacks.close()


def test_lost_and_dropped_frames_are_counted_and_missing_before_the_next_one(stacks, monkeypatch):
    monkeypatch.setattr(stack_input, 'MOST_WAITING', 1)
    stacks.arrives(0)
    stacks.hold(1)
    stacks.arrives(2, 3, 5)
    stacks.through.set()
    stacks.wait()
    stacks.arrives(6)
    stacks.wait()
    stacks.arrives(9)
    stacks.wait()
    assert (stacks.health.counts.frames_dropped, stacks.health.counts.frames_lost) == (2, 3)
    assert stacks._assembler.missing == [0, 0, 0, 3, 2]


def test_frames_that_were_dropped_before_a_reset_are_not_missing_after_it(stacks, monkeypatch):
    monkeypatch.setattr(stack_input, 'MOST_WAITING', 1)
    stacks.hold(0)
    stacks.arrives(1, 2, 3)
    stacks.through.set()
    stacks.forget()
    stacks.arrives(4)
    stacks.wait()
    assert stacks.health.counts.frames_dropped == 2
    assert stacks._assembler.missing == [0]


def test_frames_that_the_middleware_replaces_are_counted_as_lost(node, stacks):
    stacks.listen()
    publisher = node.create_publisher(Image, 'stack/image', 100)
    counts = stacks.health.counts

    def take_until_known(count):
        def known():
            stacks.finish()
            return counts.frames_received + counts.frames_lost >= count

        wait_for(known)

    wait_for(lambda: publisher.get_subscription_count() == 1)
    publisher.publish(Image())
    take_until_known(1)
    for _ in range(70):
        publisher.publish(Image())
    take_until_known(71)
    assert counts.frames_lost > 0
    assert counts.frames_received + counts.frames_lost == 71


def test_a_stack_that_runs_when_the_node_is_deactivated_is_counted_and_told(stacks):
    stacks.arrives(*range(4))
    stacks.ignore()
    counts, reason = stacks.health.counts, '4 frames of a stack were dropped: the stack was not finished when'
    assert (counts.frames_received, counts.frames_dropped) == (4, 4)
    assert stacks.health.last_reason == f'{reason} the node was deactivated.'
    assert stacks.health.had_trouble()
    assert not stacks.health.in_trouble()
    stacks.ignore()
    assert counts.frames_dropped == 4


def test_what_runs_and_what_waits_when_the_node_ends_is_counted_and_told(stacks):
    stacks.arrives(*range(3))
    stacks.hold(3)
    stacks.arrives(*range(4, 7))
    closing = threading.Thread(target=stacks.close)
    closing.start()
    stacks.through.set()
    closing.join()
    assert stacks.health.counts.frames_dropped == 7
    assert stacks.health.last_reason.endswith('was not finished when the node was shut down.')


def test_a_frame_that_is_still_measured_when_the_node_ends_is_counted(stacks):
    stacks.arrives(*range(3))
    stacks.hold(3)
    stacks.arrives(4)
    assert not stacks.close(lambda: False)
    assert stacks.health.counts.frames_dropped == 5


@pytest.mark.parametrize('end', ['ignore', 'close'])
def test_frames_that_cannot_be_taken_at_the_end_are_told_and_the_worker_ends(stacks, monkeypatch, end):
    def take(_):
        raise RCLError('no memory')

    monkeypatch.setattr(stack_input, 'take', take)
    stacks.listen()
    getattr(stacks, end)()
    assert stacks.subscriptions == []
    assert stacks.health.last_reason == 'The last frames of a stack could not be taken: no memory'
    assert stacks.close()


def test_a_stack_that_is_forgotten_on_request_is_no_trouble(stacks):
    stacks.hold(0)
    stacks.arrives(1, 2)
    forgetting = threading.Thread(target=stacks.forget)
    forgetting.start()
    stacks.through.set()
    forgetting.join()
    stacks.close()
    assert stacks.health.counts.frames_dropped == 0
