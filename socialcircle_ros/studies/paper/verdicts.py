# SPDX-License-Identifier: Apache-2.0
"""Whether the paper's claim holds: the social circle keeps more points, removes more outliers and is faster."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from socialcircle_ros.metrics.scores import Scores
from socialcircle_ros.report.content import Column, Table
from socialcircle_ros.studies.comparison.methods import Method

SAME_SHARE = 0.001
"""Shares that differ by less count as equal: a tenth of a percentage point."""
SAME_TIME = 1.1
"""Times within this factor of each other count as equal."""


@dataclass(frozen=True)
class Outcome:
    """The result of one method, averaged over the clouds of a scene.

    Attributes:
        method: the filter and its settings.
        raw: number of measured points.
        kept: number of kept points.
        scores: against the truth.
        roc_area: area under the ROC curve; None where the filter gives no score.
        time_ms: median run time.
    """

    method: Method
    raw: float
    kept: float
    scores: Scores
    roc_area: float | None
    time_ms: float


@dataclass(frozen=True)
class ClaimVerdict:
    """The social circle compared with one other method: 1 it is better, 0 equal, -1 the other is better."""

    other: str
    keeps: int
    removes: int
    faster: int

    @property
    def holds(self) -> bool:
        """Whether all three parts of the claim hold."""
        return self.keeps == self.removes == self.faster == 1


def judge(ours: Outcome, other: Outcome) -> ClaimVerdict:
    """Compare the share of good points kept, the share of outliers removed, and the times."""
    return ClaimVerdict(
        other=other.method.label,
        keeps=_sign(other.scores.false_positive_rate - ours.scores.false_positive_rate, SAME_SHARE),
        removes=_sign(ours.scores.recall - other.scores.recall, SAME_SHARE),
        faster=_sign(math.log(other.time_ms / ours.time_ms), math.log(SAME_TIME)),
    )


def summary(others: str, verdicts: Sequence[ClaimVerdict]) -> str:
    """Sentences that count the verdicts.

    Args:
        others: the other methods, such as 'the filters of PCL and Open3D'.
        verdicts: one for each of them.
    """
    total = len(verdicts)
    kept, removed, speed = ([getattr(each, name) for each in verdicts] for name in ('keeps', 'removes', 'faster'))
    parts = [
        _sentence('keeps', 'more good points than', 'as many good points as', 'fewer good points than', kept),
        _sentence('removes', 'more outliers than', 'as many outliers as', 'fewer outliers than', removed),
        _sentence('is', 'faster than', 'as fast as', 'slower than', speed),
    ]
    holding = _counted(sum(verdict.holds for verdict in verdicts), total)
    return (
        f'The social circle is compared with {others}, {total} in total. {" ".join(parts)} All three parts of the'
        f' claim hold against {holding}.'
    )


def _sentence(verb: str, more: str, equal: str, less: str, values: Sequence[int]) -> str:
    """How many of the others it exceeds, equals and falls short of, such as 'It is faster than 2 of the 4.'."""
    counts = ((more, values.count(1)), (equal, values.count(0)), (less, values.count(-1)))
    clauses = [f'{comparison} {_counted(count, len(values))}' for comparison, count in counts if count]
    *first, last = clauses
    return f'It {verb} {", ".join(first)} and {last}.' if first else f'It {verb} {last}.'


def f1_ranking(outcomes: Sequence[Outcome]) -> str:
    """Sentences that give the highest F1 and the rank of the first outcome, the social circle."""
    order = sorted(outcomes, key=lambda each: -each.scores.f1)
    best, ours = order[0], outcomes[0]
    highest = f'The highest F1 is {best.scores.f1:.3f} ({best.method.label}).'
    if best is ours:
        return highest
    rank = order.index(ours) + 1
    return f'{highest} {ours.method.label}: F1 {ours.scores.f1:.3f}, rank {rank} of {len(order)}.'


def verdict_table(name: str, title: str, verdicts: Sequence[ClaimVerdict]) -> Table:
    """The verdicts, one row for each other method."""
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


def _counted(count: int, total: int) -> str:
    """A number of the others, such as '2 of the 4'."""
    if total == 1:
        return 'it' if count else 'none'
    return {0: 'none', total: 'both' if total == 2 else f'all {total}'}.get(count, f'{count} of the {total}')


def _word(value: int) -> str:
    return {1: 'yes', 0: 'same', -1: 'no'}[value]
