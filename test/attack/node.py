# SPDX-License-Identifier: Apache-2.0
"""Attacks on a live node over DDS.

The clean run is the filter within this process: the node publishes the same bytes for the same cloud.
"""

from random import Random

from attack.generators import hostile_cloud, hostile_frame, hostile_joint_state, hostile_parameter
from attack.tally import Tally
from examples import cloud
from lifecycle_msgs.msg import Transition
from live import RELIABLE, Cell
from rclpy.parameter import Parameter
from sensor_msgs.msg import Image, JointState

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.interface import FILTERED, MASK, STACK_FRAMES, STACK_JOINT_STATES
from socialcircle_ros.pipeline.clouds import filter_cloud
from socialcircle_ros.settings import PARAMETERS

LEGAL = {
    ('unconfigured', Transition.TRANSITION_CONFIGURE): 'inactive',
    ('inactive', Transition.TRANSITION_CLEANUP): 'unconfigured',
    ('inactive', Transition.TRANSITION_ACTIVATE): 'active',
    ('active', Transition.TRANSITION_DEACTIVATE): 'inactive',
}
"""Transitions that succeed, without those that shut the node down."""

OTHERS = (0, 9, 10, 60, 99, 200)
"""Transitions that a client cannot ask for."""

GOOD_FROM_NS = 10**12
"""Good clouds have later stamps than hostile ones, so that their answers can be told apart."""


def check_node(cell: Cell, tally: Tally, stamp: int) -> bool:
    """Whether the node answers a good cloud of a stamp of its own, with the bytes of the clean run."""
    good = cloud(30, 40, stamp=GOOD_FROM_NS + stamp)
    clean = filter_cloud(good).messages
    cell.forget()
    try:
        cell.publish(good)
        header = good[4:12]
        found = cell.wait_for(
            lambda: (
                [[each for each in cell.inbox[topic.name] if each[4:12] == header] for topic in (FILTERED, MASK)]
                if all(any(each[4:12] == header for each in cell.inbox[topic.name]) for topic in (FILTERED, MASK))
                else None
            )
        )
    except AssertionError as error:
        tally.lost += 1
        tally.tell(f'a good cloud got no answer: {str(error)[-300:]}')
        return False
    if not all(same_message(each[-1], clean[topic]) for each, topic in zip(found, (FILTERED, MASK), strict=True)):
        tally.wrong += 1
        tally.tell('the node gives other bytes for a good cloud than the clean run')
    return True


def same_message(received: bytes, expected: bytes) -> bool:
    """Whether two messages are the same apart from the header of CDR and the padding at the end."""
    length = len(expected)
    return received[4:length] == expected[4:] and len(received) - length < 4


def attack_messages(random: Random, count: int, cell: Cell) -> Tally:
    """Hostile clouds, frames and joint states; a good cloud after each three must get its answer."""
    tally = Tally('messages, live node')
    publishers = {
        hostile_cloud: cell.clouds,
        hostile_frame: cell.peer.create_publisher(Image, STACK_FRAMES.name, RELIABLE),
        hostile_joint_state: cell.peer.create_publisher(JointState, STACK_JOINT_STATES.name, RELIABLE),
    }
    cell.set(stack__pitch_x=1e-6, stack__z_source='joint_states', stack__max_pixels=100_000)
    for number in range(count):
        for make, publisher in publishers.items():
            publisher.publish(make(random))
        alive = check_node(cell, tally, 10**9 * (number + 1))
        tally.tried += len(publishers)
        tally.survived += len(publishers) * alive
        if not alive:
            break
    for publisher in list(publishers.values())[1:]:
        cell.peer.destroy_publisher(publisher)
    restore(cell)
    return tally


def restore(cell: Cell) -> None:
    """Give the node the defaults, and end its stack."""
    cell.set(**{name.replace('.', '__'): row.default for name, row in PARAMETERS.items() if not row.read_only})
    cell.trigger('reset')


def attack_parameters(random: Random, count: int, cell: Cell) -> Tally:
    """Random values for random parameters, one by one and several at once, with a cloud to filter again."""
    tally = Tally('parameters, live node')
    check_node(cell, tally, 1)
    for number in range(count):
        changes = dict(sendable(random) for _ in range(random.choice((1, 1, 1, 5))))
        tally.tried += len(changes)
        try:
            results = cell.set(**changes) if random.random() < 0.5 else [cell.set_together(**changes)]
        except AssertionError as error:
            tally.lost += 1
            tally.tell(f'no answer to {changes}: {str(error)[-300:]}')
            return tally
        tally.survived += len(changes)
        if any(not result.successful and not result.reason for result in results):
            tally.wrong += 1
            tally.tell(f'a refusal without a reason: {changes}')
        if number % 10 == 9:
            restore(cell)
            check_node(cell, tally, 10**9 * (number + 1))
    restore(cell)
    check_node(cell, tally, 10**15)
    return tally


def sendable(random):
    """A hostile parameter that a ROS client can send."""
    while True:
        name, value = hostile_parameter(random)
        try:
            Parameter(name, value=value).to_parameter_msg()
        except (ValueError, TypeError, AssertionError, SocialCircleError):
            continue
        return name.replace('.', '__'), value


def attack_lifecycle(random: Random, count: int, cell: Cell) -> Tally:
    """Random transitions; each must end in the state that the ROS design gives it."""
    tally = Tally('transitions, live node')
    state = 'active'
    for _ in range(count):
        number = random.choice((*(number for _, number in LEGAL), *OTHERS))
        wanted = LEGAL.get((state, number))
        tally.tried += 1
        try:
            succeeded = cell.transition(number)
            found = cell.state()
        except AssertionError as error:
            tally.lost += 1
            tally.tell(f'no answer to transition {number} in {state}: {str(error)[-300:]}')
            return tally
        tally.survived += 1
        if (succeeded, found) != (wanted is not None, wanted or state):
            tally.wrong += 1
            tally.tell(f'transition {number} in {state}: success {succeeded}, then {found}')
        state = found
    bring_up(cell, state)
    check_node(cell, tally, 10**9)
    return tally


def bring_up(cell: Cell, state: str) -> None:
    """Make the node active again."""
    if state == 'unconfigured':
        cell.transition(Transition.TRANSITION_CONFIGURE)
    if state != 'active':
        cell.transition(Transition.TRANSITION_ACTIVATE)
    cell.wait_for_state('active')
    cell.wait_for(lambda: cell.clouds.get_subscription_count() == 1)
    cell.wait_for(lambda: all(cell.peer.count_publishers(topic.name) == 1 for topic in (FILTERED, MASK)))
