"""Trying settings on clouds."""

import json
from dataclasses import replace

import numpy as np
import pytest
from examples import cloud, surface
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros import CircleSettings, FocusSettings, remove_outliers
from socialcircle_ros.errors import MessageError, SettingError, SocialCircleError
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.point_cloud import encode_point_cloud
from socialcircle_ros.metrics.scores import Tally, score, tally
from socialcircle_ros.sweep.search_space import parse_dimension
from socialcircle_ros.sweep.trials import (
    Search,
    Trial,
    TrialFile,
    attempt,
    best_of,
    evenly,
    fingerprint_of,
    remembered,
    sweep_cloud,
    untried,
)

BASE = {**FocusSettings().to_ros(), **CircleSettings().to_ros()}


def truth():
    z = surface()[..., 2]
    return np.abs(z) > 20, np.isfinite(z)


def known(name='/points 0', **options):
    return sweep_cloud(name, cloud(**options), truth())


def scale(value):
    return {'circle.radius_scale': value}


def trial(value, score=1.0, removed=0.1):
    return Trial(scale(value), score, 0.5, None, removed, 1.0, 2.0, 3.0, 0)


def test_a_trial_is_scored_against_the_truth_of_all_clouds_together():
    cases = [known(), known(seed=1)]
    found = [remove_outliers(case.xyz, CircleSettings(radius_scale=0.6)).outliers for case in cases]
    counts = sum((tally(mask, *truth()) for mask in found), Tally())
    tried = attempt(BASE, scale(0.6), lambda _: cases)
    assert (tried.score, tried.precision, tried.recall) == (
        counts.scores.f1, counts.scores.precision, counts.scores.recall,
    )  # fmt: skip
    measured = sum(np.isfinite(case.xyz[..., 2]).sum() for case in cases)
    assert tried.removed == sum(mask.sum() for mask in found) / measured
    assert (tried.values, tried.refused) == (scale(0.6), 0)


def test_without_a_truth_what_stands_out_from_its_neighbours_takes_its_place():
    case = sweep_cloud('/points 0', cloud(), None)
    assert not case.known
    assert (case.outlier & truth()[0]).sum() == 26
    assert (case.counted == truth()[1]).all()


def test_a_cloud_that_has_no_answer_counts_as_one_of_which_nothing_was_removed():
    empty = encode_point_cloud(Header.at(1, ''), np.full((70, 80, 3), np.nan, np.float32))
    cases = [known(), sweep_cloud('/points 1', empty, truth())]
    tried = attempt(BASE, {}, lambda _: cases)
    assert tried.refused == 1
    assert (tried.precision, tried.recall) == (1.0, 0.5)
    alone = attempt(BASE, {}, lambda _: cases[1:])
    assert (alone.score, alone.sq, alone.milliseconds) == (0.0, None, None)


def test_where_nothing_is_to_be_removed_and_nothing_is_the_score_is_full():
    z = np.random.default_rng(0).random((70, 80)).astype(np.float32) / 10
    y, x = np.mgrid[:70, :80].astype(np.float32)
    flat = encode_point_cloud(Header.at(1, ''), np.dstack([x, y, z]))
    none = np.zeros((70, 80), bool)
    tried = attempt(BASE, {}, lambda _: [sweep_cloud('/points 0', flat, (none, ~none))])
    assert (tried.score, tried.precision, tried.recall) == (1.0, None, None)


def test_what_cannot_be_set_is_told():
    with pytest.raises(SettingError):
        attempt(BASE, {'circle.window': 4}, lambda _: [known()])


def test_a_cloud_without_rows_and_columns_is_no_case():
    with pytest.raises(MessageError, match='not organized'):
        sweep_cloud('/points 0', cloud(1, 9), None)


def test_of_equal_trials_the_one_that_removes_least_is_best():
    trials = [trial(1.0, 0.8), trial(2.0, 0.9, 0.3), trial(3.0, 0.9, 0.2), trial(4.0, 0.9, 0.2)]
    assert best_of(trials) == trials[2]


@given(st.lists(st.tuples(*[st.integers(0, 3)] * 3), max_size=5))
def test_counts_of_clouds_add_up_to_those_of_all(clouds):
    masks = [tuple(np.arange(4) < each for each in cloud) for cloud in clouds]
    everything = [np.concatenate([np.zeros(0, bool), *(each[i] for each in masks)]) for i in range(3)]
    assert sum((tally(*each) for each in masks), Tally()) == tally(*everything)
    one, other = score(*everything), tally(*everything).scores
    assert repr(one) == repr(other)


@given(st.integers(0, 300), st.integers(1, 20))
def test_a_few_of_many_are_spread_over_all(count, most):
    chosen = evenly(iter(range(count)), most)
    assert chosen == sorted(set(chosen))
    assert len(chosen) == min(count, most)
    gaps = np.diff([*chosen, count])
    assert not len(gaps) or gaps.max() <= 4 * max(1, count / most)


