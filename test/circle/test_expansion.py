# SPDX-License-Identifier: Apache-2.0
"""The expansion of the circle (section 3.2.3), with all windows and with window 3."""

import numpy as np
import pytest
from clouds import LAYOUTS, SURFACES, Recipe, flat, grid, laid_out, measured_points, pitch_of, recipes
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from naive import circle as naive

from socialcircle_ros.circle.expansion import divide

WINDOWS = (3, 5, 7, 9)
FLAT_LIMIT = np.float64(5.0)  # eq. 7 on a flat grid of pitch 1


def expand(xyz, seed, limit, window):
    """The inliers alone."""
    return divide(xyz, seed, limit, window)[0]


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


# Window 3 works on words of 64 points. Hard cases: clouds wider than a word, and corridors with many turns.


@settings(max_examples=150, deadline=None)
@given(
    recipes(6, 300, least_columns=60),
    st.integers(0, 6 * 300),
    st.sampled_from([1.2, 2.2360679775, 3.0, 20.0]),
)
def test_members_of_clouds_wider_than_a_word_are_those_of_the_reference(recipe, pick, radius):
    xyz = recipe.cloud()
    points = measured_points(xyz)
    assume(points)
    seed = points[pick % len(points)]
    with np.errstate(all='ignore'):
        reach = xyz.dtype.type(radius) * pitch_of(xyz)
        limit = reach * reach
    assume(not np.isnan(limit))

    np.testing.assert_array_equal(expand(xyz, seed, limit, 3), naive.expand(xyz, seed, limit, 3))


