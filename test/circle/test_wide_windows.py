# SPDX-License-Identifier: Apache-2.0
"""The expansion with search windows above 3×3 points (section 3.2.3).

Windows 5 and 7 work on tiles of 8×8 points, and keep the points without a link to the 3×3 community apart.
"""

import numpy as np
import pytest
from clouds import flat, grid, measured_points, pitch_of, recipes
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from naive import circle as naive

from socialcircle_ros.circle.expansion import divide


def expand(xyz, seed, limit, window):
    """The inliers alone."""
    return divide(xyz, seed, limit, window)[0]


@settings(max_examples=60, deadline=None)
@given(
    recipes(30, 80, least_columns=20),
    st.sampled_from([5, 7]),
    st.integers(0, 30 * 80),
    st.sampled_from([1.2, 2.2360679775, 4.5, 6.7]),
)
def test_members_of_clouds_of_many_tiles_are_those_of_the_reference(recipe, window, pick, radius):
    xyz = recipe.cloud()
    points = measured_points(xyz)
    assume(points)
    seed = points[pick % len(points)]
    with np.errstate(all='ignore'):
        reach = xyz.dtype.type(radius) * pitch_of(xyz)
        limit = reach * reach
    assume(not np.isnan(limit))

    np.testing.assert_array_equal(expand(xyz, seed, limit, window), naive.expand(xyz, seed, limit, window))


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 2**16), st.sampled_from([5, 7]), st.floats(0.05, 0.5), st.floats(1.5, 12.0))
def test_members_of_floors_that_only_wide_windows_connect_are_those_of_the_reference(
    random, window, share, height
):
    # Points on other floors are not in the 3×3 community. Some of them join nevertheless, and others from them.
    generator = np.random.default_rng(random)
    floors = generator.choice(4, (26, 35), p=[1 - share, *[share / 3] * 3])
    xyz = grid(floors * height + generator.normal(0, 0.3, floors.shape), dtype='float32')
    seed = measured_points(xyz)[450]
    limit = np.float32(20.0)

    np.testing.assert_array_equal(expand(xyz, seed, limit, window), naive.expand(xyz, seed, limit, window))


@pytest.mark.parametrize(('window', 'gap'), [(5, 1), (7, 2), (9, 3)])
def test_points_beyond_a_gap_within_the_window_join(window, gap):
    xyz = flat(1, 21)
    xyz[0, 11 : 11 + gap] = np.nan

    joined = expand(xyz, (0, 10 - (window // 2) * 2), np.float64(100.0), window)

    assert joined[0, 11 + gap]
    assert not joined[0, 11 : 11 + gap].any()


def test_a_point_that_joins_inside_a_window_is_no_initial_point():
    # The right edge of the seed's window is missing. The point before it joins, but it is not an initial point.
    xyz = flat(1, 9)
    xyz[0, 6] = np.nan

    joined = expand(xyz, (0, 4), np.float64(9.0), 5)

    np.testing.assert_array_equal(joined[0], [1, 1, 1, 1, 1, 1, 0, 0, 0])


def test_the_result_of_window_5_depends_on_the_order_in_which_points_join():
    # `first` and `second` are on the edge of the seed's window. `shared` is inside the window of `first` and on
    # the edge of the window of `second`. `beyond` is only in the window of `shared`.
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
