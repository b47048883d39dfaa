# SPDX-License-Identifier: Apache-2.0
"""What waits for the thread that measures frames is bounded and counted."""

import threading

import numpy as np
import pytest
import rclpy
from rclpy.lifecycle import LifecycleNode
from sensor_msgs.msg import Image

from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.image import encode_image
from socialcircle_ros.node import stack_input
from socialcircle_ros.node.health import Health
from socialcircle_ros.node.parameters import Configuration
from socialcircle_ros.node.rclpy_internals import TakenMessage
from socialcircle_ros.node.stack_input import MOST_STATES_WAITING, MOST_WAITING, StackInput


@pytest.fixture
def node():
    context = rclpy.Context()
    rclpy.init(context=context)
    node = LifecycleNode('stacks', context=context)
    yield node
    node.destroy_node()
    rclpy.shutdown(context=context)


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


COUNTED = Configuration.from_ros(
    {'stack.pitch_x': 1e-6, 'stack.z_step': 1e-6, 'stack.timeout': 0.0, 'stack.check_stamps': False}
)


class Stacks(StackInput):
    """What a node does with frames, with a worker that can be made to wait."""

    def __init__(self, node):
        self.health, self.through = Health(), threading.Event()
        self.through.set()
        super().__init__(node, self.settings, self.health, lambda *_: None)

    def settings(self):
        self.through.wait()
        return COUNTED

    def arrives(self, number):
        self._frame_arrived(TakenMessage(memoryview(frame(number)), b'camera', number))

    def wait(self):
        self._ask(lambda _: iter(()))


def frame(number):
    texture = np.random.default_rng(0).integers(0, 200, (24, 30))
    return encode_image(Header.at(number, ''), (texture / (1 + (number - 5) ** 2)).astype(np.uint8))


@pytest.fixture
def stacks(node):
    stacks = Stacks(node)
    yield stacks
    stacks.through.set()
    stacks.close()


def test_lost_and_dropped_frames_are_counted_and_the_stack_is_measured_with_the_gap(stacks, monkeypatch):
    monkeypatch.setattr(stack_input, 'MOST_WAITING', 1)
    stacks.arrives(0)
    stacks.wait()
    stacks.through.clear()
    for number in (1, 2, 3, 5):
        stacks.arrives(number)  # one is at hand or waits, and one may wait
    dropped = stacks.health.counts.frames_dropped
    stacks.through.set()
    for number in (6, 7, 8):
        stacks.wait()
        stacks.arrives(number)
    stacks.wait()
    (cloud,) = stacks.finish()
    assert dropped in (2, 3)
    assert (cloud.frames, stacks.health.counts.frames_lost) == (8 - dropped, 1)
    assert f'{dropped + 1} frames of a stack were lost on the way' in cloud.warning


def test_frames_that_the_middleware_replaces_are_counted_as_lost(node, stacks):
    stacks.listen()
    publisher = node.create_publisher(Image, 'stack/image', 100)
    counts = stacks.health.counts

    def take_until_known(count):
        for _ in range(10_000):
            stacks.finish()
            if counts.frames_received + counts.frames_lost >= count:
                break

    publisher.publish(frame(0))
    take_until_known(1)
    for number in range(1, 71):
        publisher.publish(frame(number))
    take_until_known(71)
    assert counts.frames_lost > 0
    assert counts.frames_received + counts.frames_lost == 71
