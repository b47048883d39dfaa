"""Lost messages are reported by the middleware, counted, and said in a sentence."""

from types import SimpleNamespace

import pytest
import rclpy
from rclpy import event_handler
from rclpy.event_handler import QoSSubscriptionEventType, UnsupportedEventTypeError
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2

from socialcircle_ros.node.health import Health
from socialcircle_ros.node.lost_messages import LostMessages, lost_sentence

LOST = QoSSubscriptionEventType.RCL_SUBSCRIPTION_MESSAGE_LOST


@pytest.fixture
def node():
    context = rclpy.Context()
    rclpy.init(context=context)
    node = Node('subscriber', context=context)
    yield node
    node.destroy_node()
    rclpy.shutdown(context=context)


def kinds(subscription):
    return [handler.event_type for handler in subscription.event_handlers]


def test_a_subscription_reports_how_many_messages_were_lost_since_the_last_report(node):
    counts = []
    subscription = node.create_subscription(
        PointCloud2, 'points', print, 1, event_callbacks=LostMessages(counts.append)
    )
    (handler,) = (each for each in subscription.event_handlers if each.event_type == LOST)
    handler.callback(SimpleNamespace(total_count=5, total_count_change=2))
    assert counts == [2]


def test_other_events_keep_their_default_callbacks(node):
    plain = node.create_subscription(PointCloud2, 'points', print, 1)
    subscription = node.create_subscription(PointCloud2, 'points', print, 1, event_callbacks=LostMessages(print))
    assert sorted(map(str, kinds(subscription))) == sorted(map(str, [*kinds(plain), LOST]))


def test_a_middleware_without_the_event_still_subscribes(node, monkeypatch):
    class Handler(event_handler.EventHandler):
        def __init__(self, **options):
            if options['event_type'] == LOST:
                raise UnsupportedEventTypeError
            super().__init__(**options)

    monkeypatch.setattr(event_handler, 'EventHandler', Handler)
    subscription = node.create_subscription(PointCloud2, 'points', print, 1, event_callbacks=LostMessages(print))
    assert kinds(subscription)
    assert LOST not in kinds(subscription)


@pytest.mark.parametrize(('count', 'beginning'), [(1, 'A cloud was lost'), (3, '3 clouds were lost')])
def test_the_sentence_names_the_topic_and_what_to_do(count, beginning):
    sentence = lost_sentence(count, '/cell1/points')
    assert sentence.startswith(f'{beginning} on the way to /cell1/points')
    assert 'FASTRTPS_DEFAULT_PROFILES_FILE=fastdds_network.xml' in sentence


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
