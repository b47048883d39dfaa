# SPDX-License-Identifier: Apache-2.0
"""The node's life: states, ends, and what it says of its connections."""

import signal
from pathlib import Path

import pytest
import rclpy
from examples import cloud
from forked import ForkedNode
from lifecycle_msgs.msg import Transition
from live import RESULTS, mapped_by
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image, PointCloud2

from socialcircle_ros.clients.process import NodeProcess

pytestmark = pytest.mark.live

BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


def test_without_autostart_it_waits_for_a_manager_and_can_go_round(start_cell):
    cell = start_cell({'autostart': 'false'}, active=False)
    cell.wait_for_state('unconfigured')
    for _ in range(2):
        assert cell.transition(Transition.TRANSITION_CONFIGURE)
        assert cell.state() == 'inactive'
        assert cell.transition(Transition.TRANSITION_ACTIVATE)
        cell.wait_for(lambda: cell.clouds.get_subscription_count() == 1)
        cell.wait_for(lambda: all(cell.peer.count_publishers(name) == 1 for name in RESULTS))
        assert cell.clean(cloud())[2].values['outliers'] == '26'
        assert cell.transition(Transition.TRANSITION_DEACTIVATE)
        cell.wait_for(lambda: cell.clouds.get_subscription_count() == 0)
        assert cell.transition(Transition.TRANSITION_CLEANUP)
        for name in (*RESULTS, 'points_repaired', 'outlier_score'):
            cell.wait_for(lambda name=name: cell.peer.count_publishers(name) == 0)
    assert cell.transition(Transition.TRANSITION_UNCONFIGURED_SHUTDOWN)
    assert cell.state() == 'finalized'


def test_an_invalid_transition_is_refused_and_does_not_end_the_node(start_cell):
    cell = start_cell()
    assert not cell.transition(Transition.TRANSITION_CONFIGURE)
    assert not cell.transition(Transition.TRANSITION_CLEANUP)
    assert not cell.transition(200)
    assert cell.state() == 'active'
    assert cell.clean(cloud())[2].values['outliers'] == '26'


def test_it_can_be_shut_down_while_active(start_cell):
    cell = start_cell()
    assert cell.transition(Transition.TRANSITION_ACTIVE_SHUTDOWN)
    cell.wait_for(lambda: cell.clouds.get_subscription_count() == 0)
    assert cell.state() == 'finalized'
    found = cell.diagnosis(lambda found: found.values['state'] == 'finalized')
    assert found.status.level == b'\1'
    assert found.status.message == 'The node is shut down, and filters no more: end it, and start it again.'


def test_inactive_it_takes_no_cloud_and_says_so(start_cell):
    cell = start_cell()
    cell.transition(Transition.TRANSITION_DEACTIVATE)
    found = cell.diagnosis(lambda found: found.values['state'] == 'inactive')
    assert 'The node is inactive' in found.status.message
    cell.publish(cloud())
    cell.forget()
    assert cell.diagnosis(lambda found: found).values['clouds_received'] == '0'
    answer = cell.trigger('publish_last')
    assert not answer.success
    assert answer.message == 'The node is inactive; it publishes the last cloud only while it is active.'


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_cleanly_and_leaves_no_shared_memory(start_cell, number):
    # fastrtps_… with Jazzy, fastdds_… with Kilted. A killed node of the test before has left some.
    before = set(Path('/dev/shm').glob('*fast*'))
    cell = start_cell(begin=NodeProcess)
    cell.clean(cloud())
    process = cell.node_process.process
    segments = {path for path in Path('/dev/shm').glob('*fast*') if path in mapped_by(process.pid)} - before
    process.send_signal(number)
    assert process.wait(60) == 0
    assert segments
    left = {path for path in segments if path.exists()}
    assert not left - mapped_by('*'), 'what is left is in use by the peer'
    assert 'Traceback' not in cell.node_process.log.read_text()


def test_a_signal_while_it_filters_loses_no_cloud_silently(start_cell):
    """The cloud at hand is published, unless it takes longer than the end of the node waits for it."""
    cell = start_cell(begin=NodeProcess)
    cell.set(circle__vote_region=[0, 0, 200, 200])
    cell.publish(cloud(400, 500))
    cell.diagnosis(lambda found: found.values['clouds_received'] == '1')
    cell.node_process.process.send_signal(signal.SIGINT)
    assert cell.node_process.process.wait(60) == 0
    log = cell.node_process.log.read_text()
    assert 'Traceback' not in log
    assert 'A cloud was dropped' in log or cell.answer()


