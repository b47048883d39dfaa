# SPDX-License-Identifier: Apache-2.0
"""Islands of one height are texture."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import adaptive as naive

from socialcircle_ros.circle.adaptive.communities import label_communities
from socialcircle_ros.circle.adaptive.texture import islands_of_one_height


def kept(heights, islands):
    return islands_of_one_height(heights, islands, label_communities(islands))


def dotted(rows, columns, random, heights_of_dots, share):
    """Heights in quarters, so that sums are exact; a lattice of dots with these heights, some of them islands."""
    generator = np.random.default_rng(random)
    heights = generator.integers(0, 2, (rows, columns)) / 4
    islands = np.zeros((rows, columns), bool)
    for top in range(1, rows, 5):
        for left in range(1, columns, 5):
            side = generator.integers(1, 5)
            dot = slice(top, top + side), slice(left, left + side)
            heights[dot] += generator.choice(heights_of_dots)
            islands[dot] = generator.random() < share
    heights[generator.random(heights.shape) < 0.05] = np.nan
    return heights.astype(np.float32), islands


DOTS = st.builds(
    dotted,
    st.integers(1, 30),
    st.integers(1, 36),
    st.integers(0, 2**32),
    st.sampled_from([[5], [5, -5], [5, 6, 7, 8], [3, 9, 20, -6], [0, 0.25]]),
    st.sampled_from([0.3, 0.7, 1.0]),
)


@settings(max_examples=200)
@given(DOTS)
def test_texture_equals_the_reference(dots):
    texture, number = kept(*dots)

    expected, expected_number = naive.islands_of_one_height(*dots)
    np.testing.assert_array_equal(texture, expected)
    assert number == expected_number


@settings(max_examples=100)
@given(DOTS)
def test_only_islands_are_texture(dots):
    texture, _ = kept(*dots)

    assert not texture[~dots[1]].any()


def lattice(count, rises):
    heights = np.zeros((40, 60), np.float32)
    for number in range(count):
        row, column = 2 + 6 * (number // 9), 2 + 6 * (number % 9)
        heights[row : row + 3, column : column + 3] = rises[number % len(rises)]
    return heights


@pytest.mark.parametrize('rise', [5.0, -5.0])
def test_many_islands_of_one_height_are_kept_and_counted(rise):
    heights = lattice(12, [rise])

    texture, number = kept(heights, heights != 0)

    np.testing.assert_array_equal(texture, heights != 0)
    assert number == 12


def test_few_islands_or_islands_of_many_heights_are_not_kept():
    for heights in (lattice(7, [5.0]), lattice(12, [1.0, 2.0, 4.0, 8.0, 16.0])):
        assert not kept(heights, heights != 0)[0].any()


def test_a_large_outlier_and_small_ones_of_its_height_are_no_texture():
    heights = lattice(12, [5.0])
    islands = heights != 0
    heights[24:38, 2:58] = 5.0
    islands[24:38, 2:58] = True

    assert not kept(heights, islands)[0].any()


def test_islands_that_cover_little_of_the_cloud_are_not_kept():
    heights = np.zeros((200, 200), np.float32)
    heights[:40, :60] = lattice(12, [5.0])

    assert not kept(heights, heights != 0)[0].any()
