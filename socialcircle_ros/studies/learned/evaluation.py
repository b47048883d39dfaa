# SPDX-License-Identifier: Apache-2.0
"""The network, the rules of the adaptive mode, and both, on the same whole surfaces with the same outliers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from statistics import median

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.circle.adaptive import find_outliers
from socialcircle_ros.circle.adaptive.likelihood import CERTAIN, LIKELY, LIKELY_AMONG_MANY
from socialcircle_ros.circle.network import NetworkJudge
from socialcircle_ros.cloud import Mask
from socialcircle_ros.report.content import Cell, Column, Picture, Section, Table
from socialcircle_ros.studies.adaptive.goals import Goal, goals_table
from socialcircle_ros.studies.adaptive.inserted_outliers import (
    ContaminatedSurface,
    OutlierShapes,
    StudiedSurface,
    insert_outliers,
)
from socialcircle_ros.studies.comparison.study import Study
from socialcircle_ros.studies.timing import repeated_ms

from . import drawings
from .surfaces import DEVELOPMENT, HELD_OUT

THRESHOLDS = (0.3, 0.5, 0.65, 0.8, 0.9, 0.95)
"""Probabilities that the table of thresholds compares."""
PICTURES = 10
"""Clouds drawn: those that the network judges worst."""
JUDGES = ('rules', 'network', 'both')
"""`both` is what `circle.judge: network` does."""
_TIMED = (960, 1280)


@dataclass(frozen=True)
class Check:
    """Outliers that are put in; neither generator was used for the training.

    Attributes:
        name: heading of its column.
        share: of the measured points.
        shapes: as `insert_outliers` takes it.
    """

    name: str
    share: float
    shapes: OutlierShapes


CHECKS = (
    Check('ellipses 5 %', 0.05, 'ellipses'),
    Check('irregular 5 %', 0.05, 'irregular'),
    Check('irregular 1 %', 0.01, 'irregular'),
    Check('irregular 30 %', 0.3, 'irregular'),
)


@dataclass(frozen=True, eq=False)
class Judged:
    """How one surface was judged.

    Attributes:
        name: of the surface.
        group: 'development', 'training' or 'left out' (of the training of these weights).
        f1: for each check, of each judge.
        removed: share of the plausible points of the untouched surface, by each judge.
        nearly: share of its points in shapes that are nearly islands, from which the rules warn.
        by_threshold: for each threshold, F1 of each check and the share removed.
        worst: the contaminated surface of the second check, and what the network removes of it.
    """

    name: str
    group: str
    f1: list[list[float]]
    removed: list[float]
    nearly: float
    by_threshold: list[tuple[list[float], float]]
    worst: tuple[ContaminatedSurface, Mask] = field(repr=False)


def learned(study: Study, surfaces: Sequence[StudiedSurface], judge: NetworkJudge) -> list[Section]:
    """Compare the network with the rules: goals, surfaces, thresholds, time, and the worst clouds.

    Args:
        study: its seeds give the outliers; medians are over them.
        surfaces: of the data folder and of its `training/`.
        judge: the network.
    """
    judged = []
    for surface in surfaces:
        study.progress(f'{surface.cloud.name}: rules and network')
        judged.append(_judged(surface, judge, study.plan.seeds))
    study.progress('timing')
    goals = [*_goals(judged), _time_goal(judge, study.plan.repeats)]
    text = (
        'Outliers are put into whole surfaces by two generators that the network was never trained on: `ellipses`'
        ' is `simulation.add_outliers`, `irregular` is `add_irregular_outliers`. Points of the untouched surface'
        f' beyond 10 robust σ of its 11×11 median are not counted. Medians over {len(study.plan.seeds)} seeds.'
        f' `both` removes the islands of the rules whose mean probability is above {LIKELY:g}, above'
        f' {LIKELY_AMONG_MANY:g} among many outliers, and points above {CERTAIN:g}.'
        ' "Left out" are surfaces of instruments that these weights were not trained on: '
        + '; '.join(f'{name} ({instrument})' for name, instrument in HELD_OUT.items())
        + '.'
    )
    return [
        Section('Goals', findings=[goal.sentence for goal in goals], items=[goals_table('learned_goals', goals)]),
        Section('Surfaces', [text], items=[_summary(judged), _surfaces_table(judged), _thresholds_table(judged)]),
        Section('Worst clouds', items=_pictures(judged, study.progress)),
    ]


def _judged(surface: StudiedSurface, judge: NetworkJudge, seeds: Sequence[int]) -> Judged:
    f1, by_check, worst = [], [], None
    for check in CHECKS:
        scores = []
        for seed in seeds:
            made = insert_outliers(surface, check.share, seed, check.shapes)
            masks = _masks(made.points[..., 2], judge)
            scores.append([made.score(mask).f1 for mask in masks])
            if check is CHECKS[1]:
                worst = made, masks[1]
        medians = [median(column) for column in zip(*scores, strict=True)]
        f1.append(medians[: len(JUDGES)])
        by_check.append(medians[len(JUDGES) :])
    removed = [float(mask[surface.plausible].mean()) for mask in _masks(surface.cloud.points[..., 2], judge)]
    by_threshold = [
        ([each[place] for each in by_check], removed[len(JUDGES) + place]) for place in range(len(THRESHOLDS))
    ]
    assert worst is not None  # noqa: S101 the second check ran
    name = surface.cloud.name
    nearly = find_outliers(surface.cloud.points[..., 2].astype(np.float32)).nearly
    return Judged(name, _group(name), f1, removed[: len(JUDGES)], nearly, by_threshold, worst)


def _masks(heights: NDArray[np.floating], judge: NetworkJudge) -> list[Mask]:
    """What each judge removes, then what the network removes at each threshold."""
    heights = heights.astype(np.float32)
    rules = find_outliers(heights).outliers
    probabilities = judge.probabilities(heights)
    network = [probabilities > each for each in (judge.threshold, *THRESHOLDS)]
    both = find_outliers(heights, likelihood=lambda _: probabilities).outliers
    return [rules, network[0], both, *network[1:]]


def _group(name: str) -> str:
    if name in HELD_OUT:
        return 'left out'
    return 'development' if name in DEVELOPMENT else 'training'


def _columns(first: Sequence[Column]) -> list[Column]:
    checks = [Column(f'{check.name}: {judge}', '.3f') for check in CHECKS for judge in JUDGES]
    return [*first, *checks, *(Column(f'untouched: {judge}', '.3%') for judge in JUDGES)]


def _summary(judged: Sequence[Judged]) -> Table:
    """Median and worst surface of each group."""
    rows: list[list[Cell]] = []
    for group in ('left out', 'development', 'training'):
        members = [each for each in judged if each.group == group]
        if not members:
            continue
        scores = [
            [each.f1[check][judge] for each in members]
            for check in range(len(CHECKS))
            for judge in range(len(JUDGES))
        ]
        removed = [[each.removed[judge] for each in members] for judge in range(len(JUDGES))]
        count = len(members)
        rows.append([f'{group}, {count}: median', *map(median, scores), *map(median, removed)])
        rows.append([f'{group}, {count}: worst', *map(min, scores), *map(max, removed)])
    columns = _columns([Column('surfaces')])
    return Table('learned_summary', 'F1 and removed points', columns, rows)


def _surfaces_table(judged: Sequence[Judged]) -> Table:
    rows: list[list[Cell]] = [
        [each.name, each.group, *(value for values in each.f1 for value in values), *each.removed, each.nearly]
        for each in judged
    ]
    columns = [*_columns([Column('surface'), Column('group')]), Column('untouched: nearly outliers', '.1%')]
    return Table('learned_surfaces', 'Each surface', columns, rows)


def _thresholds_table(judged: Sequence[Judged]) -> Table:
    """The threshold is chosen on the development surfaces; the table shows what others would have done."""
    rows: list[list[Cell]] = []
    for group in ('development', 'left out'):
        members = [each for each in judged if each.group == group]
        for place, threshold in enumerate(THRESHOLDS if members else ()):
            of_threshold = [each.by_threshold[place] for each in members]
            f1 = [median(each[0][check] for each in of_threshold) for check in range(len(CHECKS))]
            removed = [each[1] for each in of_threshold]
            rows.append([group, threshold, *f1, median(removed), max(removed)])
    columns = [
        Column('surfaces'), Column('threshold', '.2f'), *(Column(check.name, '.3f') for check in CHECKS),
        Column('untouched, median', '.3%'), Column('untouched, worst', '.3%'),
    ]  # fmt: skip
    return Table('learned_thresholds', 'Median F1 of the network by threshold', columns, rows)


def _goals(judged: Sequence[Judged]) -> list[Goal]:
    """The goals that were set for the network."""
    goals = []
    developed = [each for each in judged if each.group == 'development']
    apart = [each for each in judged if each.group == 'left out']
    if developed:
        for place in (0, 1):
            f1 = median(each.f1[place][1] for each in developed)
            goals.append(Goal(f'Development surfaces, {CHECKS[place].name}: median F1', f1, 0.96))
    if apart:
        five = [each.f1[1][1] for each in apart]
        removed = [each.removed[1] for each in apart]
        goals += [
            Goal(f'{len(apart)} surfaces left out, 5 %: median F1', median(five), 0.94),
            Goal('The same: worst F1', min(five), 0.80),
            Goal('The same at 1 %: median F1', median(each.f1[2][1] for each in apart), 0.88),
            Goal('The same at 30 %: median F1', median(each.f1[3][1] for each in apart), 0.92),
            Goal('The same, untouched: plausible points removed, median', median(removed), 0.0005, False, '.3%'),
            Goal('The same: plausible points removed, worst', max(removed), 0.003, False, '.3%'),
        ]
    return goals


def _time_goal(judge: NetworkJudge, repeats: int) -> Goal:
    """Time of rules and network, as a multiple of the rules' in the same run."""
    random = np.random.default_rng(1)
    heights = random.normal(size=_TIMED).astype(np.float32)
    times = [min(repeated_ms(call, repeats)) for call in _calls(judge, heights)]
    quantity = 'Time of both as a multiple of the rules’, 1280×960'
    return Goal(quantity, times[0] / times[1], 1.2, at_least=False, form='.2f')


def _calls(judge: NetworkJudge, heights: NDArray[np.float32]) -> list[Callable[[], object]]:
    return [
        lambda: find_outliers(heights, likelihood=judge.probabilities),
        lambda: find_outliers(heights),
    ]


def _pictures(judged: Sequence[Judged], progress: Callable[[str], None]) -> list[Picture]:
    """The clouds with the lowest F1 at 5 % irregular outliers: those left out, then the others."""
    order = sorted(judged, key=lambda each: (each.group != 'left out', each.f1[1][1]))
    pictures = []
    for each in order[:PICTURES]:
        progress(f'{each.name}: picture')
        made, found = each.worst
        pictures.append(
            Picture(
                f'learned_{each.name}',
                drawings.judged(made, found),
                f'{each.name} ({each.group}), 5 % irregular outliers: F1 {each.f1[1][1]:.3f}, rules'
                f' {each.f1[1][0]:.3f}; untouched {each.removed[1]:.2%} removed. The part with most errors.',
            )
        )
    return pictures
