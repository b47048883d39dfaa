"""Contestants that take turns, and the goals of their ratios."""

import pytest

from socialcircle_ros.kernels import bands
from socialcircle_ros.studies.bench import ratios as racing
from socialcircle_ros.studies.bench.ratios import Candidate, Figure, RatioGoal, all_candidates, benchmark, ratios


def stopwatch(times, calls, name):
    """A call that says that it took the next of `times`, and notes its name."""
    left = iter(times)

    def call():
        calls.append(name)
        return next(left)

    return call


def test_contestants_take_turns_and_the_median_counts_but_not_the_first_time():
    calls = []
    candidates = [
        Candidate('a', 1, stopwatch([99.0, 3.0, 1.0, 2.0], calls, 'a')),
        Candidate('b', 2, stopwatch([99.0, 30.0, 10.0, 20.0], calls, 'b'), is_peer=True),
    ]

    figures = benchmark(candidates, 3, lambda words: None)

    assert calls == ['a', 'b'] * 4
    assert figures == [Figure('a', 1, False, 2.0, 3), Figure('b', 2, True, 20.0, 3)]


def test_only_slow_peers_run_fewer_times():
    calls = []
    candidates = [
        Candidate('ours', 1, stopwatch([1000.0] * 21, calls, 'ours')),
        Candidate('peer', 1, stopwatch([1000.0] * 21, calls, 'peer'), is_peer=True),
    ]

    figures = benchmark(candidates, 20, lambda words: None)

    assert [figure.repeats for figure in figures] == [20, 5]
    assert 'peer' in calls[-8:]  # spread over the run


def test_a_call_that_does_not_say_is_timed():
    (figure,) = benchmark([Candidate('a', 1, lambda: None)], 2, lambda words: None)

    assert 0 <= figure.milliseconds < 1000


@pytest.mark.parametrize(('sense', 'ratio', 'holds'), [
    ('at most', 1.5, True), ('at most', 1.6, False), ('at least', 100.0, True), ('at least', 99.0, False),
])  # fmt: skip
def test_a_goal_holds_on_its_side_of_the_bound(sense, ratio, holds):
    assert RatioGoal('a', 'b', sense, 1.5 if sense == 'at most' else 100).holds(ratio) is holds


def test_each_number_of_our_threads_is_compared_with_the_fastest_figure_of_a_peer(monkeypatch):
    monkeypatch.setattr(
        racing, 'GOALS', (RatioGoal('peer', 'ours', 'at least', 5), RatioGoal('ours', '', 'at most', 3))
    )
    figures = [
        Figure('ours', 1, False, 4.0, 20),
        Figure('ours', 2, False, 2.0, 20),
        Figure('peer', 1, True, 30.0, 20),
        Figure('peer', 2, True, 16.0, 20),
    ]

    found = [(ratio.goal.denominator, ratio.threads, ratio.ratio, ratio.holds) for ratio in ratios(figures)]

    assert found == [('ours', 1, 4.0, False), ('ours', 2, 8.0, True), ('', 1, 4.0, False), ('', 2, 2.0, True)]


def test_goals_of_peers_that_are_not_there_are_left_out():
    assert ratios([Figure('exact mode', 1, False, 4.0, 20)]) == []


def test_every_goal_names_contestants_and_threads_are_limited_for_a_call_only():
    with all_candidates() as candidates:
        names = {candidate.name for candidate in candidates}
        before = bands.limit
        candidates[0].call()
        assert bands.limit == before
    for goal in racing.GOALS:
        for name in (goal.numerator, goal.denominator):
            assert name in names or name == '' or name.split()[0] in {'PCL', 'Open3D', 'OpenCV'}


def test_numpy_s_vote_elects_who_wins_ours():
    xyz = racing.make_scene('metal_groove', 60, 60).points

    assert divmod(racing._numpy_vote(xyz.reshape(-1, 3).astype(float)), 60) == racing.elect_seed(
        xyz, (0, 0, 60, 60)
    )
