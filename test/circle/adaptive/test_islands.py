# SPDX-License-Identifier: Apache-2.0
"""Islands among the communities of every height."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import adaptive as naive

from socialcircle_ros.circle.adaptive.differences import MISSING, STEPS_PER_SPREAD
from socialcircle_ros.circle.adaptive.islands import LARGEST, find_islands
from socialcircle_ros.kernels import bands


def differences_between(heights, spread=1.0):
    """Plain differences in steps of the spread."""
    differences = np.full((4, *heights.shape), MISSING, np.int8)
    for direction, (down, right) in enumerate(naive.DIRECTIONS):
        for row, column in np.ndindex(heights.shape):
            other = row + down, column + right
            if naive.inside(*other, heights.shape) and not np.isnan(heights[other] - heights[row, column]):
                difference = STEPS_PER_SPREAD / spread * (heights[other] - heights[row, column])
                differences[direction, row, column] = np.rint(np.clip(difference, -127, 127))
    return differences


def hilly(rows, columns, random, blocks, flanks, missing):
    """Heights in quarters: blocks on a plane, some with a flank, and points that are not measured."""
    generator = np.random.default_rng(random)
    heights = generator.integers(-3, 4, (rows, columns)) / 4
    for _ in range(blocks):
        top, left = generator.integers(0, rows), generator.integers(0, columns)
        height, width = generator.integers(1, 9, 2)
        rise = generator.choice([-9, -6, -3, 3, 5, 9, 30])
        if generator.random() < flanks:
            heights[max(0, top - 1) : top + height + 1, max(0, left - 1) : left + width + 1] += rise
        heights[top : top + height, left : left + width] += rise
    heights[generator.random(heights.shape) < missing] = np.nan
    return heights.astype(np.float32)


HILLS = st.builds(
    hilly,
    st.integers(1, 26),
    st.integers(1, 22),
    st.integers(0, 2**32),
    st.integers(0, 6),
    st.sampled_from([0.0, 0.5, 1.0]),
    st.sampled_from([0.0, 0.1, 0.4, 1.0]),
)


@settings(max_examples=300)
@given(
    HILLS,
    st.sampled_from([1, 2, 4]),
    st.sampled_from([(4.0, 0.93), (3.0, 0.91), (4.0, 0.96)]),
    st.sampled_from([0.0, 0.5, 3.0]),
    st.booleans(),
    st.sampled_from([1.0, 2.0, 4.0]),
)
def test_islands_and_steepness_equal_the_reference_bit_for_bit(hills, reduction, steep, noise, known, rise):
    measured = ~np.isnan(hills)
    differences = differences_between(hills)
    relief = np.where(measured, hills, 0)
    # The relief never fits the differences exactly, and need not.
    relief += np.random.default_rng(4).normal(0, noise, hills.shape).astype(np.float32)
    measured |= known

    found, steepness = find_islands(relief, differences, measured, *steep, reduction, rise)

    expected, expected_steepness = naive.find_islands(relief, differences, measured, *steep, reduction, rise)
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(steepness, expected_steepness)


def island_points(heights, reduction=1, **options):
    heights = np.asarray(heights, np.float32)
    return find_islands(
        heights, differences_between(heights, **options), np.isfinite(heights), 4.0, 0.93, reduction
    )[0]


def block(height, width, rise=9.0):
    heights = np.zeros((60, 70), np.float32)
    heights[20 : 20 + height, 30 : 30 + width] = rise
    return heights


@pytest.mark.parametrize('rise', [9.0, -9.0])
def test_a_block_with_steep_sides_is_an_island_above_and_below(rise):
    heights = block(5, 6, rise)

    np.testing.assert_array_equal(island_points(heights), heights != 0)


def test_a_plateau_larger_than_an_island_is_a_surface_and_so_is_its_top():
    heights = block(26, 26)
    assert np.count_nonzero(heights) > LARGEST
    heights[26:30, 36:40] += 1

    assert not island_points(heights).any()


def test_a_block_that_slopes_down_on_one_side_is_no_island():
    heights = block(6, 6)
    for step in range(8):
        heights[20:26, 36 + step] = 8 - step

    assert not island_points(heights).any()


def test_a_ridge_is_no_island_and_a_short_one_is():
    assert not island_points(block(1, 14)).any()
    assert island_points(block(1, 4)).sum() == 4


def test_a_flank_belongs_to_its_island():
    heights = block(7, 7, 5.5)
    heights[21:26, 31:36] = 11.0

    np.testing.assert_array_equal(island_points(heights), heights != 0)


def test_a_pinnacle_on_a_plateau_is_an_island_and_the_plateau_is_not():
    heights = block(36, 37, 5.0)
    heights[30:34, 40:44] = 14.0

    np.testing.assert_array_equal(island_points(heights), heights == 14)


def test_the_largest_island_covers_the_same_area_at_reduced_resolution():
    heights = block(20, 20)

    assert island_points(heights, reduction=1).sum() == 400
    assert not island_points(heights, reduction=2).any()


@settings(max_examples=50)
@given(HILLS)
def test_rising_and_sinking_communities_are_judged_alike(hills):
    relief = np.where(np.isnan(hills), 0, hills)
    up = find_islands(relief, differences_between(hills), ~np.isnan(hills), 4.0, 0.93, 1)

    down = find_islands(-relief, differences_between(-hills), ~np.isnan(hills), 4.0, 0.93, 1)

    np.testing.assert_array_equal(up[0], down[0])
    np.testing.assert_array_equal(up[1], down[1])


@settings(max_examples=50)
@given(st.integers(0, 2**32), st.booleans())
def test_islands_of_a_mirrored_cloud_are_mirrored(random, transposed):
    # The surroundings have blocks of 16 points: the middle of these clouds is a border of blocks.
    hills = hilly(32, 32, random, 6, 0.5, 0.0)
    mirrored = np.ascontiguousarray(hills.T if transposed else hills[:, ::-1])

    found, mirror_image = (
        find_islands(h, differences_between(h), np.isfinite(h), 4.0, 0.93, 1) for h in (hills, mirrored)
    )

    for one, other in zip(found, mirror_image, strict=True):
        np.testing.assert_array_equal(one, other.T if transposed else other[:, ::-1])


def test_one_thread_and_two_threads_give_the_same_islands(monkeypatch):
    heights = np.tile(hilly(64, 70, 3, 20, 0.5, 0.05), (7, 7))
    differences = np.tile(differences_between(heights[:64, :70]), (1, 7, 7))
    assert heights.size > 200_000
    results = []
    for limit in (1, 2):
        monkeypatch.setattr(bands, 'limit', limit)
        results.append(find_islands(np.nan_to_num(heights), differences, np.isfinite(heights), 4.0, 0.93, 1))

    np.testing.assert_array_equal(results[0][0], results[1][0])
    np.testing.assert_array_equal(results[0][1], results[1][1])
    assert results[0][0].any()
