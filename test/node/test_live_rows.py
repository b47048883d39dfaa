# SPDX-License-Identifier: Apache-2.0
"""Rows of live clouds, written by the node."""

import threading
from contextlib import contextmanager

import pytest
import rclpy
from examples import cloud
from lifecycle_msgs.msg import Transition
from rclpy.lifecycle import LifecycleNode

from socialcircle_ros.measurements import open_measurements
from socialcircle_ros.node.cloud_filter import CloudFilter
from socialcircle_ros.node.health import Health
from socialcircle_ros.node.parameters import Configuration

pytestmark = pytest.mark.live

pytest.importorskip('pyarrow')
pytest.importorskip('duckdb')


@contextmanager
def cloud_filter(configuration, health=None):
    """What a node does with clouds, in a node of its own."""
    context = rclpy.Context()
    rclpy.init(context=context)
    node = LifecycleNode('rows', context=context)
    clouds = CloudFilter(node, configuration, health or Health())
    node.trigger_configure()
    node.trigger_activate()
    try:
        yield clouds
    finally:
        clouds.close()
        node.destroy_node()
        rclpy.shutdown(context=context)


@pytest.mark.parametrize('message', [cloud(), b'no cloud'], ids=['cleaned', 'refused'])
def test_a_row_has_the_settings_that_its_cloud_was_filtered_with(tmp_path, message):
    """Also where parameters change while the cloud is at hand."""
    folder = tmp_path / 'plant'
    values = {'measurements.folder': str(folder)}
    begun, parts = threading.Event(), []

    def configuration():
        parts.append(f'part {len(parts)}')
        begun.set()
        return Configuration.from_ros(values | {'measurements.part': parts[-1]})

    with cloud_filter(configuration) as clouds:
        begun.clear()
        expected = f'part {len(parts)}'
        clouds.filter(message)
        begun.wait()
        clouds.finish()
    assert open_measurements(folder).sql('select part from measurements').fetchall() == [(expected,)]


def test_a_row_has_the_unit_of_its_cloud_where_the_node_made_it(tmp_path):
    """No message says the unit of a cloud that arrived; that of a stack is in metres."""
    begun = threading.Event()

    def configuration():
        begun.set()
        return Configuration.from_ros({'measurements.folder': str(tmp_path)})

    with cloud_filter(configuration) as clouds:
        for hand_over in (lambda: clouds.filter(cloud()), lambda: clouds.filter_stack(cloud(seed=1), None)):
            begun.clear()
            hand_over()
            begun.wait()
            clouds.finish()
    found = open_measurements(tmp_path).sql('select number, unit from measurements order by number').fetchall()
    assert found == [(0, None), (1, 'm')]


def test_the_row_of_a_refused_cloud_has_its_stamp(tmp_path):
    begun = threading.Event()

    def configuration():
        begun.set()
        return Configuration.from_ros({'measurements.folder': str(tmp_path)})

    with cloud_filter(configuration) as clouds:
        begun.clear()
        clouds.filter(cloud(1, 9, stamp=1_790_000_000_000_000_000))
        begun.wait()
        clouds.finish()
    query = 'select status, stamp, frame, epoch(time)::bigint from measurements'
    found = ('refused', '1790000000.000000000', 'microscope', 1_790_000_000)
    assert open_measurements(tmp_path).sql(query).fetchall() == [found]


def test_rows_that_are_lost_at_the_end_are_told(tmp_path, capfd):
    (tmp_path / 'measurements').write_text('in the way')
    health = Health()
    configuration = Configuration.from_ros({'measurements.folder': str(tmp_path)})
    with cloud_filter(lambda: configuration, health) as clouds:
        clouds.filter(b'no cloud')
        clouds._worker.drain()
    assert health.last_reason.startswith('1 row of measurements is lost, because: ')
    assert health.last_reason in capfd.readouterr().err


def test_the_node_keeps_a_row_of_each_cloud(start_cell, tmp_path):
    folder = tmp_path / 'plant'
    cell = start_cell({'measurements.folder': str(folder), 'measurements.cell': 'hall 3'})
    cell.clean(cloud(stamp=1_790_000_000_000_000_000))
    cell.set(measurements__part='lid', output__mask=True, circle__not_measured='nan')
    cell.clean(cloud(stamp=1_790_000_001_000_000_000, seed=1))
    cell.transition(Transition.TRANSITION_DEACTIVATE)
    cell.transition(Transition.TRANSITION_CLEANUP)
    query = (
        'select cell, part, status, outliers, settings, latency_ms > 0, sq > 0 from measurements order by stamp'
    )
    assert open_measurements(folder).sql(query).fetchall() == [
        ('hall 3', None, 'ok', 26, '{}', True, True),
        ('hall 3', 'lid', 'ok', 26, '{"circle.not_measured": "nan"}', True, True),
    ]
