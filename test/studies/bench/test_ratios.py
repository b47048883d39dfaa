# SPDX-License-Identifier: Apache-2.0
"""Candidates that take turns, and the goals of their ratios."""

import pytest

from socialcircle_ros.studies.bench import ratios as module
from socialcircle_ros.studies.bench.candidates import Candidate
from socialcircle_ros.studies.bench.ratios import Figure, RatioGoal, benchmark, ratios


def stopwatch(times_ms, calls, name):
    """A run that returns the next of `times_ms`, and appends its name to `calls`."""
    left = iter(times_ms)

    def run():
        calls.append(name)
        return next(left)

    return run


def test_candidates_take_turns_and_the_median_leaves_out_the_warm_up():
    calls = []
    candidates = [
        Candidate('a', 1, stopwatch([99.0, 3.0, 1.0, 2.0], calls, 'a')),
        Candidate('b', 2, stopwatch([99.0, 30.0, 10.0, 20.0], calls, 'b'), is_peer=True),
    ]

    figures = benchmark(candidates, 3, lambda step: None)

    assert calls == ['a', 'b'] * 4
    assert figures == [Figure('a', 1, False, 2.0, 3), Figure('b', 2, True, 20.0, 3)]


def test_only_slow_peers_are_repeated_less_often():
    calls = []
    candidates = [
        Candidate('ours', 1, stopwatch([1000.0] * 21, calls, 'ours')),
        Candidate('peer', 1, stopwatch([1000.0] * 21, calls, 'peer'), is_peer=True),
    ]

    figures = benchmark(candidates, 20, lambda step: None)

    assert [figure.repeats for figure in figures] == [20, 5]
    assert 'peer' in calls[-8:]  # spread over the run


@pytest.mark.parametrize(('sense', 'ratio', 'is_met'), [
    ('at most', 1.5, True), ('at most', 1.6, False), ('at least', 100.0, True), ('at least', 99.0, False),
])  # fmt: skip
def test_a_ratio_on_the_right_side_of_the_bound_meets_the_goal(sense, ratio, is_met):
    assert RatioGoal('a', 'b', sense, 1.5 if sense == 'at most' else 100).is_met(ratio) is is_met


def test_each_number_of_our_threads_is_compared_with_the_shortest_time_of_a_peer(monkeypatch):
    goals = (RatioGoal('peer', 'ours', 'at least', 5), RatioGoal('ours', '', 'at most', 3))
    monkeypatch.setattr(module, 'GOALS', goals)
    figures = [
        Figure('ours', 1, False, 4.0, 20),
        Figure('ours', 2, False, 2.0, 20),
        Figure('peer', 1, True, 30.0, 20),
        Figure('peer', 2, True, 16.0, 20),
    ]

    found = [(ratio.goal.denominator, ratio.threads, ratio.ratio, ratio.is_met) for ratio in ratios(figures)]

    assert found == [('ours', 1, 4.0, False), ('ours', 2, 8.0, True), ('', 1, 4.0, False), ('', 2, 2.0, True)]


def test_goals_of_peers_that_are_not_installed_are_left_out():
    assert ratios([Figure('exact mode', 1, False, 4.0, 20)]) == []
