# SPDX-License-Identifier: Apache-2.0
"""The exact medians of the distances (section 3.2.1, eq. 5)."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from point_sets import contaminated_sheet, hard_point_sets

from socialcircle_ros.circle import medians
from socialcircle_ros.circle.medians import median_distances


def sorted_medians(points):
    """mu of each point, by sorting its distances from the others."""
    mu = []
    for p in range(points.shape[1]):
        dx, dy, dz = np.delete(points, p, axis=1) - points[:, p, None]
        distances = np.sort(np.sqrt((dx * dx + dy * dy) + dz * dz))
        middle = len(distances) // 2
        odd = len(distances) % 2
        mu.append(distances[middle] if odd else (distances[middle - 1] + distances[middle]) / 2)
    return np.array(mu)


@pytest.mark.parametrize('points', list(hard_point_sets()))
def test_medians_are_those_of_the_sorted_distances(points):
    with np.errstate(over='ignore', under='ignore'):
        np.testing.assert_array_equal(median_distances(points), sorted_medians(points))


def test_medians_of_more_leaves_than_a_word_has_bits_are_those_of_the_sorted_distances():
    points = contaminated_sheet(50, 61)

    np.testing.assert_array_equal(median_distances(points), sorted_medians(points))


def test_median_of_a_single_point_is_0():
    np.testing.assert_array_equal(median_distances(np.ones((3, 1))), [0.0])


def test_medians_do_not_depend_on_the_number_of_threads(monkeypatch):
    points = contaminated_sheet(50, 60)
    monkeypatch.setattr(medians, '_LEAST_POINTS_PER_BAND', 1)

    found = []
    for threads in (1, 2, 7):
        monkeypatch.setattr('socialcircle_ros.kernels.bands.limit', threads)
        found.append(median_distances(points))

    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 200), st.integers(0, 2**16), st.integers(0, 4), st.integers(0, 4))
def test_chosen_leaves_are_all_that_may_reach_between_the_bounds(count, random, low, span):
    generator = np.random.default_rng(random)
    least = generator.integers(0, 6, 264).astype(np.float32)  # entries behind `count` must not be chosen
    most = least + generator.integers(0, 3, 264).astype(np.float32)
    sizes, chosen = generator.integers(1, 33, 264), np.empty(264, np.int64)
    high = low + span

    below, m = medians._choose(least, most, sizes, count, np.float32(low), np.float32(high), chosen)

    least, most, sizes = least[:count], most[:count], sizes[:count]
    assert below == sizes[most < low].sum()
    assert chosen[:m].tolist() == np.flatnonzero((most >= low) & (least <= high)).tolist()
