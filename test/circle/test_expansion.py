"""The expansion of the circle (section 3.2.3)."""

import numpy as np
import pytest
from clouds import SURFACES, Recipe, flat, grid, measured_points, recipes
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from naive import circle as naive

from socialcircle_ros.circle.expansion import expand

WINDOWS = (3, 5, 7, 9)
FLAT_LIMIT = np.float64(5.0)  # eq. 7 on a flat grid of pitch 1


def pitch_of(xyz):
    """The usual step along x, or 1."""
    steps = np.abs(np.diff(xyz[..., 0], axis=1))
    steps = steps[np.isfinite(steps) & (steps > 0)]
    return np.median(steps) if steps.size else xyz.dtype.type(1)


@settings(max_examples=900, deadline=None)
@given(
    recipes(),
    st.sampled_from(WINDOWS),
    st.integers(0, 24 * 24),
    st.sampled_from([2.2360679775, 1.0, 1.5, 3.0, 5.0, 20.0, 0.0, np.inf]),
)
def test_members_are_those_of_the_reference(recipe, window, pick, radius):
    xyz = recipe.cloud()
    points = measured_points(xyz)
    assume(points)
    seed = points[pick % len(points)]
    with np.errstate(all='ignore'):
        reach = xyz.dtype.type(radius) * pitch_of(xyz)
        limit = reach * reach
    assume(not np.isnan(limit))
    before = xyz.tobytes()

    joined = expand(xyz, seed, limit, window)

    assert joined.dtype == bool
    np.testing.assert_array_equal(joined, naive.expand(xyz, seed, limit, window))
    assert xyz.tobytes() == before


