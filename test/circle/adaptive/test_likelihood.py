# SPDX-License-Identifier: Apache-2.0
"""How probabilities decide about what the rules found."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.circle.adaptive import find_outliers
from socialcircle_ros.circle.adaptive.likelihood import (
    CERTAIN,
    COVERED,
    LIKELY,
    LIKELY_AMONG_MANY,
    ONE,
    PROBABLE,
    judged_by,
)


def in_255ths(probabilities):
    return np.rint(probabilities * ONE).astype(np.uint8)


def naive_communities(mask):
    """Lists of points, each by a search from its first point."""
    left = mask.copy()
    for start in np.argwhere(mask):
        members, waiting = [], [tuple(start)]
        while waiting:
            row, column = waiting.pop()
            if 0 <= row < mask.shape[0] and 0 <= column < mask.shape[1] and left[row, column]:
                left[row, column] = False
                members.append((row, column))
                waiting += [(row + y, column + x) for y in (-1, 0, 1) for x in (-1, 0, 1)]
        if members:
            yield members


def naively_judged(probabilities, measured, found):
    probabilities = probabilities / ONE
    share = probabilities.sum() / measured.sum()
    least = min(max(LIKELY + (LIKELY_AMONG_MANY - LIKELY) * (share - 0.03) / 0.1, LIKELY_AMONG_MANY), LIKELY)
    islands = np.zeros(found.shape, bool)
    for members in naive_communities(found):
        if np.mean([float(probabilities[each]) for each in members]) > least:
            islands[tuple(zip(*members, strict=True))] = True
    outliers = islands.copy()
    for members in naive_communities(probabilities > PROBABLE):
        covered = sum(islands[each] for each in members) / len(members)
        if max(probabilities[each] for each in members) > CERTAIN and covered < COVERED:
            outliers[tuple(zip(*members, strict=True))] = True
    return outliers


@given(st.integers(0, 10**6), st.integers(1, 14), st.integers(1, 19), st.sampled_from([0.05, 0.4, 0.9]))
def test_each_community_is_judged_by_its_mean_probability(seed, height, width, share):
    random = np.random.default_rng(seed)
    measured = random.random((height, width)) < 0.9
    measured[0, 0] = True
    probabilities = in_255ths(random.random((height, width)) ** random.choice([1, 4, 30]) * measured)
    found = measured & (random.random((height, width)) < share)
    steepness = random.random((height, width)).astype(np.float32)
    outliers = judged_by(probabilities, measured, found, steepness)
    np.testing.assert_array_equal(outliers, naively_judged(probabilities, measured, found))
    assert (steepness >= 0).all()
    assert (steepness <= 1).all()


def two_patches():
    heights = np.random.default_rng(3).normal(size=(90, 120)).astype(np.float32)
    heights[20:25, 15:21] += 40
    heights[40:46, 60:67] += 40
    return heights


def test_an_improbable_island_stays_and_a_probable_point_falls():
    heights = two_patches()
    rules = find_outliers(heights)
    assert rules.outliers[20:25, 15:21].all()
    probabilities = np.zeros_like(heights)
    probabilities[40:46, 60:67] = 0.7
    probabilities[70, 80] = probabilities[39, 60] = 0.9
    probabilities[70, 81], probabilities[70, 82] = 0.7, 0.5
    result = find_outliers(heights, likelihood=lambda given: in_255ths(probabilities))
    assert not result.outliers[20:25, 15:21].any()
    assert result.outliers[40:46, 60:67].all()
    assert result.outliers[70, 80:83].tolist() == [True, True, False]
    assert not result.outliers[39, 60]  # beside an island, whose border the rules know better
    np.testing.assert_array_equal(result.score > 0.5, result.outliers)
    assert result.score[22, 17] < 0.5


@pytest.mark.parametrize(('elsewhere', 'falls'), [(0.0, False), (0.2, True)])
def test_among_many_outliers_an_island_needs_less(elsewhere, falls):
    heights = two_patches()
    probabilities = np.full_like(heights, elsewhere)
    probabilities[40:46, 60:67] = 0.15
    result = find_outliers(heights, likelihood=lambda given: in_255ths(probabilities))
    assert result.outliers[40:46, 60:67].all() == falls


def test_the_network_sees_the_heights_as_they_came():
    heights = two_patches()
    heights[3, 4] = np.nan
    seen = []

    def likelihood(given):
        seen.append(given)
        return np.zeros(given.shape, np.uint8)

    find_outliers(heights, likelihood=likelihood)
    np.testing.assert_array_equal(seen[0], heights)


def test_islands_of_one_height_are_left_to_the_probabilities():
    heights = np.random.default_rng(3).normal(size=(120, 160)).astype(np.float32)
    for row in range(8, 110, 16):
        for column in range(8, 150, 16):
            heights[row : row + 4, column : column + 4] += 40
    assert find_outliers(heights).islands_kept > 50
    result = find_outliers(heights, likelihood=lambda given: in_255ths(given > 20))
    assert result.islands_kept == 0
    assert result.outliers[heights > 30].all()
