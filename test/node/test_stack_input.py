# SPDX-License-Identifier: Apache-2.0
"""What waits for the thread that measures frames is bounded and counted."""

import threading

import pytest
import rclpy
from rclpy.lifecycle import LifecycleNode

from socialcircle_ros.node.health import Health
from socialcircle_ros.node.parameters import Configuration
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
    begun, through = threading.Semaphore(0), threading.Event()

    def configuration():
        begun.release()
        through.wait()
        return Configuration()

    health = Health()
    stacks = StackInput(node, configuration, health, lambda *_: None)
    take = getattr(stacks, arrived)
    take(b'')
    begun.acquire()
    for _ in range(most + 5):
        take(b'')
    assert getattr(health.counts, dropped) == 5
    through.set()
    stacks.close()
