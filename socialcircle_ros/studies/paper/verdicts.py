"""Whether the paper's claim holds, "keeps more points, removes more outliers, is faster": from the numbers."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from socialcircle_ros.metrics.scores import Scores
from socialcircle_ros.report.content import Column, Table
from socialcircle_ros.studies.comparison.methods import Method

SAME_SHARE = 0.001
"""Shares that differ by less are called the same: a tenth of a percentage point."""
SAME_TIME = 1.1
"""Times within this factor of each other are called the same."""


@dataclass(frozen=True)
class Outcome:
    """What one filter did on one cloud.

    Attributes:
        method: the filter, set.
        raw: number of measured points.
        kept: number of points that it kept.
        scores: against the truth.
        roc: area under the curve; None where the filter has no score.
        milliseconds: median time.
    """

    method: Method
    raw: float
    kept: float
    scores: Scores
    roc: float | None
    milliseconds: float


@dataclass(frozen=True)
class ClaimVerdict:
    """Ours against one other filter: 1 ours is better, 0 the same, -1 the other is better."""

    other: str
    keeps: int
    removes: int
    faster: int

    @property
    def holds(self) -> bool:
        """Whether all three parts of the claim hold."""
        return self.keeps == self.removes == self.faster == 1


def judge(ours: Outcome, other: Outcome) -> ClaimVerdict:
    """Compare the good points that are kept, the outliers that are removed, and the times."""
    return ClaimVerdict(
        other=other.method.label,
        keeps=_sign(other.scores.false_positive_rate - ours.scores.false_positive_rate, SAME_SHARE),
        removes=_sign(ours.scores.recall - other.scores.recall, SAME_SHARE),
        faster=_sign(math.log(other.milliseconds / ours.milliseconds), math.log(SAME_TIME)),
    )


def in_a_sentence(others: str, verdicts: Sequence[ClaimVerdict]) -> str:
    """What the verdicts against some others come to."""
    total = len(verdicts)
    parts = []
    for words, values in (
        ('keeps more good points than', [verdict.keeps for verdict in verdicts]),
        ('removes more outliers than', [verdict.removes for verdict in verdicts]),
        ('is faster than', [verdict.faster for verdict in verdicts]),
    ):
        same = f' (as many or as fast as {values.count(0)})' if values.count(0) else ''
        parts.append(f'{words} {values.count(1)}{same}')
    holding = sum(verdict.holds for verdict in verdicts)
    whole = {0: 'against none', total: f'against all {total}'}.get(holding, f'against {holding} of {total}')
    return (
        f'Against {others} ({total} in all), the social circle {parts[0]}, {parts[1]} and {parts[2]} of them; the'
        f' whole claim holds {whole}.'
    )


def standing(outcomes: Sequence[Outcome]) -> str:
    """Who has the highest F1, and where the first of the outcomes, ours, stands."""
    order = sorted(outcomes, key=lambda each: -each.scores.f1)
    best, ours = order[0], outcomes[0]
    return (
        f'The highest F1 is that of {best.method.label} ({best.scores.f1:.3f}); {ours.method.label} is number'
        f' {order.index(ours) + 1} of {len(order)} ({ours.scores.f1:.3f}).'
    )


def table(name: str, title: str, verdicts: Sequence[ClaimVerdict]) -> Table:
    """The verdicts, one line for each other filter."""
    rows = [
        [
            each.other,
            _word(each.keeps),
            _word(each.removes),
            _word(each.faster),
            'holds' if each.holds else 'does not hold',
        ]
        for each in verdicts
    ]
    columns = [
        Column('Social circle (default) against'),
        Column('keeps more good points'),
        Column('removes more outliers'),
        Column('is faster'),
        Column('the whole claim'),
    ]
    note = f'"same": shares within {100 * SAME_SHARE:g} percentage points, times within a factor of {SAME_TIME:g}.'
    return Table(name, title, columns, rows, note)


def _sign(difference: float, same: float) -> int:
    return 0 if abs(difference) < same else (1 if difference > 0 else -1)


def _word(value: int) -> str:
    return {1: 'yes', 0: 'same', -1: 'no'}[value]
