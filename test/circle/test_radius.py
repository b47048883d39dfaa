"""The radius of the circle (section 3.2.2, eq. 6 and 7)."""

import math

import numpy as np
import pytest
from clouds import flat, grid, measured_points, recipes
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from naive import circle as naive

from socialcircle_ros.circle.radius import ring_limit
from socialcircle_ros.errors import NoRadiusError

WINDOWS = (3, 5, 7, 9)


def ring_of(seed, k):
    """(row, column) round the (4k+1)×(4k+1) square, in row-major order."""
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
def test_limit_of_a_ring_wholly_inside_the_cloud_is_that_of_the_reference(recipe, window):
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
def test_flat_grid_has_radius_root_5_pitches_for_each_half_window(window, dtype):
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
def test_with_ring_points_missing_radius_is_the_middle_of_those_that_exist(window, lost):
    k = window // 2
    seed = (8, 8)
    places = ring_of(seed, k)
    heights = np.zeros((17, 17))
    heights[tuple(zip(*places, strict=True))] = np.arange(16 * k) * 1e3
    heights[tuple(zip(*places[-lost:], strict=True))] = np.nan  # the highest

    # Heights rise by 1000 along the ring, so that the sorted ring is the ring itself.
    row, column = places[(16 * k - lost) // 2]
    expected = (row - 8) ** 2 + (column - 8) ** 2 + heights[row, column] ** 2

    assert ring_limit(grid(heights), seed, window) == expected


def test_ring_points_beyond_the_border_are_missing_and_do_not_wrap_round():
    # In the corner 5 of 16 exist: squared distances 4, 4, 5, 5, 8.
    assert ring_limit(flat(8, 9), (0, 0), 3) == 5.0
    assert ring_limit(flat(1, 9), (0, 0), 3) == 4.0
    # Two exist, on both sides: the farther one is index 1.
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
    # 2 × 0.1 in float32, squared in float32, is another number than in float64.
    xyz = flat(1, 9, 0.1, 'float32')
    dx = xyz[0, 2, 0] - xyz[0, 0, 0]

    assert ring_limit(xyz, (0, 0), 3) == dx * dx
    assert float(dx * dx) != float(dx) * float(dx)


def test_ring_beyond_the_dtype_gives_an_infinite_limit():
    assert ring_limit(flat(5, 5, 1e25, 'float32'), (2, 2), 3) == np.inf


@pytest.mark.parametrize('window', WINDOWS)
def test_no_ring_point_no_radius(window):
    with pytest.raises(NoRadiusError, match='ring'):
        ring_limit(flat(1, 2), (0, 0), window)


def test_ring_of_points_that_are_not_measured_gives_no_radius():
    xyz = flat(5, 5)
    for place in ring_of((2, 2), 1):
        xyz[place][1] = np.inf

    with pytest.raises(NoRadiusError, match='ring'):
        ring_limit(xyz, (2, 2), 3)
