# SPDX-License-Identifier: Apache-2.0
"""Rows of live clouds, written by the node."""

import pytest
from examples import cloud
from lifecycle_msgs.msg import Transition

from socialcircle_ros.measurements import open_measurements

pytestmark = pytest.mark.live

pytest.importorskip('pyarrow')
pytest.importorskip('duckdb')


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