@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 2**16),
    st.sampled_from([0.3, 0.45, 0.55, 0.6]),
    st.sampled_from([63, 64, 65, 127, 128, 129, 200]),
    st.booleans(),
)
def test_members_of_a_random_maze_are_those_of_the_reference(random, missing, columns, on_its_side):
    generator = np.random.default_rng(random)
    heights = np.where(generator.random((40, columns)) < missing, np.nan, 0.0)
    xyz = grid(heights.T if on_its_side else heights, dtype='float32')
    points = measured_points(xyz)
    seed = points[len(points) // 2]
    limit = np.float32(generator.choice([1.5, 2.5]))  # with and without diagonal links

    np.testing.assert_array_equal(expand(xyz, seed, limit, 3), naive.expand(xyz, seed, limit, 3))


@pytest.mark.parametrize('window', [3, 5, 7])
def test_members_do_not_depend_on_the_number_of_threads(window, monkeypatch):
    generator = np.random.default_rng(1)
    heights = np.where(generator.random((90, 150)) < 0.2, generator.uniform(-9, 9, (90, 150)), 0.0)
    heights[generator.random(heights.shape) < 0.2] = np.nan
    heights[40, 70] = 0.0
    xyz = grid(heights, dtype='float32')
    monkeypatch.setattr('socialcircle_ros.kernels.bands._LEAST', 1)
    monkeypatch.setattr('socialcircle_ros.circle.wide_windows._LEAST_TILES_PER_BAND', 1)

    masks = []
    for threads in (1, 2, 7):
        monkeypatch.setattr('socialcircle_ros.kernels.bands.limit', threads)
        masks.append(expand(xyz, (40, 70), np.float32(20.0), window))

    assert masks[0].sum() > 90 * 150 / 2
    np.testing.assert_array_equal(masks[0], masks[1])
    np.testing.assert_array_equal(masks[0], masks[2])


def spiral(side):
    """A corridor, one point wide, from a corner to the middle; its walls are NaN."""
    heights = np.full((side, side), np.nan)
    row, column, way = 0, 0, (0, 1)
    heights[0, 0] = 0.0
    for length in [side - 1, *[reach for reach in range(side - 1, 1, -2) for _ in range(2)]]:
        for _ in range(length):
            row, column = row + way[0], column + way[1]
            heights[row, column] = 0.0
        way = (way[1], -way[0])
    return heights, (row, column)


@pytest.mark.parametrize('side', [31, 131])
@pytest.mark.parametrize('mirrored', [False, True])
def test_a_spiral_is_followed_from_its_middle_to_its_end(side, mirrored):
    heights, middle = spiral(side)
    xyz = grid(heights)
    if mirrored:
        xyz, middle = xyz[:, ::-1], (middle[0], side - 1 - middle[1])

    joined = expand(xyz, middle, np.float64(1.5), 3)

    np.testing.assert_array_equal(joined, np.isfinite(xyz[..., 2]))
    assert joined.sum() > side


@pytest.mark.parametrize('upright', [False, True])
@pytest.mark.parametrize('end', [(0, 0), (130, 192)])
def test_a_corridor_that_turns_at_every_wall_is_followed_to_its_end(upright, end):
    heights = np.zeros((131, 193))
    if upright:
        heights[1:, 1::4], heights[:-1, 3::4] = np.nan, np.nan
    else:
        heights[1::4, 1:], heights[3::4, :-1] = np.nan, np.nan

    joined = expand(grid(heights), end, np.float64(1.5), 3)

    np.testing.assert_array_equal(joined, heights == 0.0)


@pytest.mark.parametrize('layout', LAYOUTS)
@pytest.mark.parametrize('dtype', ['float32', 'float64'])
def test_members_do_not_depend_on_the_layout_in_memory(layout, dtype):
    contiguous = Recipe(7, 133, dtype, 'noise', missing=0.2, random=3).cloud()
    limit = contiguous.dtype.type(6.0)
    seed = measured_points(contiguous)[400]

    joined = expand(laid_out(contiguous, layout), seed, limit, 3)

    np.testing.assert_array_equal(joined, naive.expand(contiguous, seed, limit, 3))


def test_no_memory_after_the_last_point_is_read():
    # The view ends with the z of its last point, like the x, y and z of a message without padding at its end.
    values = np.zeros(4 * 6 - 1, np.float32)
    values[::4] = np.arange(6)
    xyz = np.lib.stride_tricks.as_strided(values, (2, 3, 3), (48, 16, 4))

    assert expand(xyz, (0, 0), np.float32(100.0), 3).all()


def test_each_measured_point_is_a_member_or_an_outlier():
    xyz = Recipe(30, 150, 'float32', 'noise', spikes=0.2, missing=0.2, random=1).cloud()
    for window in (3, 5):
        members, outliers = divide(xyz, measured_points(xyz)[900], np.float32(5.0), window)

        assert not (members & outliers).any()
        np.testing.assert_array_equal(members | outliers, np.isfinite(xyz).all(axis=2))


# All windows


@pytest.mark.parametrize('surface', SURFACES)
@pytest.mark.parametrize('window', WINDOWS)
def test_seed_itself_is_always_a_member(surface, window):
    xyz = Recipe(6, 5, surface=surface).cloud()

    joined = expand(xyz, (3, 2), np.float64(0.0), window)

    assert joined[3, 2]
    assert joined.sum() == 1


def test_all_points_of_a_cloud_at_height_0_join_and_the_expansion_ends():
    assert expand(flat(30, 40), (3, 4), FLAT_LIMIT, 3).all()


@pytest.mark.parametrize('height', [0.0, -0.0, -1.0, -1e9])
def test_points_at_or_below_height_0_join(height):
    assert expand(grid(np.full((5, 6), height)), (2, 2), FLAT_LIMIT, 3).all()


def test_a_distance_equal_to_the_radius_is_outside():
    # Two pitches in height and one along the row: exactly √5.
    heights = np.zeros((6, 8))
    heights[:, 4:] = 2.0

    joined = expand(grid(heights), (2, 1), FLAT_LIMIT, 3)

    assert joined[:, :4].all()
    assert not joined[:, 4:].any()


def test_a_distance_just_below_the_radius_is_inside():
    heights = np.zeros((6, 8))
    heights[:, 4:] = np.nextafter(2.0, 0.0)

    assert expand(grid(heights), (2, 1), FLAT_LIMIT, 3).all()


def test_points_of_a_slope_join_one_after_the_other_far_beyond_the_radius():
    heights = np.tile(np.arange(50) * 1.9, (3, 1))

    assert expand(grid(heights), (1, 0), FLAT_LIMIT, 3).all()


def test_a_point_joins_over_a_diagonal():
    heights = np.full((4, 4), np.nan)
    heights[[0, 1, 2, 3], [3, 2, 1, 0]] = 0.0

    np.testing.assert_array_equal(expand(grid(heights), (3, 0), FLAT_LIMIT, 3), heights == 0.0)


def test_points_beyond_a_gap_wider_than_the_window_do_not_join():
    xyz = flat(5, 9)
    xyz[:, 4] = np.nan

    joined = expand(xyz, (2, 2), np.float64(100.0), 3)

    assert joined[:, :4].all()
    assert not joined[:, 4:].any()


def test_points_that_are_not_measured_do_not_join_even_with_an_infinite_radius():
    xyz = flat(4, 4)
    xyz[1, 1, 0], xyz[1, 2, 1], xyz[2, 1, 2] = np.nan, np.inf, -np.inf

    joined = expand(xyz, (0, 0), np.float64(np.inf), 3)

    np.testing.assert_array_equal(joined, np.isfinite(xyz).all(axis=2))


def test_the_window_does_not_continue_in_the_next_row():
    xyz = flat(4, 6)
    xyz[:, 0] = np.nan
    xyz[:, 1] += 1e6  # within reach of column 5 only if the window continued in the next row

    joined = expand(xyz, (0, 5), FLAT_LIMIT, 3)

    assert joined[:, 2:].all()
    assert not joined[:, :2].any()


def test_distance_is_measured_in_the_cloud_s_own_dtype():
    # At 2^24 float32 numbers are 2 apart, and so are the distances of a cloud with such an offset.
    xyz = flat(1, 4, 1.0, 'float32')
    xyz[..., 0] += np.float32(2**24)

    joined = expand(xyz, (0, 0), np.float32(4.0), 3)

    # x was 0, 1, 2, 3 and is rounded to 0, 0, 2, 4.
    np.testing.assert_array_equal(joined[0], [True, True, False, False])
