# SPDX-License-Identifier: Apache-2.0
"""The votes and their sums, the scores M (section 3.2.1, eq. 4)."""

import math

import numpy as np
import pytest
from clouds import Recipe, recipes
from hypothesis import example, given, settings
from naive import circle as naive
from point_sets import contaminated_sheet

from socialcircle_ros.circle import votes
from socialcircle_ros.circle.medians import median_distances
from socialcircle_ros.circle.seed import elect_seed
from socialcircle_ros.circle.votes import vote_scores

PEAK = 1 / math.sqrt(2 * math.pi)


def on_a_line(*places):
    """A cloud of one row, with points at these x and at y = z = 0."""
    return np.array([[[x, 0.0, 0.0] for x in places]])


@settings(max_examples=900, deadline=None)
@given(recipes(14, 14))
@example(Recipe(5, 6, surface='coincident', layout='padded'))
@example(Recipe(5, 6, surface='noise', unit='huge'))
@example(Recipe(5, 6, surface='noise', unit='tiny'))
def test_scores_are_those_of_the_reference_bit_for_bit(recipe):
    xyz = recipe.cloud()

    scores = vote_scores(xyz)

    assert scores.dtype == np.float64
    assert scores.shape == xyz.shape[:2]
    np.testing.assert_array_equal(scores, naive.vote_scores(xyz))


@settings(max_examples=10, deadline=None)
@given(recipes(40, 40))
def test_scores_of_larger_regions_are_those_of_the_reference_bit_for_bit(recipe):
    xyz = recipe.cloud()

    np.testing.assert_array_equal(vote_scores(xyz), naive.vote_scores(xyz))


def test_score_is_the_sum_of_received_votes():
    # With two others mu is the mean of both distances: 2 for the point at 0, 1.5 at 1, 2.5 at 3.
    scores = vote_scores(on_a_line(0.0, 1.0, 3.0))

    expected = [
        math.exp(-((1 / 1.5) ** 2) / 2) + math.exp(-((3 / 2.5) ** 2) / 2),
        math.exp(-((1 / 2.0) ** 2) / 2) + math.exp(-((2 / 2.5) ** 2) / 2),
        math.exp(-((3 / 2.0) ** 2) / 2) + math.exp(-((2 / 1.5) ** 2) / 2),
    ]
    np.testing.assert_allclose(scores[0], np.multiply(expected, PEAK), rtol=1e-14)


def test_the_votes_received_decide_not_the_votes_given():
    # The sums of the votes that each point gives are 1.207, 1.212 and 1.213. They would elect the far point.
    assert elect_seed(on_a_line(0.0, 1.0, 3.0), (0, 0, 1, 3)) == (0, 1)


def test_median_of_an_odd_number_of_distances_is_the_middle_one():
    scores = vote_scores(on_a_line(0.0, 1.0, 3.0, 9.0))

    # The sorted distances of each voter; the point at 9 receives votes from 0, 1 and 3.
    mu = {0: sorted([1, 3, 9])[1], 1: sorted([1, 2, 8])[1], 3: sorted([3, 2, 6])[1]}
    expected = sum(math.exp(-(((9 - place) / mu[place]) ** 2) / 2) for place in mu)
    assert scores[0, 3] == pytest.approx(PEAK * expected, rel=1e-14)


def test_median_of_an_even_number_of_distances_is_the_mean_of_both_middle_distances():
    scores = vote_scores(on_a_line(0.0, 1.0, 3.0, 9.0, 27.0))

    mu = {0: (3 + 9) / 2, 1: (2 + 8) / 2, 3: (3 + 6) / 2, 9: (8 + 9) / 2}
    expected = sum(math.exp(-(((27 - place) / mu[place]) ** 2) / 2) for place in mu)
    assert scores[0, 4] == pytest.approx(PEAK * expected, rel=1e-14)


def test_points_that_are_not_measured_have_no_score_and_no_vote():
    xyz = on_a_line(0.0, 1.0, 3.0)
    with_gaps = np.full((3, 3, 3), 5.0)
    with_gaps[0], with_gaps[1], with_gaps[2] = xyz[0, 0], xyz[0, 1], xyz[0, 2]
    with_gaps[:, 0, 0], with_gaps[:, 2, 2] = np.nan, -np.inf

    scores = vote_scores(with_gaps)

    np.testing.assert_array_equal(scores[:, 1], vote_scores(xyz)[0])
    assert np.isnan(scores[:, [0, 2]]).all()


def test_region_without_a_measured_point_has_no_scores():
    assert np.isnan(vote_scores(np.full((2, 3, 3), np.nan))).all()


def test_a_single_measured_point_has_score_0():
    np.testing.assert_array_equal(vote_scores(on_a_line(np.nan, 4.0)), [[np.nan, 0.0]])


def test_a_voter_with_median_distance_0_votes_only_for_points_at_its_own_place():
    # Three of the four points are at one place, so that their mu is 0.
    scores = vote_scores(on_a_line(2.0, 2.0, 7.0, 2.0))[0]

    assert scores[2] == 0.0
    distant = PEAK * math.exp(-1 / 2)
    np.testing.assert_allclose(scores[[0, 1, 3]], 2 * PEAK + distant, rtol=1e-14)


def test_vote_over_an_infinite_distance_is_0():
    scores = vote_scores(on_a_line(0.0, 1.0, 2.0, 1e200))[0]

    assert scores[3] == 0.0
    assert (scores[:3] > 0).all()


def test_estimated_scores_are_right_within_the_margin_and_bound_the_others():
    points = contaminated_sheet(40, 40, share=0.2)
    n = points.shape[1]
    mu = median_distances(points)
    exact = votes._scores(points, mu, np.arange(n)) / PEAK
    exact += 1  # the estimates include the vote of each point for itself

    estimates, margin = votes._estimate_scores(points, mu)

    estimated = np.isfinite(estimates)
    assert estimated.sum() < n / 4
    np.testing.assert_allclose(estimates[estimated], exact[estimated], rtol=0, atol=1e-7 * n)
    assert (exact[~estimated] < estimates.max() - margin).all()


@pytest.mark.parametrize('mu', [0.0, 1e-160, 1e160])
def test_the_highest_score_is_found_where_votes_cannot_be_estimated(mu):
    """Six points at one place, with votes that are not estimated, and four near each other and far from it."""
    points = np.zeros((3, 10))
    points[0, 6:] = 10, 10.1, 10.2, 10.3
    every_mu = np.where(np.arange(10) < 6, mu, 10.0)
    exact = votes._scores(points, every_mu, np.arange(10))
    assert votes.highest_score(points, every_mu) == int(np.argmax(exact))
