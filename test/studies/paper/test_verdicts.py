"""Whether the claim holds."""

import pytest

from socialcircle_ros.baselines.settings import RadiusSettings
from socialcircle_ros.metrics.scores import Scores
from socialcircle_ros.settings import CircleSettings
from socialcircle_ros.studies.comparison.methods import method
from socialcircle_ros.studies.paper.verdicts import Outcome, in_a_sentence, judge, standing, table


def outcome(settings, recall, false_positive_rate, milliseconds):
    scores = Scores(1.0, recall, 1.0, false_positive_rate)
    return Outcome(method(settings, 'default'), 100, 90, scores, None, milliseconds)


OURS = outcome(CircleSettings(), 0.9, 0.01, 10.0)


@pytest.mark.parametrize(
    ('recall', 'rate', 'time', 'expected'),
    [
        (0.8, 0.02, 20.0, (1, 1, 1)),
        (0.95, 0.001, 5.0, (-1, -1, -1)),
        (0.9002, 0.0102, 10.5, (0, 0, 0)),
        (0.95, 0.02, 9.5, (1, -1, 0)),
    ],
)
def test_each_part_of_the_claim_is_judged_for_itself(recall, rate, time, expected):
    found = judge(OURS, outcome(RadiusSettings(), recall, rate, time))
    assert (found.keeps, found.removes, found.faster) == expected
    assert found.holds == (expected == (1, 1, 1))


def test_the_sentence_and_the_table_say_what_the_numbers_say():
    worse, better = outcome(RadiusSettings(), 0.8, 0.02, 20.0), outcome(RadiusSettings(), 0.95, 0.02, 5.0)
    found = [judge(OURS, worse), judge(OURS, better)]
    assert in_a_sentence('other filters', found) == (
        'Against other filters (2 in all), the social circle keeps more good points than 2, removes more outliers'
        ' than 1 and is faster than 1 of them; the whole claim holds against 1 of 2.'
    )
    rows = table('name', 'title', found).rows
    assert [row[1:] for row in rows] == [['yes', 'yes', 'yes', 'holds'], ['yes', 'no', 'no', 'does not hold']]


def test_the_standing_is_by_f1():
    def with_f1(settings, f1):
        return Outcome(method(settings, 'default'), 100, 90, Scores(1.0, 1.0, f1, 0.0), None, 1.0)

    assert standing([with_f1(CircleSettings(), 0.9), with_f1(RadiusSettings(), 0.95)]) == (
        'The highest F1 is that of Radius, default (0.950); Social circle, default is number 2 of 2 (0.900).'
    )
