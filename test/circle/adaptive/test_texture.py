# SPDX-License-Identifier: Apache-2.0
"""Islands of one height are texture."""

from itertools import chain

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import adaptive as naive

from socialcircle_ros.circle.adaptive.communities import label_communities
from socialcircle_ros.circle.adaptive.texture import islands_of_one_height


def found(heights, islands):
    return islands_of_one_height(heights, islands, label_communities(islands))


def dotted(rows, columns, random, heights_of_dots, share, pitch):
    """Heights in quarters, so that sums are exact; a lattice of dots with these heights, some of them islands."""
    generator = np.random.default_rng(random)
    heights = generator.integers(0, 2, (rows, columns)) / 4
    islands = np.zeros((rows, columns), bool)
    for top in range(1, rows, pitch):
        for left in range(1, columns, pitch):
            side = generator.integers(max(1, pitch - 4), pitch)
            dot = slice(top, top + side), slice(left, left + side)
            heights[dot] += generator.choice(heights_of_dots)
            islands[dot] = generator.random() < share
    heights += (
        generator.choice([0, 8, -40]) * np.arange(columns)
        + generator.choice([0, 0.25]) * np.indices(heights.shape)[0]
    )
    heights[generator.random(heights.shape) < 0.05] = np.nan
    return heights.astype(np.float32), islands


DOTS = st.builds(
    dotted,
    st.integers(1, 36),
    st.integers(1, 40),
    st.integers(0, 2**32),
    st.sampled_from([[5], [5, -5], [5, 6, 7, 8], [3, 9, 20, -6], [0, 0.25], [5, 5, 5, 9, 16], [7, 7, 18, 40]]),
    st.sampled_from([0.3, 0.7, 1.0]),
    st.sampled_from([5, 9]),
)


@settings(max_examples=200)
@given(DOTS)
def test_texture_equals_the_reference(dots):
    texture = found(*dots)

    kept, alike, narrowly = naive.islands_of_one_height(*dots)
    assert {tuple(point) for point in np.argwhere(texture.kept).tolist()} == set(chain.from_iterable(kept))
    assert (texture.number, texture.narrowly) == (len(kept), narrowly)
    expected = sorted(point for part in alike for point in part)
    assert [divmod(point, dots[0].shape[1]) for point in texture.alike.tolist()] == expected
    sizes = [len(part) for part in alike]
    assert texture.removed == (len(sizes), sum(sizes), max(sizes, default=0))


@settings(max_examples=100)
@given(DOTS)
def test_only_islands_are_texture(dots):
    texture = found(*dots)

    assert not texture.kept[~dots[1]].any()
    assert dots[1].flat[texture.alike].all()


