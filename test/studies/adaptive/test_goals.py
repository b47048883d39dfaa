# SPDX-License-Identifier: Apache-2.0
"""Goals: a measured quantity, its bound, and whether it is met."""

import math

import pytest

from socialcircle_ros.studies.adaptive.goals import Goal, goals_met, goals_section
from socialcircle_ros.studies.steps import merged


@pytest.mark.parametrize(
    ('measured', 'at_least', 'is_met'),
    [(0.93, True, True), (0.92, True, True), (0.91, True, False), (0.91, False, True), (0.93, False, False)],
)
def test_a_value_on_the_right_side_of_the_bound_meets_the_goal(measured, at_least, is_met):
    assert Goal('F1', measured, 0.92, at_least).is_met == is_met


@pytest.mark.parametrize('at_least', [True, False])
def test_a_value_that_could_not_be_measured_misses_the_goal(at_least):
    assert Goal('F1', math.nan, 0.92, at_least).verdict == 'missed'


def test_the_sentence_gives_value_bound_and_verdict():
    goal = Goal('Points removed', 0.0047, 0.003, at_least=False, form='.2%')
    assert goal.sentence == 'Points removed: 0.47% (goal: at most 0.30%, missed).'


def test_the_goals_of_all_steps_are_counted():
    goals = [
        goals_section('goals', [Goal('one', 1, 0), Goal('two', 0, 1)]),
        goals_section('goals', [Goal('three', 2, 1)]),
    ]
    (section,) = merged([*goals, goals_met('goals', goals)])
    assert section.findings[-1] == '2 of 3 goals are met.'
    assert [row[-1] for row in section.tables[0].rows] == ['met', 'missed', 'met']
