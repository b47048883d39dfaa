# SPDX-License-Identifier: Apache-2.0
"""The stopwatch of the studies."""

from socialcircle_ros.studies.timing import elapsed_ms, repeated_ms


def test_a_call_is_timed_in_milliseconds():
    assert 0 <= elapsed_ms(lambda: None) < 1000


def test_the_warm_up_call_is_not_among_the_times():
    calls = []
    assert len(repeated_ms(lambda: calls.append(1), 3)) == 3
    assert len(calls) == 4
