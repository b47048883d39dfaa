# SPDX-License-Identifier: Apache-2.0
"""Leave-one-out validation: the adaptive mode on a measured surface that its rules were not chosen on."""

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from statistics import mean, median

import numpy as np

from socialcircle_ros.circle.adaptive import Rules, find_outliers
from socialcircle_ros.metrics.scores import Scores
from socialcircle_ros.report.content import Cell, Column, Section, Table
from socialcircle_ros.studies.steps import Step, rows_of
from socialcircle_ros.studies.workload import DETECTION, INSERTION, million_points

from .goals import GOALS, Goal, goals_section
from .inserted_outliers import ContaminatedSurface, StudiedSurface, insert_outliers

SELECTION_SEEDS = (501, 502)
"""Seeds of the inserted outliers that rules are chosen on; they are judged on outliers of other seeds."""
SELECTION_SHARES = (0.01, 0.05, 0.3)
"""Shares of inserted outliers that rules are chosen on."""
MOST_REMOVED = 0.003
"""Largest share of the plausible points of an untouched surface that rules may remove, to be chosen."""


_TITLE = 'Leave-one-out validation'
_TRIALS = 'adaptive_rules'
_RULES = (Column('steep', '.3f'), Column('clip', '.1f'), Column('few', '.4f'))


@dataclass(frozen=True)
class _RulesTrial:
    """Rules, and for each surface their mean F1 and the share of plausible points that they remove untouched."""

    rules: Rules
    f1: list[float]
    removed: list[float]


def candidates() -> Iterator[Rules]:
    """The rules to choose from."""
    for steep, clip, few in itertools.product((0.94, 0.955, 0.97), (3.5, 4.0, 4.5), (0.0125, 0.02)):
        yield Rules(steep, clip, few)


def leave_one_out(
    surfaces: Sequence[StudiedSurface], seeds: Sequence[int], progress: Callable[[str], None]
) -> list[Step]:
    """Choose the rules on all surfaces but one, and judge them on that one; each surface is left out once.

    The chosen rules have the highest mean F1 on the other surfaces at 1, 5 and 30 % inserted outliers, among the
    rules that remove at most 0.3 % of the plausible points of each of them untouched. If no rules do, among all.

    Args:
        surfaces: two at least.
        seeds: of the inserted outliers that the rules are judged on, at 5 %.
        progress: called with the step that begins.

    Returns:
        A step for each surface, which tries all rules on it, and the choice.
    """
    clouds = len(SELECTION_SHARES) * len(SELECTION_SEEDS)
    rules = list(candidates())
    per_point = clouds * INSERTION + (clouds + 1) * len(rules) * DETECTION
    steps = [
        Step(
            f'adaptive_rules_{surface.cloud.name}',
            per_point * million_points(surface.plausible.shape),
            partial(_tried, surface, rules, progress),
        )
        for surface in surfaces
    ]
    points = sum(million_points(surface.plausible.shape) for surface in surfaces)
    work = points * len(seeds) * (INSERTION + DETECTION)
    return [*steps, Step('adaptive_leave_one_out', work, partial(_judged, surfaces, seeds, progress))]


def _tried(
    surface: StudiedSurface, rules: Sequence[Rules], progress: Callable[[str], None], _: Sequence[Section]
) -> list[Section]:
    """Try all rules on one surface."""
    name = surface.cloud.name
    contaminated = [
        insert_outliers(surface, share, seed) for share in SELECTION_SHARES for seed in SELECTION_SEEDS
    ]
    rows: list[list[Cell]] = []
    for number, each in enumerate(rules, start=1):
        progress(f'{name}: rules {number} of {len(rules)}')
        f1 = mean(_score(cloud, each).f1 for cloud in contaminated)
        rows.append([name, each.steep, each.clip, each.few, f1, _removed(surface, each)])
    columns = [Column('surface'), *_RULES, Column('mean F1', '.3f'), Column('untouched: removed', '.2%')]
    return [Section(_TITLE, items=[Table(_TRIALS, 'All rules on all surfaces', columns, rows)])]


def _judged(
    surfaces: Sequence[StudiedSurface],
    seeds: Sequence[int],
    progress: Callable[[str], None],
    made: Sequence[Section],
) -> list[Section]:
    """Choose the rules for each surface that is left out, and judge them on it."""
    trials = _trials(rows_of(made, _TRIALS), [surface.cloud.name for surface in surfaces])
    rows: list[list[Cell]] = []
    for place, surface in enumerate(surfaces):
        progress(f'{surface.cloud.name}: left out')
        chosen = _choose(trials, [other for other in range(len(surfaces)) if other != place])
        rules = chosen.rules
        f1 = median(_score(insert_outliers(surface, 0.05, seed), rules).f1 for seed in seeds)
        rows.append([surface.cloud.name, rules.steep, rules.clip, rules.few, f1, chosen.removed[place]])
    columns = [Column('left out'), *_RULES, Column('F1 at 5 %', '.3f'), Column('untouched: removed', '.2%')]
    text = (
        'Three rules of the adaptive mode are chosen on all surfaces but the one in the row, and judged on that'
        ' one. The other constants are not part of this validation.'
    )
    table = Table('adaptive_leave_one_out', 'Leave-one-out validation of three rules', columns, rows)
    goal = Goal(
        f'Median F1 on {len(rows)} measured surfaces with 5 % inserted outliers, leave-one-out',
        median(float(row[4] or 0) for row in rows),
        0.92,
    )
    return [Section(_TITLE, [text], items=[table]), goals_section(GOALS, [goal])]


def _trials(rows: Sequence[Sequence[Cell]], names: Sequence[str]) -> list[_RulesTrial]:
    """The rules, and what each does on every surface, from the table of the steps."""
    by_surface = [[[float(value or 0) for value in row[1:]] for row in rows if row[0] == name] for name in names]
    return [
        _RulesTrial(Rules(*of_rules[0][:3]), [each[3] for each in of_rules], [each[4] for each in of_rules])
        for of_rules in zip(*by_surface, strict=True)
    ]


def _choose(trials: Sequence[_RulesTrial], places: Sequence[int]) -> _RulesTrial:
    """The trial that is best on the surfaces at these places."""
    careful = [each for each in trials if max(each.removed[place] for place in places) <= MOST_REMOVED]
    return max(careful or trials, key=lambda each: mean(each.f1[place] for place in places))


def _score(surface: ContaminatedSurface, rules: Rules) -> Scores:
    return surface.score(find_outliers(surface.points[..., 2], None, rules).outliers)


def _removed(surface: StudiedSurface, rules: Rules) -> float:
    """Share of the plausible points of an untouched surface that the rules remove."""
    found = find_outliers(surface.cloud.points[..., 2], None, rules).outliers
    return float(np.mean(found[surface.plausible]))
