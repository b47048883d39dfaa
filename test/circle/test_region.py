# SPDX-License-Identifier: Apache-2.0
"""The choice of the vote region T (section 3.2.1)."""

import numpy as np
import pytest
from clouds import Recipe, flat, grid, recipes
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import circle as naive

from socialcircle_ros.circle.region import choose_region
from socialcircle_ros.errors import NoSeedError


def chosen_by(choose, xyz):
    """The region, or 'no seed' where the choice is refused."""
    try:
        return choose(xyz)
    except NoSeedError:
        return 'no seed'


@settings(max_examples=100, deadline=None)
@given(recipes(150, 150))
def test_chosen_region_is_that_of_the_reference(recipe):
    xyz = recipe.cloud()

    assert chosen_by(choose_region, xyz) == chosen_by(naive.choose_region, xyz)


@settings(max_examples=60, deadline=None)
@given(recipes(150, 150), st.integers(2, 5))
def test_chosen_region_does_not_depend_on_the_number_of_threads(recipe, threads):
    xyz = recipe.cloud()
    expected = chosen_by(choose_region, xyz)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr('socialcircle_ros.kernels.bands._LEAST', 1)
        patch.setattr('socialcircle_ros.kernels.bands.limit', threads)

        assert chosen_by(choose_region, xyz) == expected


@st.composite
def narrow_clouds(draw):
    """Clouds with more than 64 candidates along columns or along rows, well measured or not."""
    recipe = Recipe(
        rows=draw(st.integers(1, 3)),
        columns=draw(st.integers(1980, 4500)),
        surface='noise',
        missing=draw(st.sampled_from([0.0, 0.02, 0.05, 0.5])),
        random=draw(st.integers(0, 2**16)),
    )
    xyz = recipe.cloud()
    return xyz.transpose(1, 0, 2) if draw(st.booleans()) else xyz


@settings(max_examples=60, deadline=None)
@given(narrow_clouds())
def test_chosen_region_among_more_than_64_candidates_is_that_of_the_reference(xyz):
    assert choose_region(xyz) == naive.choose_region(xyz)


def test_at_most_64_candidates_are_compared():
    # Each of 100 candidates is smoother than the one before. The last of the 64 is number 63 × 100 // 64 = 98.
    length = 60 + 99 * 30
    heights = -((length - np.arange(float(length))) ** 3)

    assert choose_region(grid([heights])) == (0, 98 * 30, 1, 60)
    assert choose_region(grid(heights[:, None])) == (98 * 30, 0, 60, 1)


def test_the_only_measured_region_is_found_among_many_candidates():
    heights = np.full(60 + 99 * 30, np.nan)
    heights[60:120] = 0.0  # the third of 100 candidates, not one of the 64 that are compared first

    assert choose_region(grid([heights])) == (0, 60, 1, 60)
    assert choose_region(grid(heights[:, None])) == (60, 0, 60, 1)


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 4), st.integers(0, 2**16))
def test_first_of_equally_rough_regions_is_chosen_to_the_last_bit(rows, random):
    # The second half is the mirror image of the first, so that both have the same differences.
    half = np.random.default_rng(random).normal(0, 1, (rows, 60))
    xyz = grid(np.concatenate([half, half[:, ::-1]], axis=1))

    region = choose_region(xyz)

    assert region == naive.choose_region(xyz)
    assert region in {(0, 0, rows, 60), (0, 30, rows, 60)}


@pytest.mark.parametrize(
    ('shape', 'region'),
    [((1, 1), (0, 0, 1, 1)), ((60, 60), (0, 0, 60, 60)), ((7, 90), (0, 0, 7, 60)), ((61, 5), (0, 0, 60, 5))],
)
def test_the_first_region_of_a_flat_cloud_is_chosen_and_lies_inside_it(shape, region):
    assert choose_region(flat(*shape)) == region


@pytest.mark.parametrize('length', [61, 89, 90, 91, 121, 300])
def test_the_last_possible_region_is_a_candidate(length):
    # The second differences decrease along the line, so that the last region is the smoothest.
    heights = -((length - np.arange(float(length))) ** 3)

    assert choose_region(grid([heights])) == (0, length - 60, 1, 60)
    assert choose_region(grid(heights[:, None])) == (length - 60, 0, 60, 1)


def test_smoother_region_is_preferred():
    heights = np.random.default_rng(0).normal(0, 1, (60, 180))
    heights[:, 90:150] = np.arange(60) * 0.1

    assert choose_region(grid(heights)) == (0, 90, 60, 60)


def test_a_patch_of_one_height_is_chosen_last():
    heights = np.tile(np.arange(120.0), (60, 1))
    heights[:, :60] = 0.0  # a fill value; the next candidate is half on the plane

    assert choose_region(grid(heights)) == (0, 30, 60, 60)


def test_a_cloud_of_one_height_has_a_region():
    assert choose_region(grid(np.zeros((60, 120)))) == (0, 0, 60, 60)


def test_tilt_is_not_roughness():
    heights = np.tile(np.arange(120.0) * 3, (60, 1))
    heights[:, :60] = np.random.default_rng(0).normal(0, 0.01, (60, 60))

    assert choose_region(grid(heights)) == (0, 60, 60, 60)


def test_a_smooth_region_with_less_than_95_percent_measured_is_not_chosen():
    heights = np.random.default_rng(0).normal(0, 1, (60, 120))
    heights[:, 60:] = 0.0
    heights[:, 116:] = np.nan  # 93 % of the last region remain

    assert choose_region(grid(heights)) != (0, 60, 60, 60)


def test_a_smooth_region_with_exactly_95_percent_measured_is_chosen():
    heights = np.random.default_rng(0).normal(0, 1, (60, 120))
    heights[:, 60:] = np.arange(60) * 0.1
    heights[:, 117:] = np.nan

    assert choose_region(grid(heights)) == (0, 60, 60, 60)


@pytest.mark.parametrize(('lost', 'column'), [(3, 60), (4, 30)])
def test_95_percent_are_not_rounded_to_whole_points(lost, column):
    # The best candidates have 59 points, and 95 % of that is 56.05. The last and smoothest one has 57 or 56.
    heights = -((120 - np.arange(120.0)) ** 3)
    heights[45] = np.nan
    heights[120 - lost :] = np.nan

    assert choose_region(grid([heights])) == (0, column, 1, 60)


def test_a_region_without_three_points_in_a_row_counts_as_the_roughest():
    # A chessboard has no three measured neighbours. Only the last region gets some.
    heights = np.random.default_rng(0).normal(0, 1e3, (4, 120))
    row, column = np.indices(heights.shape)
    heights[(row + column) % 2 == 1] = np.nan
    heights[2, 100:103] = [0.0, 1e6, 0.0]

    assert choose_region(grid(heights)) == (0, 60, 4, 60)


def test_a_cloud_without_a_measured_point_has_no_region():
    with pytest.raises(NoSeedError, match='measured'):
        choose_region(np.full((3, 4, 3), np.nan))
