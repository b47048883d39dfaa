# SPDX-License-Identifier: Apache-2.0
"""The attack in small on one live node; `make soak` runs it for as long as wanted."""

from random import Random

import pytest

pytest.importorskip('rclpy', reason='live tests need ROS 2: source Jazzy, or pip install ".[ros]"')

from attack.node import attack_lifecycle, attack_messages, attack_parameters
from live import Cell

pytestmark = pytest.mark.live


@pytest.fixture(scope='module')
def attacked(tmp_path_factory):
    cell = Cell(tmp_path_factory.mktemp('attacked'))
    yield cell
    assert cell.close() == 0
    assert 'Traceback' not in cell.node_process.log.read_text()


@pytest.mark.parametrize(
    ('attack', 'count'), [(attack_messages, 12), (attack_parameters, 40), (attack_lifecycle, 30)]
)
def test_the_node_goes_on_and_gives_the_same_bytes_as_before(attacked, attack, count):
    tally = attack(Random(1), count, attacked)
    assert tally.sound(), tally
