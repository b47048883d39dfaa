# SPDX-License-Identifier: Apache-2.0
"""Outliers put into fields."""

import numpy as np
import pytest
from good_parts import drilled, part

from socialcircle_ros.teaching.clouds import good_fields
from socialcircle_ros.teaching.examples import CHECKED, TAUGHT, communities_in, with_outliers

PLACE = good_fields([part(drilled())])[0][0]


def test_one_kind_of_those_taught_and_checked_lies_at_edges():
    assert [kind.at_edges for kind in TAUGHT] == [False, False, False, True]
    assert [kind.at_edges for kind in CHECKED] == [False, False, False, True]
    assert 'at steps and beside holes' in CHECKED[-1].name


@pytest.mark.parametrize('kind', [TAUGHT[-1], CHECKED[-1]])
def test_outliers_at_edges_lie_there_and_are_the_same_for_a_seed(kind):
    example = with_outliers(PLACE, kind, 3)
    assert PLACE.edges[example.outlier].mean() > 0.85
    np.testing.assert_array_equal(with_outliers(PLACE, kind, 3).heights, example.heights)
    assert (with_outliers(PLACE, kind, 4).outlier != example.outlier).any()


def test_a_field_without_edges_gets_as_many():
    flat = good_fields([part(np.zeros((200, 300)))])[0][0]
    number = np.count_nonzero(with_outliers(flat, TAUGHT[-1], 1).outlier)
    assert number == pytest.approx(TAUGHT[-1].contamination.share * flat.heights.size, abs=1)


def test_fewer_points_are_found_at_a_higher_level_for_one_run_of_the_network():
    example, runs = with_outliers(PLACE, TAUGHT[1], 1), []

    def likelihood(heights):
        runs.append(heights)
        return np.where(example.outlier, 150, 60).astype(np.uint8) * np.isfinite(heights)

    low, high = communities_in(example, (0.2, 0.5), likelihood)[0]
    assert len(runs) == 1
    assert low.good.sum() > 0
    assert high.outliers.sum() == np.count_nonzero(example.outlier)
    assert high.good.sum() < low.good.sum() / 10
    np.testing.assert_array_equal(high.weights, np.abs(high.outliers - high.good))
