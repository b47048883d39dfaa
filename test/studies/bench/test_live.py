# SPDX-License-Identifier: Apache-2.0
"""Times of the live node from outside: what is measured, not how long it takes."""

import pytest

from socialcircle_ros.studies.bench.live import endure, time_clouds, time_stacks, time_starts

pytest.importorskip('rclpy', reason='live tests need ROS 2')

pytestmark = pytest.mark.live

SHAPE = (48, 64)


def test_each_stack_but_the_first_gives_a_time(tmp_path):
    times, sent, answered = time_stacks(tmp_path, 2, SHAPE, frames=8)
    assert len(times.milliseconds) == 2
    assert 0 < times.least <= times.median <= times.most
    assert sent == answered == 0


def test_clouds_that_are_filtered_beside_stacks_are_counted(tmp_path):
    times, sent, answered = time_stacks(tmp_path, 2, SHAPE, frames=20, side_rate=20.0)
    assert len(times.milliseconds) == 2
    assert 0 < answered <= sent


def test_the_node_is_compared_with_a_relay_on_the_same_clouds(tmp_path):
    filtered, relayed = time_clouds(tmp_path, 2, SHAPE)
    assert len(filtered.milliseconds) == len(relayed.milliseconds) == 2
    assert relayed.least > 0


def test_the_first_and_the_tenth_cloud_of_each_node_give_a_time(tmp_path):
    first, tenth = time_starts(tmp_path, 1, SHAPE)
    assert len(first.milliseconds) == len(tenth.milliseconds) == 1
    assert tenth.least > 0
    assert first.milliseconds != tenth.milliseconds


def test_answers_at_a_steady_rate_are_counted_and_memory_is_read(tmp_path):
    found = endure(tmp_path, 1.0, SHAPE, rate=20.0)
    assert found.sent == 20
    assert 0 < found.answered <= found.sent
    for memory in (found.before, found.after):
        assert 50 < memory.proportional < memory.whole  # an interpreter with numba and rclpy in it
    assert found.cloud_megabytes == pytest.approx(48 * 64 * 16 / 1e6, rel=0.01)
