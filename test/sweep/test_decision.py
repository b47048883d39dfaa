# SPDX-License-Identifier: Apache-2.0
"""What a sweep may conclude."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sweep.sweep_examples import trial

from socialcircle_ros.sweep.decision import MOST_CANDIDATES, candidates_of, decide


def scored(value, *scores, removed=0.1):
    return trial(value, float(np.mean(scores)), removed, scores)


GIVEN = scored(1.0, 0.5, 0.6, 0.7, 0.4)


def test_a_margin_beyond_the_spread_has_a_winner():
    better = scored(2.0, 0.8, 0.9, 0.95, 0.75)
    found = decide([GIVEN, better, scored(3.0, 0.1, 0.2, 0.3, 0.4)], GIVEN, has_truth=True)
    assert found.winner is better
    assert 'is better beyond the spread: the margin over the parameters as given is 0.3000' in found.reason
    assert {GIVEN.values['circle.radius_scale'], 2.0} <= {
        each.values['circle.radius_scale'] for each in found.candidates
    }


@pytest.mark.parametrize(
    ('other', 'sentence'),
    [
        (scored(2.0, 1.0, 0.5, 0.7, 0.3), 'No setting is clearly better'),
        (scored(2.0, 0.4, 0.4, 0.4, 0.4), 'No setting scores higher than the parameters as given'),
    ],
)
def test_a_margin_within_the_spread_is_no_verdict(other, sentence):
    found = decide([GIVEN, other], GIVEN, has_truth=True)
    assert found.winner is None
    assert sentence in found.reason


def test_one_cloud_shows_no_spread():
    one = scored(1.0, 0.2)
    found = decide([one, scored(2.0, 0.9)], one, has_truth=True)
    assert found.winner is None
    assert found.reason.startswith('1 cloud shows no spread between clouds, so the margin of 0.7000')


def test_without_a_truth_a_person_decides():
    found = decide([GIVEN, scored(2.0, 1.0, 1.0, 1.0, 1.0)], GIVEN, has_truth=False)
    assert found.winner is None
    assert 'a person decides' in found.reason
    assert len(found.candidates) == 2


def test_the_best_of_many_equal_settings_does_not_win_by_chance():
    """With many settings the highest mean is high by chance; on the cloud left out it is not."""
    random = np.random.default_rng(5)
    winners = 0
    for _ in range(200):
        trials = [scored(number, *random.normal(0.5, 0.1, 6)) for number in range(40)]
        winners += decide(trials, trials[0], has_truth=True).winner is not None
    assert winners < 20


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=30), st.booleans())
def test_candidates_have_different_results_and_the_given_one_is_the_first(shares, by_score):
    trials = [scored(number, 1 - share, removed=share) for number, share in enumerate(shares)]
    found = candidates_of(trials, trials[0], by_score=by_score)
    assert found[0] is trials[0]
    assert len(found) == min(MOST_CANDIDATES, len(set(shares)))
    assert len({each.removed for each in found}) == len(found)
    if not by_score:
        assert {min(shares), max(shares)} <= {each.removed for each in found} or len(set(shares)) > len(found)
