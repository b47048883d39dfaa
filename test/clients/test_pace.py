# SPDX-License-Identifier: Apache-2.0
"""Recorded time during a replay."""

import math

from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.clients.pace import Pace


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def test_a_message_is_due_after_its_recorded_time_at_the_rate():
    clock = Clock()
    pace = Pace(2.0, monotonic=clock)
    pace.start(5_000)
    assert pace.seconds_until(4_000_005_000) == 2.0
    assert not pace.is_due(4_000_005_000)
    clock.now += 2.0
    assert pace.is_due(4_000_005_000)
    assert pace.now_ns() == 4_000_005_000


def test_nothing_is_due_while_paused_but_what_is_stepped_to():
    clock = Clock()
    pace = Pace(monotonic=clock)
    pace.start(0)
    pace.toggle_pause()
    clock.now += 1000
    assert pace.paused
    assert not pace.is_due(1)
    assert pace.seconds_until(1) == math.inf
    pace.step()
    assert pace.seconds_until(7) == 0.0
    assert pace.is_due(7)
    assert not pace.is_due(8)
    pace.toggle_pause()
    assert not pace.is_due(8)  # recorded time goes on from the message that was stepped to
    clock.now += 1
    assert pace.is_due(1_000_000_007)


def test_while_paused_not_even_the_message_at_which_recorded_time_begins_is_due():
    pace = Pace(paused=True, monotonic=Clock())
    pace.start(5)
    assert not pace.is_due(5)
    pace.step()
    assert pace.is_due(5)
    pace.start(5)  # at the start of a loop
    assert not pace.is_due(5)
    pace.toggle_pause()
    assert pace.is_due(5)


def test_steps_count_only_while_paused():
    clock = Clock()
    pace = Pace(monotonic=clock)
    pace.start(0)
    pace.step()
    pace.toggle_pause()
    assert not pace.is_due(10)


def test_the_rate_stays_within_bounds():
    pace = Pace(monotonic=Clock())
    pace.multiply_rate(1e9)
    assert pace.rate == 1000
    pace.multiply_rate(1e-12)
    assert pace.rate == 0.01


@given(
    st.lists(
        st.one_of(
            st.tuples(st.just('wait'), st.floats(0, 100)),
            st.tuples(st.just('rate'), st.floats(0.5, 2)),
            st.tuples(st.just('pause'), st.none()),
        ),
        max_size=20,
    )
)
def test_recorded_time_is_the_sum_of_what_passed_at_each_rate(actions):
    clock = Clock()
    pace = Pace(monotonic=clock)
    pace.start(0)
    expected, rate, paused = 0.0, 1.0, False
    for action, value in actions:
        if action == 'wait':
            clock.now += value
            expected += 0 if paused else value * rate
        elif action == 'rate':
            pace.multiply_rate(value)
            rate = min(max(rate * value, 0.01), 1000)
        else:
            pace.toggle_pause()
            paused = not paused
    assert math.isclose(pace.now_ns() / 1e9, expected, rel_tol=1e-6, abs_tol=1e-6)
