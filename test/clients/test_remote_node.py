# SPDX-License-Identifier: Apache-2.0
"""A remote node beside a live one: what the tuning page learns of a node over ROS."""

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from examples import cloud
from forked import ForkedNode
from live import RELIABLE
from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_parameter_events
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock

from socialcircle_ros import interface
from socialcircle_ros.clients.remote_node import RemoteNode
from socialcircle_ros.errors import SettingError
from socialcircle_ros.interface import MeasurementValues
from socialcircle_ros.messages.image import OUTLIER
from socialcircle_ros.panel.link import ParameterKind, Presence
from socialcircle_ros.settings import PARAMETERS

pytestmark = pytest.mark.live

SCALE = 'circle.radius_scale'


class Pair:
    """A node, and a connection to it."""

    def __init__(self, cell, *arguments):
        self.cell = cell
        self.link = RemoteNode(cell.name, arguments)

    def until(self, condition):
        """Wait for a snapshot that meets a condition."""
        return self.cell.wait_for(lambda: (snapshot := self.link.wait(-1, 0)) and condition(snapshot) and snapshot)

    @staticmethod
    def is_active(snapshot):
        return snapshot.presence is Presence.ACTIVE and snapshot.values

    def until_active(self):
        return self.until(self.is_active)

    def start_again(self, folder, parameters):
        self.cell.node_process = ForkedNode(self.cell.namespace, folder / 'again.log', parameters)


@pytest.fixture
def pair(cell):
    pair = Pair(cell)
    yield pair
    pair.link.close()


def texts(snapshot):
    return [event.text for event in snapshot.log]


def outliers_of(shown):
    return MeasurementValues.from_text(shown.measurement.values).outliers


def test_parameters_are_described_as_the_node_declares_them(pair):
    snapshot = pair.until_active()
    rows = {row.name: row for row in snapshot.descriptors}
    for name, expected in PARAMETERS.items():
        row = rows[name]
        assert (row.sentence, row.unit, row.read_only) == (expected.sentence, expected.unit, expected.read_only)
        assert row.choices == expected.limits.choices
    kinds = {
        bool: ParameterKind.BOOLEAN,
        int: ParameterKind.INTEGER,
        float: ParameterKind.REAL,
        str: ParameterKind.TEXT,
        list: ParameterKind.INTEGERS,
    }
    assert {name: rows[name].kind for name in PARAMETERS} == {
        name: kinds[row.kind] for name, row in PARAMETERS.items()
    }
    assert (rows['circle.window'].low, rows['circle.window'].high, rows['circle.window'].step) == (3, 31, 2)
    assert [name for name in snapshot.values if name in PARAMETERS] == list(PARAMETERS)


def test_a_sent_cloud_is_shown_with_its_mask_and_measurement(pair):
    pair.until_active()
    assert pair.link.publish(cloud(stamp=5_000_000_007)) == ''
    shown = pair.until(lambda snapshot: snapshot.shown_cloud).shown_cloud
    assert shown.cloud == cloud(stamp=5_000_000_007)
    assert (shown.mask == OUTLIER).sum() == 26
    assert outliers_of(shown) == 26


def test_a_cloud_from_another_publisher_is_shown(pair):
    pair.until_active()
    pair.cell.wait_for(lambda: pair.cell.clouds.get_subscription_count() == 2)
    pair.cell.publish(cloud(stamp=6_000_000_000))
    shown = pair.until(lambda snapshot: snapshot.shown_cloud).shown_cloud
    assert MeasurementValues.from_text(shown.measurement.values).stamp == '6.000000000'


def test_the_last_cloud_is_shown_by_a_page_that_connects_later(cell):
    cell.clean(cloud(stamp=8_000_000_000))
    pair = Pair(cell)
    try:
        shown = pair.until(lambda snapshot: snapshot.shown_cloud).shown_cloud
        assert shown.cloud == cloud(stamp=8_000_000_000)
        assert (shown.mask == OUTLIER).sum() == 26
    finally:
        pair.link.close()


def test_after_a_change_the_cloud_is_filtered_again(pair):
    pair.until_active()
    pair.link.publish(cloud())
    pair.until(lambda snapshot: snapshot.shown_cloud)
    assert pair.link.change({'circle.mode': 'paper', SCALE: 100, 'circle.window': 5}) == ''
    snapshot = pair.until(
        lambda snapshot: (
            snapshot.shown_cloud.measurement.values[SCALE] == '100.0'
            and any(SCALE in text for text in texts(snapshot))
        )
    )
    assert (
        (snapshot.shown_cloud.mask == OUTLIER).sum()
        == MeasurementValues.from_text(snapshot.shown_cloud.measurement.values).outliers
        == 0
    )
    assert f'{SCALE}: 1.0 → 100.0 (this page)' in texts(snapshot)


def test_a_refused_change_gives_the_reason_and_changes_nothing(pair):
    before = pair.until_active().values
    assert 'is empty; give a height' in pair.link.change({SCALE: 2.0, 'circle.vote_region': [0, 0, 5, 0]})
    assert 'must be odd, not 4; use 3 or 5' in pair.link.change({'circle.window': 4})
    assert pair.link.wait(-1, 0).values == before


def test_a_change_made_elsewhere_is_noted_and_logged(pair):
    pair.until_active()
    pair.cell.set(circle__radius_scale=4)
    snapshot = pair.until(lambda snapshot: snapshot.values[SCALE] == 4.0)
    assert f'{SCALE}: 1.0 → 4.0 (elsewhere)' in texts(snapshot)