def test_a_best_effort_publisher_is_reported_with_what_to_change(start_cell):
    cell = start_cell()
    unheard = cell.peer.create_publisher(PointCloud2, 'points', BEST_EFFORT)
    found = cell.diagnosis(lambda found: 'best effort' in found.status.message)
    assert found.status.level == b'\2'
    assert f'{cell.namespace}/peer' in found.status.message
    assert f'qos_overrides.{cell.namespace}/points.subscription.reliability: best_effort' in found.status.message
    cell.peer.destroy_publisher(unheard)
    cell.forget()
    cell.diagnosis(lambda found: found.status.level == b'\0')


def test_the_reported_change_makes_a_best_effort_publisher_heard(start_cell):
    namespace = '/best_effort'
    name = f'qos_overrides.{namespace}/points.subscription.reliability'
    cell = start_cell({name: 'best_effort'}, ('-r', f'points:={namespace}/points'), active=False)
    publisher = cell.peer.create_publisher(PointCloud2, f'{namespace}/points', BEST_EFFORT)
    cell.wait_for(lambda: publisher.get_subscription_count() == 1)
    cell.clouds = publisher
    # Best effort may lose a cloud: it is sent until it is answered.
    assert cell.wait_for(lambda: publisher.publish(cloud()) or cell.inbox['points_filtered'])


def test_a_publisher_of_another_type_is_reported(start_cell):
    cell = start_cell()
    context = rclpy.Context()
    rclpy.init(context=context)
    camera = rclpy.create_node('camera', namespace=cell.namespace, context=context)
    camera.create_publisher(Image, 'points', 1)
    # Discovery may tell of a publisher before it names its node.
    found = cell.diagnosis(lambda found: f'Publisher {cell.namespace}/camera' in found.status.message)
    camera.destroy_node()
    rclpy.shutdown(context=context)
    assert 'sends sensor_msgs/msg/Image, not sensor_msgs/msg/PointCloud2' in found.status.message
    assert 'remap one of them' in found.status.message


def test_a_silent_publisher_is_reported(start_cell):
    cell = start_cell({'silence': '0.5'})
    found = cell.diagnosis(lambda found: 'has sent no cloud' in found.status.message)
    assert 'on another machine with fastdds_network.xml' in found.status.message
    assert found.status.level == b'\1'
    assert 'FASTRTPS_DEFAULT_PROFILES_FILE' in found.status.message
    cell.clean(cloud())


def test_what_a_failed_activation_began_is_undone(start_cell):
    cell = start_cell(active=False, parameters={'qos_overrides./odd.subscription.depth': '-3'},
                      arguments=('-r', 'stack/image:=/odd'))  # fmt: skip
    cell.wait_for_state('inactive')
    sentence = 'on_activate failed: qos_overrides./odd.subscription.depth cannot be -3; it must be at least 0.'
    found = cell.diagnosis(lambda found: found.status.message.startswith(sentence))
    assert found.status.level == b'\2'
    assert found.status.message.endswith(')')  # what rclpy says
    assert cell.clouds.get_subscription_count() == 0


def test_a_signal_while_it_compiles_ends_it_without_waiting(tmp_path, monkeypatch, start_cell):
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path / 'cold'))
    cell = start_cell(begin=NodeProcess, active=False)
    cell.wait_for(lambda: ('social_circle', cell.namespace) in cell.peer.get_node_names_and_namespaces())
    cell.node_process.process.send_signal(signal.SIGTERM)
    assert cell.node_process.process.wait(30) == 0  # compiling takes longer
    assert 'Traceback' not in cell.node_process.log.read_text()


def test_a_bad_qos_override_is_told_and_leaves_the_node_unconfigured(start_cell):
    cell = start_cell(active=False, parameters={'qos_overrides./odd.publisher.reliability': 'sometimes'},
                      arguments=('-r', 'points_filtered:=/odd'))  # fmt: skip
    cell.wait_for_state('unconfigured')
    sentence = 'on_configure failed: qos_overrides./odd.publisher.reliability cannot be sometimes; use one of: '
    assert cell.wait_for(lambda: sentence in cell.node_process.log.read_text())


def test_a_clock_before_zero_does_not_end_the_node(start_cell):
    cell = start_cell({'use_sim_time': 'true'})
    clock = cell.peer.create_publisher(Clock, '/clock', 10)
    cell.wait_for(lambda: clock.get_subscription_count() >= 1)
    before = Clock()
    before.clock.sec = -1

    def reported():
        clock.publish(before)
        return any(
            'could not be handled by rclpy' in found.values['last_reason'] for found in cell.inbox['diagnostics']
        )

    cell.wait_for(reported)
    assert cell.clean(cloud())[2].values['outliers'] == '26'


def test_two_nodes_of_one_name_are_reported(start_cell, tmp_path):
    cell = start_cell()
    with ForkedNode(cell.namespace, tmp_path / 'second.log'):
        found = cell.diagnosis(lambda found: 'nodes are named' in found.status.message)
    assert found.status.level == b'\1'
    assert f'2 nodes are named {cell.name}' in found.status.message
