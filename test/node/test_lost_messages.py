# SPDX-License-Identifier: Apache-2.0
"""Lost messages are reported by the middleware, counted, and said in a sentence."""

from types import SimpleNamespace

import pytest
import rclpy
from hypothesis import given
from hypothesis import strategies as st
from rclpy import event_handler
from rclpy.event_handler import QoSSubscriptionEventType, UnsupportedEventTypeError
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2

from socialcircle_ros.node.health import Health
from socialcircle_ros.node.lost_messages import LostMessages, lost_sentence
from socialcircle_ros.node.rclpy_internals import TakenMessage

LOST = QoSSubscriptionEventType.RCL_SUBSCRIPTION_MESSAGE_LOST
NOTHING = memoryview(b'')


@pytest.fixture
def node():
    context = rclpy.Context()
    rclpy.init(context=context)
    node = Node('subscriber', context=context)
    yield node
    node.destroy_node()
    rclpy.shutdown(context=context)


def ignore(_):
    pass


def kinds(subscription):
    return [handler.event_type for handler in subscription.event_handlers]


def report(lost, count):
    """What rclpy does when the middleware reports lost messages."""
    lost.message_lost(SimpleNamespace(total_count=count, total_count_change=count))


def test_the_middleware_reports_lost_messages_to_the_subscription(node):
    counts = []
    subscription = node.create_subscription(
        PointCloud2, 'points', ignore, 1, event_callbacks=LostMessages(counts.append)
    )
    (handler,) = (each for each in subscription.event_handlers if each.event_type == LOST)
    handler.callback(SimpleNamespace(total_count=5, total_count_change=2))
    assert counts == [2]


def test_a_gap_in_the_numbers_of_a_publisher_tells_how_many_are_missing():
    counts = []
    lost = LostMessages(counts.append)
    came = ((b'a', 7), (b'a', 8), (b'b', 1), (b'a', 11), (b'b', 2), (b'b', 4), (b'a', 12), (b'a', None))
    missing = [lost.arrived(TakenMessage(NOTHING, publisher, number)) for publisher, number in came]
    assert missing == [0, 0, 0, 2, 0, 1, 0, 0]
    assert counts == [2, 1]


def test_what_was_reported_before_the_first_message_of_a_publisher_is_missing_before_it():
    lost = LostMessages(ignore)
    report(lost, 3)
    assert [lost.arrived(TakenMessage(NOTHING, b'a', number)) for number in (4, 5)] == [3, 0]


def test_a_publisher_that_starts_again_and_an_old_number_are_no_loss():
    counts = []
    lost = LostMessages(counts.append)
    for publisher, number in ((b'a', 7), (b'new', 1), (b'new', 2), (b'new', 2), (b'new', 1)):
        lost.arrived(TakenMessage(NOTHING, publisher, number))
    assert counts == []


def test_a_message_without_a_number_tells_of_no_loss():
    counts = []
    lost = LostMessages(counts.append)
    for number in (1, None, 2):
        lost.arrived(TakenMessage(NOTHING, b'a', number))
    assert counts == []


def test_the_numbers_of_many_publishers_are_not_kept():
    lost = LostMessages(pytest.fail)
    for number in range(1000):
        lost.arrived(TakenMessage(NOTHING, number.to_bytes(16, 'big'), 1))
    assert len(lost._last_numbers) <= 16


@given(st.lists(st.sampled_from(['arrives', 'lost', 'lost and reported']), max_size=30))
def test_each_lost_message_is_counted_once(fates):
    counts = []
    lost = LostMessages(counts.append)
    for number, fate in enumerate(fates, 1):
        if fate == 'lost and reported':
            report(lost, 1)
        elif fate == 'arrives':
            lost.arrived(TakenMessage(NOTHING, b'publisher', number))
    ends = [number for number, fate in enumerate(fates, 1) if fate == 'arrives']
    known = [
        fate
        for number, fate in enumerate(fates, 1)
        if fate == 'lost and reported' or (fate == 'lost' and ends and ends[0] < number < ends[-1])
    ]
    assert sum(counts) == len(known)


def test_other_events_keep_their_default_callbacks(node):
    plain = node.create_subscription(PointCloud2, 'points', ignore, 1)
    subscription = node.create_subscription(PointCloud2, 'points', ignore, 1, event_callbacks=LostMessages(ignore))
    assert sorted(map(str, kinds(subscription))) == sorted(map(str, [*kinds(plain), LOST]))


def test_a_middleware_without_the_event_still_subscribes(node, monkeypatch):
    class Handler(event_handler.EventHandler):
        def __init__(self, **options):
            if options['event_type'] == LOST:
                raise UnsupportedEventTypeError
            super().__init__(**options)

    monkeypatch.setattr(event_handler, 'EventHandler', Handler)
    subscription = node.create_subscription(PointCloud2, 'points', ignore, 1, event_callbacks=LostMessages(ignore))
    assert kinds(subscription)
    assert LOST not in kinds(subscription)


@pytest.mark.parametrize(('count', 'beginning'), [(1, 'A cloud was lost'), (3, '3 clouds were lost')])
def test_the_sentence_names_the_topic_and_what_to_do(count, beginning):
    sentence = lost_sentence(count, '/cell1/points')
    assert sentence.startswith(f'{beginning} on the way to /cell1/points')
    assert 'they come faster than the node takes them, or parts did not arrive' in sentence
    assert 'FASTRTPS_DEFAULT_PROFILES_FILE=fastdds_network.xml' in sentence


def test_the_sentence_says_what_is_lost():
    assert lost_sentence(2, '/image', 'frame').startswith('2 frames were lost on the way to /image')


def test_health_counts_lost_clouds_and_shows_the_reason_for_a_while():
    health = Health()
    health.lost(2, 'why')
    health.lost(1, 'why')
    assert health.had_trouble()
    assert not health.in_trouble()
    values = health.values('active', 1, '', None)
    assert (values['clouds_lost'], values['last_reason']) == ('3', 'why')
    health.reset()
    assert health.values('active', 1, '', None)['clouds_lost'] == '0'
