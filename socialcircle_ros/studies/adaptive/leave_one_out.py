"""What the adaptive mode is worth on a surface that its rules were not chosen on."""

import itertools
from collections.abc import Callable, Iterator, Sequence
from statistics import mean, median

import numpy as np

from socialcircle_ros.circle.adaptive import Rules, find_outliers
from socialcircle_ros.metrics.scores import score
from socialcircle_ros.report.content import Cell, Column, Section, Table

from .goals import Goal
from .inserted_outliers import ContaminatedSurface, MeasuredSurface, insert_outliers

SEEDS = (501, 502)
"""Of the outliers by which rules are chosen; those by which they are judged are others."""
SHARES = (0.01, 0.05, 0.3)
CLAIMED = 0.003
"""Most that rules may remove of the plausible points of an untouched surface, to be chosen."""


def candidates() -> Iterator[Rules]:
    """The rules to choose from."""
    for steep, clip, few in itertools.product((0.94, 0.955, 0.97), (3.5, 4.0, 4.5), (0.0125, 0.02)):
        yield Rules(steep, clip, few)


def leave_one_out(
    surfaces: Sequence[MeasuredSurface], seeds: Sequence[int], tell: Callable[[str], None]
) -> tuple[Section, Goal]:
    """Choose the rules on all surfaces but one, and judge them on that one; each is left out in turn.

    The rules chosen are those with the best mean F1 on the others at 1, 5 and 30 %, of those that remove at most
    0.3 % of what is plausible on each of them untouched, if there are any.

    Args:
        surfaces: measured surfaces, two at least.
        seeds: of the outliers by which the rules are judged, at 5 %.
        tell: called with what is going on.
    """
    chosen_on = [[insert_outliers(bare, share, seed) for share in SHARES for seed in SEEDS] for bare in surfaces]
    tried: list[tuple[Rules, list[float], list[float]]] = []
    for number, rules in enumerate(candidates(), start=1):
        tell(f'one surface left out: rules {number}')
        f1s = [
            mean(_f1(contaminated, rules) for contaminated in contaminated_surfaces)
            for contaminated_surfaces in chosen_on
        ]
        tried.append((rules, f1s, [_removed(bare, rules) for bare in surfaces]))
    rows: list[list[Cell]] = []
    for place, bare in enumerate(surfaces):
        others = [other for other in range(len(surfaces)) if other != place]
        careful = [one for one in tried if max(one[2][other] for other in others) <= CLAIMED]
        rules, _, removed = max(careful or tried, key=lambda one: mean(one[1][other] for other in others))
        f1 = median(_f1(insert_outliers(bare, 0.05, seed), rules) for seed in seeds)
        rows.append([bare.cloud.name, rules.steep, rules.clip, rules.few, f1, removed[place]])
    columns = [
        Column('left out'), Column('steep', '.3f'), Column('clip', '.1f'), Column('few', '.4f'),
        Column('F1 at 5 %', '.3f'), Column('untouched: removed', '.2%'),
    ]  # fmt: skip
    text = (
        'Three of the rules that a community is met with were chosen on all surfaces but the one of the line, and'
        ' judged on that one. The other constants took no part in this.'
    )
    table = Table('adaptive_leave_one_out', 'One surface left out', columns, rows)
    goal = Goal(
        f'{len(rows)} measured surfaces, each left out when rules are chosen, 5 % put in: median F1',
        median(float(row[4] or 0) for row in rows),
        0.92,
    )
    return Section('One surface left out', [text], items=[table]), goal


def _f1(contaminated: ContaminatedSurface, rules: Rules) -> float:
    found = find_outliers(contaminated.points[..., 2], None, rules).outliers
    return score(found, contaminated.outlier, contaminated.counted).f1


def _removed(bare: MeasuredSurface, rules: Rules) -> float:
    found = find_outliers(bare.cloud.points[..., 2], None, rules).outliers
    return float(np.mean(found[bare.plausible]))
