# SPDX-License-Identifier: Apache-2.0
"""What the diagnostics tell of the last stack, and of what comes to the node."""

import dataclasses
import types
from typing import NamedTuple

import pytest
from rclpy.qos import QoSProfile

from socialcircle_ros.focus import Registered
from socialcircle_ros.interface import POINTS, STACK_FRAMES, STACK_JOINT_STATES
from socialcircle_ros.messages.diagnostics import ERROR, OK, WARN
from socialcircle_ros.node.health import Health
from socialcircle_ros.node.health_report import NodeState, health_status


def test_the_drift_of_the_last_stack_is_shown_where_it_is_known():
    health = Health()
    values = [health.values('active', None, None, None)]
    for drift in (3.14159, 0.0, None, 2.0):
        health.stack_finished(0.1, 0.01, 2, drift)
        values.append(health.values('active', None, None, None))
    health.reset()
    values.append(health.values('active', None, None, None))
    assert [each.get('stack_drift_px') for each in values] == [None, '3.14', '0.0', None, '2.0', None]


def test_what_was_registered_is_shown_where_it_was_asked_for():
    health = Health()
    shown = []
    for registered in (Registered(3.14159, 1.0212345, 0), None):
        health.stack_finished(0.1, 0.01, 2, 3.0, registered)
        values = health.values('active', None, None, None)
        shown.append((values.get('stack_registered_px'), values.get('stack_registered_magnification')))
    assert shown == [('3.14', '1.02123'), (None, None)]


class Heard(NamedTuple):
    """A subscription or a publisher, as the report reads it."""

    topic_name: str
    topic_type: str
    qos_profile: QoSProfile
    node_namespace: str = '/'
    node_name: str = 'player'


def sentence_where(*topics, **now):
    """The node's sentence while another node publishes on some of its topics."""
    return status_where(*topics, **now).message


def status_where(*topics, **now):
    status, complaint = report_where(*topics, **now)
    assert complaint == ''
    return status


def report_where(*topics, health=None, silence_s=0.0, busy_s=0.0, compiling=False, namesakes=1):
    heard = [Heard(f'/cell/{each.name}', each.type, QoSProfile(depth=1)) for each in topics]
    node = types.SimpleNamespace(
        get_publishers_info_by_topic=lambda name: [each for each in heard if each.topic_name == name],
        get_node_names_and_namespaces=lambda: namesakes * [('social_circle', '/cell')],
        get_namespace=lambda: '/cell',
        get_name=lambda: 'social_circle',
        get_fully_qualified_name=lambda: '/cell/social_circle',
    )
    inputs = (POINTS, STACK_FRAMES, STACK_JOINT_STATES)
    subscriptions = tuple(
        (Heard(f'/cell/{each.name}', each.type, QoSProfile(depth=1)), each.type) for each in inputs
    )
    state = NodeState('/cell/social_circle', 'active', '', subscriptions, 0.0, silence_s, '', busy_s, compiling)
    return health_status(node, state, health or Health())


@pytest.mark.parametrize(
    ('published', 'sentence'),
    [
        ((), 'Waiting: no node publishes on /cell/points or /cell/stack/image yet.'),
        ((STACK_JOINT_STATES,), 'Waiting: no node publishes on /cell/points or /cell/stack/image yet.'),
        ((STACK_FRAMES, STACK_JOINT_STATES), 'Frames are measured as they come.'),
        ((POINTS,), 'Clouds are filtered as they come.'),
        ((POINTS, STACK_FRAMES), 'Clouds are filtered as they come.'),
    ],
)
def test_the_sentence_tells_what_comes(published, sentence):
    assert sentence_where(*published) == sentence


@pytest.mark.parametrize('arrive', [Health.received, Health.frame_received])
def test_the_sentence_does_not_say_that_nothing_has_come_yet_after_something_came(arrive):
    health = Health()
    arrive(health)
    sentence = 'Waiting: no node publishes on /cell/points or /cell/stack/image any more.'
    assert sentence_where(STACK_JOINT_STATES, health=health) == sentence


