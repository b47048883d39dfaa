# SPDX-License-Identifier: Apache-2.0
"""How a lesson is learnt."""

import numpy as np
import pytest
from good_parts import drilled, part, pitted

from socialcircle_ros.circle.adaptive import Rules
from socialcircle_ros.circle.network import packaged_network
from socialcircle_ros.settings.lessons import TRAITS, WEIGHTS, Lesson
from socialcircle_ros.teaching import learn as learning
from socialcircle_ros.teaching.clouds import good_fields
from socialcircle_ros.teaching.examples import TAUGHT, LabelledCommunities


def learnt(heights, likelihood):
    done = []
    fields = good_fields([part(heights)])[0]
    lesson = learning.learn(fields, ('a',), likelihood, lambda: done.append(1))
    assert len(done) == len(fields) * (1 + len(TAUGHT))
    return lesson


def test_where_outliers_melt_into_steps_a_lesson_judges_more_probable_points():
    likelihood = packaged_network().probabilities
    assert learnt(drilled(), likelihood).least > learning._LEVELS[0]


def test_the_rules_find_at_their_own_level():
    lesson = learnt(pitted(), None)
    assert lesson.least == Rules().steep
    assert lesson.threshold >= 0.7


def lesson_of_constant(constant, judge):
    """A lesson that gives every community the same chance."""
    weights = (constant, *[0.0] * (WEIGHTS - 1))
    return Lesson((), (1.0, 1.0), judge, 0.2, (0.0,) * len(TRAITS), (1.0,) * len(TRAITS), weights, 0.5, {})


@pytest.mark.parametrize(
    ('constant', 'judge', 'points', 'threshold'),
    [
        (2.0, 'network', 10_001, 0.5), (2.0, 'rules', 10_001, 0.7),
        (2.0, 'network', 9_999, 0.95), (1.0, 'network', 9_999, 0.85), (4.0, 'rules', 9_999, 0.95),
    ],
)  # fmt: skip
def test_the_threshold_is_the_least_that_removes_hardly_a_good_point(constant, judge, points, threshold):
    """Three of 10,000 points may be removed."""
    good = LabelledCommunities(np.zeros((1, len(TRAITS))), np.array([0.0]), np.array([3.0]))
    assert learning._threshold(lesson_of_constant(constant, judge), good, points) == threshold


@pytest.mark.parametrize(('constant', 'f1'), [(5.0, 16 / 40), (-5.0, 0.0)])
def test_the_score_counts_what_is_not_found(constant, f1):
    lesson = lesson_of_constant(constant, 'network')
    kind = LabelledCommunities(np.zeros((1, len(TRAITS))), np.array([8.0]), np.array([2.0]))
    assert learning._f1(lesson, [kind], [30]) == pytest.approx(f1)