def test_a_missing_mask_is_a_warning_that_names_the_parameter(pair):
    pair.until_active()
    pair.cell.set(output__mask=False)
    snapshot = pair.until(lambda snapshot: 'output.mask' in snapshot.sentence)
    assert snapshot.level == 1


def test_an_idle_publisher_is_destroyed_so_that_the_node_does_not_report_it(pair):
    pair.until_active()
    pair.link.publish(cloud())
    topic = interface.POINTS.within(pair.cell.namespace)
    pair.cell.wait_for(
        lambda: all(
            publisher.node_name != 'socialcircle_tune'
            for publisher in pair.cell.peer.get_publishers_info_by_topic(topic)
        )
    )
    assert pair.link.publish(cloud()) == ''


def test_a_restarted_node_is_found_again_with_its_new_values(start_cell, tmp_path):
    pair = Pair(start_cell())
    try:
        pair.until_active()
        pair.cell.kill()
        absent = pair.until(lambda snapshot: snapshot.presence is not Presence.ACTIVE)
        assert absent.sentence.startswith('Waiting')
        assert absent.values[SCALE] == 1.0  # the last known values are kept
        pair.start_again(tmp_path, {SCALE: '3.0'})
        restarted = pair.until(
            lambda snapshot: snapshot.presence is Presence.ACTIVE and snapshot.values[SCALE] == 3.0
        )
        assert restarted.starts == absent.starts + 1 == 2
        assert 'The node no longer answers.' in texts(restarted)
        pair.until(lambda snapshot: 'The node was started again.' in texts(snapshot))
    finally:
        pair.link.close()


def test_a_publisher_that_the_graph_names_late_is_no_restart(start_cell, monkeypatch):
    endpoints, unnamed = RemoteNode._diagnostics_endpoints, [set()] * 4
    monkeypatch.setattr(
        RemoteNode, '_diagnostics_endpoints', lambda node: unnamed.pop() if unnamed else endpoints(node)
    )
    pair = Pair(start_cell())
    try:
        pair.until(lambda snapshot: bool(pair.link._known_endpoints))
        assert not unnamed
        assert pair.until_active().starts == 1
    finally:
        pair.link.close()


def test_the_values_before_a_restart_and_those_after_it_come_with_different_starts(start_cell, tmp_path):
    pair = Pair(start_cell())
    try:
        pair.until_active()
        pair.cell.set(circle__radius_scale=4)
        pair.until(lambda snapshot: snapshot.values[SCALE] == 4.0)
        seen = []

        def watch(snapshot):
            seen.append((snapshot.starts, snapshot.values[SCALE]))
            return snapshot.starts == 2

        pair.cell.kill()
        pair.start_again(tmp_path, {})
        pair.until(watch)
        assert set(seen) == {(1, 4.0), (2, 1.0)}
    finally:
        pair.link.close()


def test_forged_and_illegal_messages_do_not_end_the_link(cell):
    pair = Pair(cell, '--ros-args', '-p', 'use_sim_time:=true')
    try:
        pair.until_active()
        clocks = cell.peer.create_publisher(Clock, '/clock', 10)
        events = cell.peer.create_publisher(ParameterEvent, '/parameter_events', qos_profile_parameter_events)
        health = cell.peer.create_publisher(DiagnosticArray, '/diagnostics', 10)
        results = cell.peer.create_publisher(DiagnosticStatus, f'{cell.name}/measurement', RELIABLE)
        publishers = (clocks, events, health, results)
        cell.wait_for(lambda: all(publisher.get_subscription_count() for publisher in publishers))

        def fails(snapshot):
            clocks.publish(Clock(clock=Time(sec=-1)))  # again and again: clocks are heard as best effort
            return any('A message or a call failed' in text for text in texts(snapshot))

        pair.until(fails)
        wrong = [Parameter(SCALE, value='wide'), Parameter('circle.window', value=[1, 2]), Parameter('x', value=1)]
        events.publish(
            ParameterEvent(
                node=cell.name, changed_parameters=[parameter.to_parameter_msg() for parameter in wrong]
            )
        )
        forged = [KeyValue(key=key, value='9' * 5000) for key in ('clouds_refused', 'measured', 'stamp', 'state')]
        status = DiagnosticStatus(hardware_id=cell.name, message='forged', values=forged)
        health.publish(DiagnosticArray(status=[status]))
        results.publish(status)
        results.publish(serialize_message(status).replace(b'forged', b'\xff' * 6))
        cell.set(circle__radius_scale=4)
        snapshot = pair.until(lambda snapshot: snapshot.values[SCALE] == 4.0)
        assert snapshot.values['circle.window'] == 3
        assert pair.link.publish(cloud()) == ''
        assert outliers_of(pair.until(lambda snapshot: snapshot.shown_cloud).shown_cloud) == 26
        assert pair.link.change({SCALE: 2.0}) == ''
    finally:
        pair.link.close()


def test_for_a_missing_node_the_command_that_starts_it_is_shown(cell):
    with RemoteNode('/nowhere/social_circle') as link:
        snapshot = cell.wait_for(
            lambda: (found := link.wait(-1, 0)) and f'There is {cell.name}' in found.sentence and found
        )
        assert snapshot.presence is Presence.ABSENT
        assert 'socialcircle node --ros-args -r __ns:=/nowhere.' in snapshot.sentence
        assert 'is not running; nothing was changed' in link.change({SCALE: 2.0})
        assert 'is not running; its parameters were not saved' in link.save()
        assert 'No node but this page subscribes to /nowhere/points' in link.publish(cloud())


def test_a_name_that_no_node_can_have_is_refused():
    with pytest.raises(SettingError, match="'a name' cannot be the name of a node"):
        RemoteNode('a name')