def test_it_is_told_where_input_waits_for_kernels_that_are_compiled():
    status = status_where(POINTS, busy_s=7.0, compiling=True)
    sentence = 'Kernels that the settings need are compiled, once; a cloud or stack has waited 7 s.'
    assert (status.level, status.message) == (WARN, sentence)
    assert status_where(POINTS, busy_s=0.9, compiling=True).level == OK
    assert status_where(POINTS, busy_s=7.0).level == OK


def test_a_reset_makes_no_publisher_silent(clock):
    health = Health()
    assert 'has sent no cloud' in sentence_where(POINTS, health=health, silence_s=5.0)
    health.received()
    health.reset()
    clock.s += 3
    assert sentence_where(POINTS, health=health, silence_s=5.0) == 'Clouds are filtered as they come.'


def test_no_publisher_is_silent_while_its_cloud_is_filtered(clock):
    assert 'has sent no cloud' not in sentence_where(POINTS, silence_s=2.0, busy_s=8.0)
    for done in (
        lambda health: health.published(8.0),
        lambda health: health.refused('why', again=False),
        lambda health: health.cloud_failed('why', again=False),
    ):
        health = Health()
        clock.s += 8
        done(health)
        assert health.seconds_silent() == 0


def test_where_frames_come_a_publisher_that_never_sent_a_cloud_is_not_silent(clock):
    health = Health()
    health.frame_received()
    assert health.seconds_silent() == 0
    clock.s += 1
    assert 'has sent no cloud' not in sentence_where(POINTS, STACK_FRAMES, silence_s=1e-9, health=health)
    health.received()
    clock.s += 1
    assert 'has sent no cloud' in sentence_where(POINTS, STACK_FRAMES, silence_s=1e-9, health=health)


def test_two_nodes_of_one_name_are_logged_and_hide_no_error():
    status, complaint = report_where(POINTS, namesakes=2)
    assert complaint.startswith('2 nodes are named /cell/social_circle')
    assert (status.level, status.message) == (WARN, complaint)
    health = Health()
    health.refused('The cloud is not organized.', again=False)
    status, logged = report_where(POINTS, health=health, namesakes=2)
    assert (status.level, status.message, logged) == (ERROR, 'The cloud is not organized.', complaint)
    other = dataclasses.replace(POINTS, type='std_msgs/msg/String')
    status, logged = report_where(other, namesakes=2)
    assert (status.level, logged) == (ERROR, f'{status.message} {complaint}')


@pytest.fixture
def clock(monkeypatch):
    """The time of the health, in s, which a test sets."""
    now = types.SimpleNamespace(s=100.0)
    monkeypatch.setattr('socialcircle_ros.node.health.time', types.SimpleNamespace(monotonic=lambda: now.s))
    return now


def values_of(health):
    return health.values('active', None, None, None)


def test_rate_and_latencies_are_those_of_the_last_ten_seconds(clock):
    health = Health()
    for clock.s, latency in ((100, 0.5), (105, 0.001), (106, 0.009), (109, 0.002)):
        health.received()
        health.published(latency)
    clock.s = 111
    shown = values_of(health)
    assert (shown['rate_hz'], shown['latency_median_ms'], shown['latency_max_ms']) == ('0.3', '2.0', '9.0')
    clock.s = 120
    shown = values_of(health)
    assert shown['rate_hz'] == '0.0'
    assert 'latency_median_ms' not in shown


def test_a_cloud_that_is_judged_again_is_counted_once():
    health = Health()
    for again in (False, True):
        health.judged('Sa is 3, more than 2.', again=again)
    assert values_of(health)['limits_failed'] == '1'
    assert health.failed_limits() == 'Sa is 3, more than 2.'
    health.judged('', again=True)
    assert values_of(health)['limits_failed'] == '1'
    assert health.failed_limits() == ''


def test_a_reset_forgets_all_but_when_the_last_cloud_came(clock):
    health, new = Health(), Health()
    health.received()
    health.judged('Sa is 3, more than 2.', again=False)
    health.stack_finished(0.1, 0.01, 2, 3.0, Registered(3.14159, 1.0212345, 0))
    health.pixels_judged({'dark': 7})
    health.frame_refused('The frame is cut short.')
    health.reset()
    assert values_of(health) == values_of(new)
    assert (health.failed_limits(), health.in_trouble(), health.had_trouble()) == ('', False, False)
    clock.s += 3
    assert health.seconds_silent() == 3