def test_clouds_are_loaded_once_for_each_setting_of_the_stacks():
    loaded = []

    def load(focus):
        loaded.append(focus)
        return [known()]

    cases = remembered(load)
    one, two, three = FocusSettings(), FocusSettings(step=1), FocusSettings(step=3)
    for focus in (one, one, two, one, two, three, two):
        cases(focus)
    assert loaded == [one, two, three]


class TestTrialFile:
    def test_finished_trials_are_there_again(self, tmp_path):
        file = TrialFile(tmp_path / 'trials.jsonl', 'print')
        file.add(trial(0.5))
        file.add(trial(1.0))
        file.close()
        again = TrialFile(tmp_path / 'trials.jsonl', 'print')
        assert again.trials == [trial(0.5), trial(1.0)]

    @given(cut=st.integers(1, 60))
    def test_a_line_that_was_cut_short_is_tried_again(self, cut, tmp_path_factory):
        path = tmp_path_factory.mktemp('sweep') / 'trials.jsonl'
        file = TrialFile(path, 'print')
        file.add(trial(0.5))
        file.add(trial(1.0))
        file.close()
        path.write_bytes(path.read_bytes()[:-cut])
        again = TrialFile(path, 'print')
        assert again.trials == [trial(0.5)]
        again.add(trial(2.0))
        again.close()
        assert TrialFile(path, 'print').trials == [trial(0.5), trial(2.0)]

    def test_trials_on_other_clouds_are_not_taken(self, tmp_path):
        file = TrialFile(tmp_path / 'trials.jsonl', 'print')
        file.add(trial(0.5))
        file.close()
        with pytest.raises(SocialCircleError, match='other clouds'):
            TrialFile(tmp_path / 'trials.jsonl', 'another')
        assert not TrialFile(tmp_path / 'trials.jsonl', 'another', restart=True).trials

    @pytest.mark.parametrize('content', ['hello\n', '{"sweep": 1}\n{"odd": 2}\n', '[]\n', '{}\n', '3\n'])
    def test_a_file_of_something_else_is_left_as_it_is(self, tmp_path, content):
        (tmp_path / 'trials.jsonl').write_text(content)
        with pytest.raises(SocialCircleError):
            TrialFile(tmp_path / 'trials.jsonl', 'print')
        assert (tmp_path / 'trials.jsonl').read_text() == content


def test_a_fingerprint_tells_clouds_truths_and_fixed_parameters_apart():
    case = known()
    prints = {
        fingerprint_of([case], BASE),
        fingerprint_of([case, case], BASE),
        fingerprint_of([replace(case, outlier=~case.outlier)], BASE),
        fingerprint_of([known(seed=1)], BASE),
        fingerprint_of([case], {**BASE, 'circle.window': 5}),
    }
    assert len(prints) == 5
    assert fingerprint_of([known()], dict(reversed(BASE.items()))) in prints


def test_what_was_tried_is_not_tried_again():
    assert untried([scale(1.0), scale(2.0)], [trial(1.0)]) == [scale(2.0)]


class TestSearch:
    @pytest.fixture(autouse=True)
    def needs_optuna(self):
        pytest.importorskip('optuna')

    SPACE = (parse_dimension('circle.radius_scale=0.5:3'), parse_dimension('circle.window=3:31:2'))

    def search(self, count, done=(), search_space=SPACE):
        """Settings that were tried where the score falls off from radius_scale 2."""
        study, tried = Search(search_space, count, done), []
        for values in study:
            tried.append(replace(trial(0), values=values, score=-abs(values.get('circle.radius_scale', 0) - 2)))
            study.tell(tried[-1])
        return tried

    def test_it_comes_near_the_best(self):
        tried = self.search(40)
        assert len(tried) == 40
        assert abs(best_of(tried).values['circle.radius_scale'] - 2) < 0.1

    def test_it_goes_on_from_what_was_tried(self):
        done = self.search(20)
        more = self.search(30, done)
        assert len(more) == 10
        assert not {json.dumps(each.values) for each in done} & {json.dumps(each.values) for each in more}

    def test_it_ends_where_there_is_nothing_new(self):
        tried = self.search(40, search_space=[parse_dimension('circle.window=3,5,7')])
        assert sorted(each.values['circle.window'] for each in tried) == [3, 5, 7]

    def test_what_lies_outside_is_no_help(self):
        assert (
            len(self.search(5, [replace(trial(9.0), values={'circle.radius_scale': 9.0, 'circle.window': 3})]))
            == 5
        )


def test_a_search_without_optuna_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(__import__('sys').modules, 'optuna', None)
    with pytest.raises(SocialCircleError, match=r'pip install "socialcircle_ros\[tuning\]"'):
        Search(TestSearch.SPACE, 5, ())