@settings(max_examples=300, deadline=None)
@given(
    st.integers(0, 2**16),
    st.sampled_from(['float64', 'float32']),
    st.sampled_from(WINDOWS),
    st.sampled_from([0.2, 0.5, 0.7]),
    st.sampled_from([1.2, 1.6, 2.3, 3.0, 4.5]),
)
@example(3, 'float64', 5, 0.5, 3.0)
def test_members_of_a_community_full_of_gaps_are_those_of_the_reference(random, dtype, window, missing, radius):
    # Gaps of this kind make windows above 3 depend on the order in which points join.
    recipe = Recipe(
        24, 19, dtype, 'noise', amplitude=0.8, jitter=0.3, missing=missing, layout='padded', random=random
    )
    xyz = recipe.cloud()
    points = measured_points(xyz)
    seed = points[len(points) // 2]
    limit = xyz.dtype.type(radius) * xyz.dtype.type(radius)

    np.testing.assert_array_equal(expand(xyz, seed, limit, window), naive.expand(xyz, seed, limit, window))


@pytest.mark.parametrize('surface', SURFACES)
@pytest.mark.parametrize('window', WINDOWS)
def test_seed_itself_is_always_a_member(surface, window):
    xyz = Recipe(6, 5, surface=surface).cloud()

    joined = expand(xyz, (3, 2), np.float64(0.0), window)

    assert joined[3, 2]
    assert joined.sum() == 1


def test_all_zero_heights_end_and_all_join():
    assert expand(flat(30, 40), (3, 4), FLAT_LIMIT, 3).all()


@pytest.mark.parametrize('height', [0.0, -0.0, -1.0, -1e9])
def test_points_at_or_below_height_zero_join(height):
    assert expand(grid(np.full((5, 6), height)), (2, 2), FLAT_LIMIT, 3).all()


def test_a_distance_equal_to_the_radius_is_outside():
    # Two pitches up and one along: exactly √5.
    heights = np.zeros((6, 8))
    heights[:, 4:] = 2.0

    joined = expand(grid(heights), (2, 1), FLAT_LIMIT, 3)

    assert joined[:, :4].all()
    assert not joined[:, 4:].any()


def test_a_distance_just_below_the_radius_is_inside():
    heights = np.zeros((6, 8))
    heights[:, 4:] = np.nextafter(2.0, 0.0)

    assert expand(grid(heights), (2, 1), FLAT_LIMIT, 3).all()


def test_members_chain_up_a_slope_far_beyond_the_radius():
    heights = np.tile(np.arange(50) * 1.9, (3, 1))

    assert expand(grid(heights), (1, 0), FLAT_LIMIT, 3).all()


def test_a_point_joins_over_a_diagonal():
    heights = np.full((4, 4), np.nan)
    heights[[0, 1, 2, 3], [3, 2, 1, 0]] = 0.0

    np.testing.assert_array_equal(expand(grid(heights), (3, 0), FLAT_LIMIT, 3), heights == 0.0)


def test_a_gap_wider_than_the_window_divides():
    xyz = flat(5, 9)
    xyz[:, 4] = np.nan

    joined = expand(xyz, (2, 2), np.float64(100.0), 3)

    assert joined[:, :4].all()
    assert not joined[:, 4:].any()


@pytest.mark.parametrize(('window', 'gap'), [(5, 1), (7, 2), (9, 3)])
def test_a_gap_within_the_window_does_not_divide(window, gap):
    xyz = flat(1, 21)
    xyz[0, 11 : 11 + gap] = np.nan

    joined = expand(xyz, (0, 10 - (window // 2) * 2), np.float64(100.0), window)

    assert joined[0, 11 + gap]
    assert not joined[0, 11 : 11 + gap].any()


def test_points_not_measured_never_join_even_in_an_infinite_circle():
    xyz = flat(4, 4)
    xyz[1, 1, 0], xyz[1, 2, 1], xyz[2, 1, 2] = np.nan, np.inf, -np.inf

    joined = expand(xyz, (0, 0), np.float64(np.inf), 3)

    np.testing.assert_array_equal(joined, np.isfinite(xyz).all(axis=2))


def test_window_does_not_wrap_round_the_border():
    xyz = flat(4, 6)
    xyz[:, 0] = np.nan
    xyz[:, 1] += 1e6  # reached from column 5 only if rows ran on

    joined = expand(xyz, (0, 5), FLAT_LIMIT, 3)

    assert joined[:, 2:].all()
    assert not joined[:, :2].any()


def test_window_5_joins_inside_the_window_lead_no_further():
    # The edge of the seed's window is lost on the right; the point before it is in, but is no initial point.
    xyz = flat(1, 9)
    xyz[0, 6] = np.nan

    joined = expand(xyz, (0, 4), np.float64(9.0), 5)

    np.testing.assert_array_equal(joined[0], [1, 1, 1, 1, 1, 1, 0, 0, 0])


def test_window_5_depends_on_the_order_in_which_points_join():
    # `first` and `second` are on the edge of the seed's window. Both see `shared`: inside the window of the
    # one, on the edge of the other's. Only from there `beyond` is seen.
    heights = np.full((13, 13), np.nan)
    seed, first, second, shared, beyond = (6, 6), (4, 6), (5, 8), (3, 7), (1, 7)
    for place in (seed, first, second, shared, beyond):
        heights[place] = 0.0
    xyz = grid(heights)
    limit = np.float64(1e3)

    joined = expand(xyz, seed, limit, 5)
    joined_upside_down = expand(xyz[::-1], seed, limit, 5)[::-1]

    assert joined[shared]
    assert not joined[beyond]
    assert joined_upside_down[beyond]


def test_distance_is_measured_in_the_cloud_s_own_dtype():
    # At 2^24 the next float32 is 2 away: an offset cloud is coarse, and so are its distances.
    xyz = flat(1, 4, 1.0, 'float32')
    xyz[..., 0] += np.float32(2**24)

    joined = expand(xyz, (0, 0), np.float32(4.0), 3)

    # 0, 1, 2, 3 became 0, 0, 2, 4.
    np.testing.assert_array_equal(joined[0], [True, True, False, False])
