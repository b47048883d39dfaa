# SPDX-License-Identifier: Apache-2.0
"""The radius of the circle (section 3.2.2, eq. 6 and 7)."""

import math

import numpy as np
import pytest
from clouds import flat, grid, measured_points, recipes
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from naive import circle as naive

from socialcircle_ros.circle.radius import circle_limit, ring_limit
from socialcircle_ros.errors import CloudError, NoRadiusError

WINDOWS = (3, 5, 7, 9)


def ring_of(seed, k):
    """(row, column) of the outer ring of a square of (4k+1)×(4k+1) points, in row order."""
    around = range(-2 * k, 2 * k + 1)
    return [(seed[0] + r, seed[1] + c) for r in around for c in around if max(abs(r), abs(c)) == 2 * k]


@settings(max_examples=700, deadline=None)
@given(recipes(), st.sampled_from(WINDOWS), st.integers(0, 24 * 24))
def test_limit_is_that_of_the_reference_bit_for_bit(recipe, window, pick):
    xyz = recipe.cloud()
    points = measured_points(xyz)
    assume(points)
    seed = points[pick % len(points)]
    try:
        expected = naive.ring_limit(xyz, seed, window)
    except NoRadiusError:
        with pytest.raises(NoRadiusError, match='ring'):
            ring_limit(xyz, seed, window)
    else:
        limit = ring_limit(xyz, seed, window)
        assert limit.dtype == xyz.dtype
        assert limit == expected


@settings(max_examples=200, deadline=None)
@given(recipes(24, 24, least_rows=17, least_columns=17), st.sampled_from(WINDOWS))
def test_limit_of_a_ring_inside_the_cloud_is_that_of_the_reference(recipe, window):
    xyz = recipe.cloud()
    seed = (recipe.rows // 2, recipe.columns // 2)
    assume(np.isfinite(xyz[seed]).all())
    try:
        expected = naive.ring_limit(xyz, seed, window)
    except NoRadiusError:
        return
    assert ring_limit(xyz, seed, window) == expected


@pytest.mark.parametrize('dtype', ['float32', 'float64'])
@pytest.mark.parametrize('window', WINDOWS)
def test_radius_of_a_flat_grid_is_root_5_pitches_times_half_the_window(window, dtype):
    k = window // 2
    pitch = 0.5

    limit = ring_limit(flat(24, 24, pitch, dtype), (12, 12), window)

    assert limit.dtype == dtype
    assert limit == 5 * k * k * pitch * pitch
    assert math.sqrt(limit) == pytest.approx(math.sqrt(5) * k * pitch)


@pytest.mark.parametrize('window', WINDOWS)
def test_radius_is_index_8k_of_the_sorted_ring(window):
    k = window // 2
    seed = (8, 8)
    heights = np.zeros((17, 17))
    heights[tuple(zip(*ring_of(seed, k), strict=True))] = np.random.default_rng(k).permutation(16 * k) * 1e3
    xyz = grid(heights)

    ring = sorted(np.square(xyz[place] - xyz[seed]).sum() for place in ring_of(seed, k))

    assert ring_limit(xyz, seed, window) == pytest.approx(ring[8 * k], rel=1e-12)


@pytest.mark.parametrize('window', WINDOWS)
@pytest.mark.parametrize('lost', [1, 2, 3])
def test_where_ring_points_are_missing_the_radius_is_the_middle_of_the_others(window, lost):
    k = window // 2
    seed = (8, 8)
    places = ring_of(seed, k)
    heights = np.zeros((17, 17))
    heights[tuple(zip(*places, strict=True))] = np.arange(16 * k) * 1e3
    heights[tuple(zip(*places[-lost:], strict=True))] = np.nan  # the highest

    # Heights increase by 1000 along the ring, so that the ring is sorted already.
    row, column = places[(16 * k - lost) // 2]
    expected = (row - 8) ** 2 + (column - 8) ** 2 + heights[row, column] ** 2

    assert ring_limit(grid(heights), seed, window) == expected


def test_ring_points_beyond_the_border_are_missing():
    # In the corner, 5 of the 16 ring points exist. Their squared distances are 4, 4, 5, 5, 8.
    assert ring_limit(flat(8, 9), (0, 0), 3) == 5.0
    assert ring_limit(flat(1, 9), (0, 0), 3) == 4.0
    # Two ring points exist, one on each side. Index 1 is the farther one.
    assert ring_limit(grid([[0.0, 0, 0, 0, 3]]), (0, 2), 3) == 13.0


def test_outliers_on_the_ring_do_not_enlarge_the_radius():
    heights = np.zeros((9, 9))
    for place in ring_of((4, 4), 1)[::3]:
        heights[place] = 1e6

    assert ring_limit(grid(heights), (4, 4), 3) <= 8.0


def test_points_inside_the_ring_do_not_count():
    heights = np.full((5, 5), 1e6)
    heights[tuple(zip(*ring_of((2, 2), 1), strict=True))] = 0.0
    heights[2, 2] = 0.0

    assert ring_limit(grid(heights), (2, 2), 3) == 5.0


def test_squares_are_those_of_the_cloud_s_own_dtype():
    # The square of 2 × 0.1 in float32 differs from that in float64.
    xyz = flat(1, 9, 0.1, 'float32')
    dx = xyz[0, 2, 0] - xyz[0, 0, 0]

    assert ring_limit(xyz, (0, 0), 3) == dx * dx
    assert float(dx * dx) != float(dx) * float(dx)


def test_ring_distances_beyond_the_dtype_give_an_infinite_limit():
    assert ring_limit(flat(5, 5, 1e25, 'float32'), (2, 2), 3) == np.inf


@pytest.mark.parametrize('radius', [None, 1e30])
def test_a_cloud_whose_squared_distances_the_dtype_does_not_hold_is_refused(radius):
    with pytest.raises(CloudError, match='float32 does not hold the squares of the distances round the seed'):
        circle_limit(flat(5, 5, 1e25, 'float32'), (2, 2), 3, radius, 1.0)
    assert circle_limit(flat(5, 5, 1e25), (2, 2), 3, radius, 1.0) > 0


def test_a_radius_whose_square_the_dtype_does_not_hold_is_no_limit():
    assert circle_limit(flat(5, 5, 1.0, 'float32'), (2, 2), 3, 1e30, 1.0) == np.inf
    assert circle_limit(flat(1, 2, 1.0, 'float32'), (0, 0), 3, 1e30, 1.0) == np.inf


@pytest.mark.parametrize('window', WINDOWS)
def test_a_seed_without_ring_points_has_no_radius(window):
    with pytest.raises(NoRadiusError, match='ring'):
        ring_limit(flat(1, 2), (0, 0), window)


def test_a_ring_without_a_measured_point_gives_no_radius():
    xyz = flat(5, 5)
    for place in ring_of((2, 2), 1):
        xyz[place][1] = np.inf

    with pytest.raises(NoRadiusError, match='ring'):
        ring_limit(xyz, (2, 2), 3)
