# SPDX-License-Identifier: Apache-2.0
"""Whether the paper's claim holds."""

import pytest

from socialcircle_ros.baselines.settings import RadiusSettings
from socialcircle_ros.metrics.scores import Scores
from socialcircle_ros.settings import CircleSettings
from socialcircle_ros.studies.comparison.methods import method
from socialcircle_ros.studies.paper.verdicts import Outcome, f1_ranking, judge, summary, verdict_table


def outcome(settings, recall, false_positive_rate, time_ms):
    scores = Scores(1.0, recall, 1.0, false_positive_rate)
    return Outcome(method(settings, 'default'), 100, 90, scores, None, time_ms)


OURS = outcome(CircleSettings(), 0.9, 0.01, 10.0)


@pytest.mark.parametrize(
    ('recall', 'rate', 'time_ms', 'expected'),
    [
        (0.8, 0.02, 20.0, (1, 1, 1)),
        (0.95, 0.001, 5.0, (-1, -1, -1)),
        (0.9002, 0.0102, 10.5, (0, 0, 0)),
        (0.95, 0.02, 9.5, (1, -1, 0)),
    ],
)
def test_each_part_of_the_claim_is_judged_separately(recall, rate, time_ms, expected):
    verdict = judge(OURS, outcome(RadiusSettings(), recall, rate, time_ms))
    assert (verdict.keeps, verdict.removes, verdict.faster) == expected
    assert verdict.holds == (expected == (1, 1, 1))


def test_the_summary_and_the_table_follow_from_the_numbers():
    worse, better = outcome(RadiusSettings(), 0.8, 0.02, 20.0), outcome(RadiusSettings(), 0.95, 0.02, 5.0)
    verdicts = [judge(OURS, worse), judge(OURS, better)]
    assert summary('other filters', verdicts) == (
        'The social circle is compared with other filters, 2 in total. It keeps more good points than both. It'
        ' removes more outliers than 1 of the 2 and fewer outliers than 1 of the 2. It is faster than 1 of the 2'
        ' and slower than 1 of the 2. All three parts of the claim hold against 1 of the 2.'
    )
    rows = verdict_table('name', 'title', verdicts).rows
    assert [row[1:] for row in rows] == [['yes', 'yes', 'yes', 'holds'], ['yes', 'no', 'no', 'does not hold']]


def test_the_summary_counts_equal_results_separately():
    equal = judge(OURS, outcome(RadiusSettings(), 0.9, 0.01, 10.0))
    assert summary('one filter', [equal]) == (
        'The social circle is compared with one filter, 1 in total. It keeps as many good points as it. It'
        ' removes as many outliers as it. It is as fast as it. All three parts of the claim hold against none.'
    )


def with_f1(settings, f1):
    return Outcome(method(settings, 'default'), 100, 90, Scores(1.0, 1.0, f1, 0.0), None, 1.0)


def test_the_ranking_is_by_f1():
    assert f1_ranking([with_f1(CircleSettings(), 0.9), with_f1(RadiusSettings(), 0.95)]) == (
        'The highest F1 is 0.950 (Radius, default). Social circle, default: F1 0.900, rank 2 of 2.'
    )


def test_the_ranking_names_the_first_rank_once():
    assert f1_ranking([with_f1(CircleSettings(), 0.96), with_f1(RadiusSettings(), 0.95)]) == (
        'The highest F1 is 0.960 (Social circle, default).'
    )
