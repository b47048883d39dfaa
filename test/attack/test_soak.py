# SPDX-License-Identifier: Apache-2.0
"""What the long attack adds to the small one: full disks and the table."""

from random import Random

import pytest

pytest.importorskip('rclpy', reason='the long attack needs ROS 2')

from attack.soak import attack_disks, table
from attack.tally import Tally


def test_a_full_disk_loses_nothing_that_was_written(tmp_path):
    tally = attack_disks(Random(1), 3, tmp_path)
    if tally.skipped:
        pytest.skip(tally.skipped)
    assert tally.sound(), tally


def test_the_table_has_a_row_for_each_attack_and_says_what_was_not_possible():
    one, other = Tally('clouds', 1200, 1200), Tally('disks', skipped='no disk can be mounted')
    one.add(Tally('clouds', 100, 99, 2, 3, ['a fault']))
    text = table([one, other])
    assert '| clouds | 1,300 | 1,299 | 2 | 3 |' in text
    assert 'disks: not possible here: no disk can be mounted' in text
    assert one.faults == ['a fault']
