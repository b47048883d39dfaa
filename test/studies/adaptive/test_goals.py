"""Goals: a figure, what is asked of it, and whether that holds."""

import math

import pytest

from socialcircle_ros.studies.adaptive.goals import Goal, goals_table


@pytest.mark.parametrize(
    ('measured', 'least', 'holds'),
    [(0.93, True, True), (0.92, True, True), (0.91, True, False), (0.91, False, True), (0.93, False, False)],
)
def test_a_figure_reaches_its_goal_or_misses_it(measured, least, holds):
    assert Goal('F1', measured, 0.92, least).holds == holds


@pytest.mark.parametrize('least', [True, False])
def test_a_figure_that_could_not_be_taken_reaches_no_goal(least):
    assert Goal('F1', math.nan, 0.92, least).verdict == 'missed'


def test_the_sentence_says_figure_goal_and_verdict():
    goal = Goal('Points removed', 0.0047, 0.003, least=False, form='.2%')
    assert goal.sentence == 'Points removed: 0.47%, asked at most 0.30%: missed.'


def test_the_table_counts_the_goals_that_hold():
    table = goals_table('goals', [Goal('one', 1, 0), Goal('two', 0, 1)])
    assert table.title == '1 of 2 goals hold'
    assert [row[-1] for row in table.rows] == ['holds', 'missed']
