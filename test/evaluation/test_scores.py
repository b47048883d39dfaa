"""Scores of a mask."""

import math

import numpy as np

from socialcircle_ros.evaluation.scores import score

TRUTH = np.array([[True, True, True, False, False]])


def test_precision_and_recall_count_what_they_say():
    found = np.array([[True, True, False, True, False]])
    scores = score(found, TRUTH, np.ones_like(found))
    assert (scores.precision, scores.recall) == (2 / 3, 2 / 3)


def test_points_of_unknown_truth_do_not_count():
    found = np.array([[True, True, False, True, False]])
    counted = np.array([[True, True, False, False, True]])
    scores = score(found, TRUTH, counted)
    assert (scores.precision, scores.recall) == (1.0, 1.0)


def test_where_nothing_is_called_or_there_the_share_is_unknown():
    nothing = np.zeros((1, 5), bool)
    scores = score(nothing, nothing, ~nothing)
    assert math.isnan(scores.precision)
    assert math.isnan(scores.recall)
