# SPDX-License-Identifier: Apache-2.0
"""How the probabilities of the points decide."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.circle.adaptive import find_outliers, find_probable_outliers
from socialcircle_ros.circle.adaptive.likelihood import probable_outliers, sureness_about_sets

# Not those of the code, which is held to these.
ONE = 255
FEW, MANY = 0.1, 0.2
PROBABLE, PROBABLE_AMONG_MANY = 0.5, 0.2
CERTAIN, CERTAIN_AMONG_MANY = 0.8, 0.5
UNDECIDED, SET = 0.2, 6


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


def between(share, least, most):
    place = min(max((share - FEW) / (MANY - FEW), 0), 1)
    return round((least + (most - least) * place) * ONE)


def naively_found(probabilities, measured):
    share = probabilities.sum() / ONE / measured.sum()
    probable = between(share, PROBABLE, PROBABLE_AMONG_MANY)
    certain = between(share, CERTAIN, CERTAIN_AMONG_MANY)
    outliers = np.zeros(measured.shape, bool)
    for members in naive_communities(probabilities > probable):
        if max(probabilities[each] for each in members) > certain:
            outliers[tuple(zip(*members, strict=True))] = True
    return outliers


@given(st.integers(0, 10**6), st.integers(1, 14), st.integers(1, 19))
def test_a_community_is_one_of_outliers_if_one_of_its_points_is_certain(seed, height, width):
    random = np.random.default_rng(seed)
    measured = random.random((height, width)) < 0.9
    measured[0, 0] = True
    probabilities = in_255ths(random.random((height, width)) ** random.choice([1, 4, 30]) * measured)
    decided = probable_outliers(probabilities, measured)
    outliers, score, communities = decided.outliers, decided.score, decided.communities
    np.testing.assert_array_equal(outliers, naively_found(probabilities, measured))
    labelled = {}
    for point, label in zip(communities.points.tolist(), communities.labels.tolist(), strict=True):
        labelled.setdefault(label, set()).add(divmod(point, width))
    members = {frozenset(map(tuple, each)) for each in naive_communities(outliers)}
    assert {frozenset(each) for each in labelled.values()} == members
    assert all(0 <= label < communities.number for label in labelled)
    np.testing.assert_array_equal(score > 0.5, outliers)
    np.testing.assert_array_equal(np.isnan(score), ~measured)
    assert np.nanmin(score) >= 0
    assert np.nanmax(score) <= 1
    for shares, points in (
        (decided.sureness, measured),
        (sureness_about_sets(probabilities, measured), in_sets(probabilities > UNDECIDED * ONE)),
    ):
        certain = (points & (probabilities > CERTAIN * ONE)).sum()
        assert shares.certain == certain / measured.sum()
        assert shares.undecided == ((points & (probabilities > UNDECIDED * ONE)).sum() - certain) / measured.sum()


def in_sets(suspected):
    found = np.zeros(suspected.shape, bool)
    for members in naive_communities(suspected):
        if len(members) >= SET:
            found[tuple(zip(*members, strict=True))] = True
    return found


def noise():
    return np.random.default_rng(3).normal(size=(90, 120)).astype(np.float32)


def test_the_probabilities_decide_where_nothing_is_far_off():
    heights = noise()
    heights[20:25, 15:21] += 6
    assert find_outliers(heights).outliers[20:25, 15:21].any()
    probabilities = np.zeros_like(heights)
    probabilities[40:46, 60:67] = 0.7
    probabilities[70, 80] = 0.9
    probabilities[70, 81], probabilities[71, 82], probabilities[70, 83] = 0.7, 0.65, 0.45
    result = find_probable_outliers(heights, lambda given: in_255ths(probabilities))
    assert np.argwhere(result.outliers).tolist() == [[70, 80], [70, 81], [71, 82]]
    assert result.score[70, 80] > result.score[70, 81] > 0.5 > result.score[40, 60] > result.score[70, 83]
    assert result.islands_kept == 0
    assert result.sureness == ((45 / heights.size, 1 / heights.size),)  # those beside the certain one, too
    assert result.nearly == 0


def test_single_outliers_do_not_hide_undecided_sets():
    heights, probabilities = noise(), np.zeros((90, 120))
    probabilities[40:46, 60:67] = 0.7
    probabilities[::9, ::9] = 0.9
    probabilities[1::18, ::9] = 0.7  # beside single outliers
    singles = np.count_nonzero(probabilities == 0.9)
    result = find_probable_outliers(heights, lambda given: in_255ths(probabilities))
    everywhere, sets = result.sureness
    assert everywhere.certain * heights.size == pytest.approx(singles)
    assert everywhere.undecided < everywhere.certain
    assert sets.undecided * heights.size == pytest.approx(42, abs=3)
    assert sets.certain * heights.size <= 4


@pytest.mark.parametrize(('elsewhere', 'falls'), [(0.0, False), (0.19, True)])
def test_among_many_outliers_a_community_needs_less(elsewhere, falls):
    heights = noise()
    probabilities = np.full_like(heights, elsewhere)
    probabilities[40:46, 60:67] = 0.6
    result = find_probable_outliers(heights, lambda given: in_255ths(probabilities))
    assert result.outliers[40:46, 60:67].all() == falls
    assert result.outliers.sum() == (42 if falls else 0)


def test_the_network_sees_the_heights_as_they_came():
    heights = noise()
    heights[3, 4] = np.nan
    seen = []

    def likelihood(given):
        seen.append(given)
        return np.zeros(given.shape, np.uint8)

    result = find_probable_outliers(heights, likelihood)
    np.testing.assert_array_equal(seen[0], heights)
    assert np.isnan(result.score[3, 4])


@pytest.mark.parametrize('measured', [(0, 0), (2, 3)])
def test_one_measured_point_is_kept_or_falls(measured):
    heights = np.full((measured[0] + 1, measured[1] + 1), np.nan)
    heights[measured] = 1e9
    for probability, falls in ((0.1, False), (1.0, True)):
        result = find_probable_outliers(heights, lambda given, p=probability: in_255ths(np.isfinite(given) * p))
        assert result.outliers[measured] == falls
        assert result.outliers.sum() == falls
        assert np.isfinite(result.score).sum() == 1


def test_the_spread_is_that_of_the_rules_where_few_points_are_outliers():
    heights = noise()
    heights[20:25, 15:21] += 40
    heights[40:46, 60:67] += 40
    result = find_probable_outliers(heights, lambda given: np.zeros(given.shape, np.uint8))
    assert result.spread == pytest.approx(find_outliers(heights).spread, rel=0.02)


def test_islands_of_one_height_are_kept_whatever_their_probability():
    heights, discs = noise(), np.zeros((90, 120), bool)
    for top in range(5, 85, 16):
        for left in range(5, 115, 16):
            discs[top : top + 5, left : left + 6] = True
    heights[discs] += 30
    heights[60, 22] += 60
    single = np.zeros(discs.shape, bool)
    single[60, 22] = True
    result = find_probable_outliers(heights, lambda given: np.where(discs | single, 255, 0).astype(np.uint8))
    np.testing.assert_array_equal(result.outliers, single)
    np.testing.assert_array_equal(result.score > 0.5, single)
    assert result.islands_kept == 35
    assert not result.kept_narrowly
    assert result.taken_for_parts.number == 0


def test_islands_far_off_that_the_probabilities_do_not_know_are_counted():
    heights = noise()
    heights[10:20, 10:20] += 200
    heights[50:60, 70:79] += 300
    heights[70:75, 20:25] += 300
    result = find_probable_outliers(heights, lambda given: np.zeros(given.shape, np.uint8))
    assert result.outliers[70:75, 20:25].all()  # too small to count
    assert result.taken_for_parts == (2, 190, 100)
    known = np.zeros(heights.shape)
    known[10:20, 10:20] = 1
    assert find_probable_outliers(heights, lambda given: in_255ths(known)).taken_for_parts == (1, 90, 90)
