# SPDX-License-Identifier: Apache-2.0
"""The stopwatch."""

import pytest

from socialcircle_ros.kernels import stopwatch
from socialcircle_ros.kernels.stopwatch import Stopwatch


@pytest.fixture
def clock(monkeypatch):
    """Sets the time."""
    now = [100.0]
    monkeypatch.setattr(stopwatch.time, 'perf_counter', lambda: now[0])
    return now


def test_each_step_takes_what_passed_since_the_last_one(clock):
    watch = Stopwatch()
    clock[0] = 101.0
    watch.lap('one')
    clock[0] = 104.0
    watch.lap('two')

    assert watch.times_ms == {'one': 1000.0, 'two': 3000.0}


def test_laps_of_one_name_add_up(clock):
    watch = Stopwatch()
    for step in ('one', 'two', 'one'):
        clock[0] += 2.0
        watch.lap(step)

    assert list(watch.times_ms.items()) == [('one', 4000.0), ('two', 2000.0)]


def test_time_before_a_restart_belongs_to_no_step(clock):
    watch = Stopwatch()
    clock[0] += 5.0
    watch.restart()
    clock[0] += 1.0
    watch.lap('one')

    assert watch.times_ms == {'one': 1000.0}
