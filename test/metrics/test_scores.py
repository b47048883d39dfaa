# SPDX-License-Identifier: Apache-2.0
"""Scores of a mask against the truth, and of a surface."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from naive import scores as naive

from socialcircle_ros.metrics.scores import Tally, cluster_sizes, f1_at, recall_by, rmse, roc_area, score, tally

TRUTH = np.array([[True, True, True, False, False]])

MASKS = st.tuples(*[arrays(bool, (4, 6))] * 3)
VALUES = arrays(np.float32, (4, 6), elements=st.sampled_from([0.0, 0.5, 1.0, 2.0, np.inf]))


def equal(first, second):
    return first == pytest.approx(second) or (math.isnan(first) and math.isnan(second))


def share(part, whole):
    return part / whole if whole else math.nan


def test_precision_recall_and_f1_follow_their_definitions():
    found = np.array([[True, True, False, True, False]])
    scores = score(found, TRUTH, np.ones_like(found))
    assert (scores.precision, scores.recall, scores.f1) == (2 / 3, 2 / 3, 2 / 3)
    assert scores.false_positive_rate == 1 / 2


def test_points_without_a_certain_truth_are_ignored():
    found = np.array([[True, True, False, True, False]])
    counted = np.array([[True, True, False, False, True]])
    scores = score(found, TRUTH, counted)
    assert (scores.precision, scores.recall, scores.false_positive_rate) == (1.0, 1.0, 0.0)


def test_a_score_with_an_empty_denominator_is_nan():
    nothing = np.zeros((1, 5), bool)
    scores = score(nothing, nothing, ~nothing)
    assert math.isnan(scores.precision)
    assert math.isnan(scores.recall)
    assert math.isnan(scores.f1)
    assert scores.false_positive_rate == 0.0


@given(MASKS)
def test_scores_equal_those_counted_point_by_point(masks):
    true_positives, false_positives, missed, true_negatives = naive.confusion(*masks)
    scores = score(*masks)
    assert equal(scores.precision, share(true_positives, true_positives + false_positives))
    assert equal(scores.recall, share(true_positives, true_positives + missed))
    assert equal(scores.f1, share(2 * true_positives, 2 * true_positives + false_positives + missed))
    assert equal(scores.false_positive_rate, share(false_positives, false_positives + true_negatives))


@given(MASKS, VALUES)
def test_the_roc_area_equals_that_counted_pair_by_pair(masks, values):
    _, truth, counted = masks
    assert equal(roc_area(values, truth, counted), naive.roc_area(values, truth, counted))


@given(MASKS, VALUES)
def test_f1_at_many_thresholds_equals_f1_at_each_threshold(masks, values):
    _, truth, counted = masks
    truth[0, 0] = counted[0, 0] = True
    thresholds = np.array([-1.0, 0.0, 0.5, 0.7, 2.0, 9.0])
    expected = [score(values > threshold, truth, counted).f1 for threshold in thresholds]
    assert f1_at(values, truth, counted, thresholds) == pytest.approx(expected)


def test_recall_is_computed_for_each_group():
    found = np.array([[True, False, True, True, False]])
    groups = {'first two': np.array([[1, 1, 0, 0, 0]], bool), 'last two': np.array([[0, 0, 0, 1, 1]], bool)}
    recalls = recall_by(found, TRUTH, np.ones_like(found), groups)
    assert recalls['first two'] == 1 / 2
    assert math.isnan(recalls['last two'])


def test_a_cluster_size_counts_only_outliers():
    cluster = np.array([[0, -1, 2, 2, 2, 1]], np.int32)
    outlier = np.array([[False, True, True, True, False, True]])
    assert cluster_sizes(cluster, outlier).tolist() == [[0, 1, 2, 2, 0, 1]]


def test_rmse_is_over_the_points_that_both_maps_have():
    assert rmse(np.array([[1.0, np.nan, 5.0]]), np.array([[1.0, 2.0, 2.0]])) == pytest.approx(math.sqrt(9 / 2))
    assert math.isnan(rmse(np.full((1, 2), np.nan), np.zeros((1, 2))))


@given(st.lists(st.tuples(*[st.integers(0, 3)] * 3), max_size=5))
def test_the_tallies_of_clouds_add_up_to_that_of_all_points(clouds):
    masks = [tuple(np.arange(4) < each for each in cloud) for cloud in clouds]
    everything = [np.concatenate([np.zeros(0, bool), *(each[i] for each in masks)]) for i in range(3)]
    assert sum((tally(*each) for each in masks), Tally()) == tally(*everything)
    assert repr(score(*everything)) == repr(tally(*everything).scores)
