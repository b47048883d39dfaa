# SPDX-License-Identifier: Apache-2.0
"""Trials of a sweep."""

from dataclasses import replace

import numpy as np
import pytest
from examples import surface
from settings.test_lessons import PLAIN
from sweep.sweep_examples import BASE, labelled, scale, trial, truth

from socialcircle_ros import CircleSettings, remove_outliers
from socialcircle_ros.errors import SettingError
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.point_cloud import encode_point_cloud
from socialcircle_ros.metrics.scores import score
from socialcircle_ros.sweep import trials
from socialcircle_ros.sweep.clouds import sweep_cloud
from socialcircle_ros.sweep.trials import best_of, fingerprint_of, run_trial


def test_clouds_weigh_alike_however_many_outliers_they_have():
    many = surface(140, 160, seed=1)
    many[::3, ::3, 2] += 30
    truth_of_many = np.zeros(many.shape[:2], bool)
    truth_of_many[::3, ::3] = True
    points = encode_point_cloud(Header.at(1, ''), many)
    clouds = [labelled(), sweep_cloud('/points 1', points, (truth_of_many, np.isfinite(many[..., 2])))]
    alone = [run_trial(BASE, scale(0.6), lambda _, each=each: [each]) for each in clouds]
    tried = run_trial(BASE, scale(0.6), lambda _: clouds)
    assert tried.cloud_scores == [each.score for each in alone]
    for name in ('score', 'precision', 'recall', 'removed', 'sq'):
        assert getattr(tried, name) == pytest.approx(np.mean([getattr(each, name) for each in alone]))
    found = remove_outliers(clouds[0].xyz, CircleSettings(mode='paper', radius_scale=0.6)).outliers
    assert tried.cloud_scores[0] == score(found, *truth()).f1
    assert (tried.values, tried.refused) == (scale(0.6), 0)


def test_a_refused_cloud_counts_as_a_cloud_without_a_removed_point():
    empty = encode_point_cloud(Header.at(1, ''), np.full((70, 80, 3), np.nan, np.float32))
    clouds = [labelled(), sweep_cloud('/points 1', empty, truth())]
    tried = run_trial(BASE, {}, lambda _: clouds)
    assert tried.refused == 1
    assert (tried.precision, tried.recall) == (1.0, 0.5)
    alone = run_trial(BASE, {}, lambda _: clouds[1:])
    assert (alone.score, alone.sq, alone.milliseconds) == (0.0, None, None)


def test_what_is_done_once_in_a_process_is_not_in_the_time(monkeypatch):
    """A slow first call stands for the compilation of the kernels."""
    monkeypatch.setattr(trials, '_loaded', set())
    calls = []

    def filtered(xyz, settings):
        calls.append(settings)
        return replace(remove_outliers(xyz, settings), times_ms={'vote': 1.0 if calls[:-1] else 9000.0})

    monkeypatch.setattr(trials, 'remove_outliers', filtered)
    assert run_trial(BASE, {}, lambda _: [labelled()]).milliseconds == 1.0
    assert run_trial(BASE, {}, lambda _: [labelled()]).milliseconds == 1.0
    assert len(calls) == 3


def test_the_score_is_1_where_no_point_should_be_removed_and_none_was():
    z = np.random.default_rng(0).random((70, 80)).astype(np.float32) / 10
    y, x = np.mgrid[:70, :80].astype(np.float32)
    flat = encode_point_cloud(Header.at(1, ''), np.dstack([x, y, z]))
    none = np.zeros((70, 80), bool)
    tried = run_trial(BASE, {}, lambda _: [sweep_cloud('/points 0', flat, (none, ~none))])
    assert (tried.score, tried.precision, tried.recall) == (1.0, None, None)


def test_a_bad_setting_is_refused():
    with pytest.raises(SettingError):
        run_trial(BASE, {'circle.window': 4}, lambda _: [labelled()])


def test_the_best_of_equal_trials_removes_the_fewest_points():
    trials = [trial(1.0, 0.8), trial(2.0, 0.9, 0.3), trial(3.0, 0.9, 0.2), trial(4.0, 0.9, 0.2)]
    assert best_of(trials) == trials[2]


def test_a_fingerprint_depends_on_what_lessons_hold(tmp_path):
    path, prints = tmp_path / 'lid.json', set()
    for threshold in (0.5, 0.6):
        path.write_text(replace(PLAIN, threshold=threshold).to_text())
        prints.add(fingerprint_of([labelled()], BASE, [str(path)]))
    assert len(prints | {fingerprint_of([labelled()], BASE)}) == 3


def test_a_fingerprint_depends_on_clouds_truth_and_fixed_parameters():
    found = labelled()
    prints = {
        fingerprint_of([found], BASE),
        fingerprint_of([found, found], BASE),
        fingerprint_of([replace(found, outlier=~found.outlier)], BASE),
        fingerprint_of([labelled(seed=1)], BASE),
        fingerprint_of([found], {**BASE, 'circle.window': 5}),
    }
    assert len(prints) == 5
    assert fingerprint_of([labelled()], dict(reversed(BASE.items()))) in prints
