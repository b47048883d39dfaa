# SPDX-License-Identifier: Apache-2.0
"""The election of the initial point I (section 3.2.1)."""

import numpy as np
import pytest
from clouds import Recipe, flat, grid, measured_points, recipes
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from naive import circle as naive
from point_sets import hard_point_sets

from socialcircle_ros.circle.region import choose_region
from socialcircle_ros.circle.seed import elect_seed
from socialcircle_ros.circle.votes import vote_scores
from socialcircle_ros.errors import NoSeedError


@st.composite
def recipe_and_region(draw):
    """A recipe, and a vote region inside its cloud."""
    recipe = draw(recipes())
    row, column = draw(st.integers(0, recipe.rows - 1)), draw(st.integers(0, recipe.columns - 1))
    height = draw(st.integers(1, min(12, recipe.rows - row)))
    width = draw(st.integers(1, min(12, recipe.columns - column)))
    return recipe, (row, column, height, width)


@settings(max_examples=500, deadline=None)
@given(recipe_and_region())
def test_seed_is_that_of_the_reference(drawn):
    recipe, region = drawn
    xyz = recipe.cloud()
    try:
        expected = naive.elect_seed(xyz, region)
    except NoSeedError:
        with pytest.raises(NoSeedError, match='measured'):
            elect_seed(xyz, region)
    else:
        assert elect_seed(xyz, region) == expected


def test_seed_is_given_in_the_coordinates_of_the_cloud():
    heights = np.full((9, 11), np.nan)
    heights[6, 7] = 0.0

    assert elect_seed(grid(heights), (4, 5, 3, 4)) == (6, 7)


def test_of_equal_scores_the_first_in_row_order_is_elected():
    assert elect_seed(flat(1, 2), (0, 0, 1, 2)) == (0, 0)
    assert elect_seed(flat(2, 1), (0, 0, 2, 1)) == (0, 0)
    assert elect_seed(np.zeros((3, 4, 3)), (1, 1, 2, 3)) == (1, 1)


def test_seed_lies_on_the_surface_under_heavy_contamination():
    generator = np.random.default_rng(4)
    heights = np.zeros((20, 20))
    outlier = generator.random(heights.shape) < 0.4
    heights[outlier] = generator.uniform(15, 60, heights.shape)[outlier]

    seed = elect_seed(grid(heights), (0, 0, 20, 20))

    assert not outlier[seed]


# The winner is found from few scores. It must be the same as from all scores.


@pytest.mark.parametrize('points', list(hard_point_sets()))
def test_seed_of_a_hard_point_set_has_the_highest_score(points):
    row_of_points = points.T[None]
    with np.errstate(over='ignore', under='ignore'):
        scores = vote_scores(row_of_points)

        assert elect_seed(row_of_points, (0, 0, 1, points.shape[1])) == (0, np.argmax(scores))


@settings(max_examples=40, deadline=None)
@given(recipes(40, 60, least_rows=20, least_columns=30))
def test_seed_of_a_larger_region_has_the_highest_score(recipe):
    xyz = recipe.cloud()
    assume(measured_points(xyz))

    row, column = elect_seed(xyz, (0, 0, *xyz.shape[:2]))

    scores = vote_scores(xyz)
    assert row * xyz.shape[1] + column == np.nanargmax(scores)


@pytest.mark.parametrize('side', [59, 60])
@pytest.mark.parametrize('offset', [0.0, 1e5])
def test_seed_of_a_symmetric_region_is_the_first_highest_to_the_last_bit(side, offset):
    # The scores of the four points in the middle differ only by rounding.
    xyz = grid(np.zeros((side, side)))
    xyz[..., 0] += offset

    assert elect_seed(xyz, (0, 0, side, side)) == divmod(int(np.argmax(vote_scores(xyz))), side)


def test_a_point_with_a_coordinate_that_is_not_finite_does_not_vote_and_is_not_elected():
    for coordinate in range(3):
        for value in (np.nan, np.inf, -np.inf):
            xyz = flat(1, 2)
            xyz[0, 0, coordinate] = value
            assert elect_seed(xyz, (0, 0, 1, 2)) == (0, 1)


def test_the_vote_does_not_change_the_cloud():
    for recipe in (Recipe(9, 8, layout='read_only'), Recipe(9, 8, dtype='float32', layout='padded')):
        xyz = recipe.cloud()
        before = xyz.tobytes()
        vote_scores(xyz)
        choose_region(xyz)
        elect_seed(xyz, (0, 0, 9, 8))
        assert xyz.tobytes() == before
        assert len(measured_points(xyz)) == 72