def lattice(count, rises):
    heights = np.zeros((40, 60), np.float32)
    for number in range(count):
        row, column = 2 + 6 * (number // 9), 2 + 6 * (number % 9)
        heights[row : row + 3, column : column + 3] = rises[number % len(rises)]
    return heights


@pytest.mark.parametrize('rise', [5.0, -5.0])
def test_many_islands_of_one_height_are_kept_and_counted(rise):
    heights = lattice(12, [rise])

    texture = found(heights, heights != 0)

    np.testing.assert_array_equal(texture.kept, heights != 0)
    assert (texture.number, texture.narrowly) == (12, False)
    assert texture.removed.number == 0


@pytest.mark.parametrize('dropped', [0, 1, 4])
def test_eight_islands_are_enough_though_one_lacks_points(dropped):
    heights = lattice(8, [5.0])
    heights[2:4, 2:4].flat[:dropped] = np.nan
    islands = heights > 0

    texture = found(heights, islands)

    np.testing.assert_array_equal(texture.kept, islands)
    assert texture.narrowly


def test_few_islands_or_islands_of_many_heights_are_not_kept():
    for heights in (lattice(7, [5.0]), lattice(12, [1.0, 2.0, 4.0, 8.0, 16.0])):
        assert not found(heights, heights != 0).kept.any()


def test_a_large_outlier_and_small_ones_of_its_height_are_no_texture():
    heights = lattice(12, [5.0])
    islands = heights != 0
    heights[24:38, 2:58] = 5.0
    islands[24:38, 2:58] = True

    assert not found(heights, islands).kept.any()


def test_a_large_outlier_of_nearly_their_height_does_not_take_islands_from_the_texture():
    heights = lattice(18, [5.0])
    studs = heights != 0
    heights[24:29, 2:20] = 6.9
    islands = heights != 0

    texture = found(heights, islands)

    np.testing.assert_array_equal(texture.kept, studs)


def test_islands_that_cover_little_of_the_cloud_are_not_kept():
    heights = np.zeros((200, 200), np.float32)
    heights[:40, :60] = lattice(12, [5.0])

    assert not found(heights, heights != 0).kept.any()


@pytest.mark.parametrize(('rows', 'kept'), [(112, True), (129, False)])
def test_islands_cover_one_and_a_half_percent_of_the_cloud_at_least(rows, kept):
    heights = np.zeros((rows, 60), np.float32)
    heights[:40] = lattice(12, [5.0])

    assert found(heights, heights != 0).kept.any() == kept


def different(number):
    """Heights of which no two are one."""
    return [7.0 * 1.4**power for power in range(number)]


@pytest.mark.parametrize(
    ('islands', 'kept', 'narrowly', 'removed'),
    [
        (lattice(6, [5.0]), 0, False, 0),
        (lattice(7, [5.0]), 0, False, 7),
        (lattice(9, [5.0]), 9, True, 0),
        (lattice(10, [5.0]), 10, False, 0),
        (lattice(30, [*[5.0] * 10, *different(20)]), 0, False, 0),
        (lattice(22, [*[5.0] * 10, *different(12)]), 0, False, 10),
        (lattice(20, [*[5.0] * 11, *different(9)]), 11, True, 0),
        (lattice(18, [*[5.0] * 12, *different(6)]), 12, False, 0),
    ],
    ids=['six', 'seven', 'nine', 'ten', 'a third', 'nearly half', 'half', 'two thirds'],
)
def test_a_narrow_decision_is_told(islands, kept, narrowly, removed):
    texture = found(islands, islands != 0)

    assert (texture.number, texture.narrowly, texture.removed.number) == (kept, narrowly, removed)


@pytest.mark.parametrize('tilt', [(0, 0), (0.5, 0), (-300, 40)])
@pytest.mark.parametrize('size', [1, 8])
def test_a_tilt_does_not_matter(tilt, size):
    heights = np.kron(lattice(18, [5.0]), np.ones((size, size), np.float32))
    row, column = np.indices(heights.shape)
    random = np.random.default_rng(4)
    islands = (heights > 0) & (random.random(heights.shape) < 0.8)  # ragged, so that what touches them is uneven
    expected = found(heights, islands)
    assert expected.number >= 12
    tilted = (heights.astype(float) + tilt[0] * row + tilt[1] * column).astype(np.float32)
    np.testing.assert_array_equal(found(tilted, islands).kept, expected.kept)


def pins(rises, side=7):
    """A plate with square pins of these heights, too few for a texture."""
    heights = np.zeros((150, 210), np.float32)
    for number, rise in enumerate(rises):
        row, column = 10 + 50 * (number // 4), 10 + 50 * (number % 4)
        heights[row : row + side, column : column + side] = rise
    return heights


@pytest.mark.parametrize('rise', [5.0, -5.0])
def test_four_large_islands_of_one_height_are_told(rise):
    heights = pins([rise, 1.05 * rise, rise, rise, 3 * rise])

    texture = found(heights, heights != 0)

    assert not texture.kept.any()
    assert texture.removed == (4, 4 * 49, 49)
    assert np.abs(heights.flat[texture.alike]).max() < 6


@pytest.mark.parametrize(
    'heights',
    [pins([5.0] * 3), pins([5.0, 6.0, 7.0, 8.0]), pins([5.0] * 6, side=5), pins([*[5.0] * 4, *different(5)])],
    ids=['three', 'not of one height', 'small', 'fewer than half of all'],
)
def test_other_removed_islands_are_not(heights):
    assert found(heights, heights != 0).removed.number == 0


def test_a_tilt_does_not_matter_where_only_every_second_row_is_measured():
    heights = np.kron(lattice(18, [5.0]), np.ones((4, 4), np.float32))
    islands = (heights > 0) & (np.random.default_rng(4).random(heights.shape) < 0.8)
    heights[::2] = np.nan
    tilted = heights + 40 * np.arange(heights.shape[1], dtype=np.float32)
    kept = found(heights, islands).kept
    assert kept.any()
    np.testing.assert_array_equal(found(tilted, islands).kept, kept)
