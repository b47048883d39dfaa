# SPDX-License-Identifier: Apache-2.0
"""The network and the rules of the adaptive mode on the same whole surfaces with the same outliers."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import median
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.circle.adaptive import AdaptiveResult, find_outliers, find_probable_outliers
from socialcircle_ros.circle.network import NetworkJudge
from socialcircle_ros.report.content import Cell, Column, Picture, Section, Table
from socialcircle_ros.studies.adaptive.goals import Goal, goals_section
from socialcircle_ros.studies.adaptive.inserted_outliers import (
    OutlierShapes,
    StudiedSurface,
    insert_outliers,
)
from socialcircle_ros.studies.comparison.study import Study
from socialcircle_ros.studies.steps import Step, rows_of
from socialcircle_ros.studies.timing import elapsed_ms
from socialcircle_ros.studies.workload import DETECTION, DRAWING, INSERTION, NETWORK, million_points

from . import drawings
from .scenes import HEIGHTS, SCENES, SIDES, scenes, squares
from .surfaces import DEVELOPMENT, HELD_OUT, SurfaceFile, read_surface, surface_files
from .visible import SHARES, visible

PICTURES = 10
"""Clouds drawn: those that the network judges worst."""
JUDGES = ('rules', 'network')
_TIMED = (960, 1280)
_SURFACES = 'learned_surfaces'


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
    """

    name: str
    group: str
    f1: list[list[float]]
    removed: list[float]
    nearly: float


def learned(study: Study, folder: Path, judge: NetworkJudge, *, quick: bool = False) -> list[Step]:
    """Compare the network with the rules: surfaces, goals, time, and the worst clouds.

    Args:
        study: its seeds give the outliers; medians are over them.
        folder: of measured surfaces, with its subfolder `training/`.
        judge: the network.
        quick: only the first surface.
    """
    files = surface_files(folder)[: 1 if quick else None]
    masks = len(CHECKS) * len(study.plan.seeds) + 1
    per_point = masks * (DETECTION + NETWORK + INSERTION)
    find = partial(_found, judge=judge)
    seeds = len(study.plan.seeds)
    small = million_points(study.plan.small_size) * (DETECTION + NETWORK)
    timed = 1 + sum(file.path.stem in DEVELOPMENT for file in files)
    timing = timed * (1 + study.plan.repeats) * million_points(_TIMED) * (DETECTION + NETWORK)
    with_goals = sum(file.points for file in files if _has_goals(file)) / 1e6
    visible_cost = (len(SHARES) + 1) * seeds * with_goals * (NETWORK + INSERTION)
    return [
        *(
            Step(
                f'learned_{file.path.stem}',
                per_point * file.points / 1e6,
                partial(_surface, study, file.path, judge),
            )
            for file in files
        ),
        Step('learned_scenes', 3 * len(SCENES) * seeds * small, lambda _: scenes(study, find)),
        Step('learned_squares', 2 * len(SIDES) * len(HEIGHTS) * seeds * small, lambda _: squares(study, find)),
        Step('learned_visible', visible_cost, partial(_visible, study, files, judge)),
        Step('learned_goals', timing, partial(_conclusion, study, files, judge)),
        Step('learned_worst', PICTURES * DRAWING, partial(_worst, study, files, judge)),
    ]


def _surface(study: Study, path: Path, judge: NetworkJudge, _: Sequence[Section]) -> list[Section]:
    study.progress(f'{path.stem}: rules and network')
    judged = _judged(read_surface(path), judge, study.plan.seeds)
    surfaces = _columns([Column('surface'), Column('group')])
    scores = [value for values in judged.f1 for value in values]
    row: list[Cell] = [judged.name, judged.group, *scores, *judged.removed, judged.nearly]
    text = (
        'Outliers are put into whole surfaces by two generators that the network was never trained on: `ellipses`'
        ' is `simulation.add_outliers`, `irregular` is `add_irregular_outliers`. Points of the untouched surface'
        f' beyond 10 robust σ of its 11×11 median are not counted. Medians over {len(study.plan.seeds)} seeds.'
        ' "Left out" are surfaces of instruments that these weights were not trained on: '
        + '; '.join(f'{name} ({instrument})' for name, instrument in HELD_OUT.items())
        + '.'
    )
    table = Table(_SURFACES, 'Each surface', [*surfaces, Column('untouched: nearly outliers', '.1%')], [row])
    return [Section('Surfaces', [text], items=[table])]


def _has_goals(file: SurfaceFile) -> bool:
    """Whether a surface is one of those that the goals are about."""
    return file.path.stem in HELD_OUT or file.path.stem in DEVELOPMENT


def _visible(
    study: Study, files: Sequence[SurfaceFile], judge: NetworkJudge, _: Sequence[Section]
) -> list[Section]:
    """What of the outliers stands out, on the surfaces that the goals are about."""
    groups: dict[str, list[StudiedSurface]] = {}
    for file in filter(_has_goals, files):
        groups.setdefault(_group(file.path.stem), []).append(read_surface(file.path))
    if not groups:
        return []
    return visible(
        study,
        groups,
        lambda heights: find_probable_outliers(heights.astype(np.float32), judge.probabilities).outliers,
    )


def _conclusion(
    study: Study, files: Sequence[SurfaceFile], judge: NetworkJudge, made: Sequence[Section]
) -> list[Section]:
    """The goals, medians over the surfaces, and times."""
    times = []
    for name, heights in _timed_clouds(files, study.plan.seeds[-1]):
        study.progress(f'timing: {name}')
        times.append(_times(judge, name, heights, study.plan.repeats))
    judged = _judged_rows(made)
    goals = [*_goals(judged), _time_goal(times)]
    items = [_summary(judged), _times_table(times)]
    return [goals_section('learned_goals', goals), Section('All surfaces', items=items)]


class _Row(NamedTuple):
    """A row of the table of surfaces; the numbers are in the order of its columns."""

    name: str
    group: str
    values: list[float]

    def f1(self, check: int, judge: int) -> float:
        return self.values[check * len(JUDGES) + judge]

    def removed(self, judge: int) -> float:
        return self.values[len(CHECKS) * len(JUDGES) + judge]


def _judged_rows(made: Sequence[Section]) -> list[_Row]:
    return [
        _Row(str(name), str(group), [float(value or 0) for value in values])
        for name, group, *values in rows_of(made, _SURFACES)
    ]


def _judged(surface: StudiedSurface, judge: NetworkJudge, seeds: Sequence[int]) -> Judged:
    f1 = []
    for check in CHECKS:
        scores = []
        for seed in seeds:
            made = insert_outliers(surface, check.share, seed, check.shapes)
            scores.append([made.score(each.outliers).f1 for each in _found(made.points[..., 2], judge)])
        f1.append([median(column) for column in zip(*scores, strict=True)])
    untouched = _found(surface.cloud.points[..., 2], judge)
    removed = [float(each.outliers[surface.plausible].mean()) for each in untouched]
    name = surface.cloud.name
    return Judged(name, _group(name), f1, removed, untouched[0].nearly)


def _found(heights: NDArray[np.floating], judge: NetworkJudge) -> list[AdaptiveResult]:
    """What each judge finds, in the order of `JUDGES`."""
    heights = heights.astype(np.float32)
    return [find_outliers(heights), find_probable_outliers(heights, judge.probabilities)]


def _group(name: str) -> str:
    if name in HELD_OUT:
        return 'left out'
    return 'development' if name in DEVELOPMENT else 'training'


def _columns(first: Sequence[Column]) -> list[Column]:
    checks = [Column(f'{check.name}: {judge}', '.3f') for check in CHECKS for judge in JUDGES]
    return [*first, *checks, *(Column(f'untouched: {judge}', '.3%') for judge in JUDGES)]


def _summary(judged: Sequence[_Row]) -> Table:
    """Median and worst surface of each group."""
    rows: list[list[Cell]] = []
    count_f1 = len(CHECKS) * len(JUDGES)
    for group in ('left out', 'development', 'training'):
        members = [each.values for each in judged if each.group == group]
        if not members:
            continue
        columns = list(zip(*members, strict=True))
        scores, removed = columns[:count_f1], columns[count_f1 : count_f1 + len(JUDGES)]
        rows.append([f'{group}, {len(members)}: median', *map(median, scores), *map(median, removed)])
        rows.append([f'{group}, {len(members)}: worst', *map(min, scores), *map(max, removed)])
    return Table('learned_summary', 'F1 and removed points', _columns([Column('surfaces')]), rows)


def _goals(judged: Sequence[_Row]) -> list[Goal]:
    """The goals that were set for the network."""
    goals = []
    developed = [each for each in judged if each.group == 'development']
    apart = [each for each in judged if each.group == 'left out']
    if developed:
        for place in (0, 1):
            f1 = median(each.f1(place, 1) for each in developed)
            goals.append(Goal(f'Development surfaces, {CHECKS[place].name}: median F1', f1, 0.96))
    if apart:
        five = [each.f1(1, 1) for each in apart]
        removed = [each.removed(1) for each in apart]
        goals += [
            Goal(f'{len(apart)} surfaces left out, 5 %: median F1', median(five), 0.94),
            Goal('The same: worst F1', min(five), 0.80),
            Goal('The same at 1 %: median F1', median(each.f1(2, 1) for each in apart), 0.88),
            Goal('The same at 30 %: median F1', median(each.f1(3, 1) for each in apart), 0.92),
            Goal('The same, untouched: plausible points removed, median', median(removed), 0.0005, False, '.3%'),
            Goal('The same: plausible points removed, worst', max(removed), 0.003, False, '.3%'),
        ]
    return goals


class _CloudTimes(NamedTuple):
    """Median times of the judges on one cloud, in the order of `JUDGES`.

    Attributes:
        name: of the surface.
        ms: wall times.
    """

    name: str
    ms: list[float]

    @property
    def ratio(self) -> float:
        """Time of the network as a multiple of that of the rules."""
        return self.ms[1] / self.ms[0]


def _times(judge: NetworkJudge, name: str, heights: NDArray[np.float32], repeats: int) -> _CloudTimes:
    """Measure the judges in turns: on a shared machine a slow minute is then one of both."""
    calls = _calls(judge, heights)
    for call in calls:
        call()
    rounds = [[elapsed_ms(call) for call in calls] for _ in range(repeats)]
    return _CloudTimes(name, [median(column) for column in zip(*rounds, strict=True)])


def _timed_clouds(files: Sequence[SurfaceFile], seed: int) -> Iterator[tuple[str, NDArray[np.float32]]]:
    """The development surfaces with irregular outliers, mirrored and cut to 1280×960 points; and white noise."""
    check = CHECKS[1]
    for file in files:
        if file.path.stem in DEVELOPMENT:
            made = insert_outliers(read_surface(file.path), check.share, seed, check.shapes)
            heights = made.points[..., 2].astype(np.float32)
            beyond = [(0, max(0, wanted - size)) for wanted, size in zip(_TIMED, heights.shape, strict=True)]
            mirrored = np.pad(heights, beyond, mode='symmetric')
            yield file.path.stem, np.ascontiguousarray(mirrored[: _TIMED[0], : _TIMED[1]])
    yield 'white noise', np.random.default_rng(1).normal(size=_TIMED).astype(np.float32)


def _time_goal(times: Sequence[_CloudTimes]) -> Goal:
    """Time of the network as a multiple of that of the rules: the median of the development surfaces."""
    developed = [each.ratio for each in times if each.name in DEVELOPMENT] or [times[-1].ratio]
    quantity = 'Time of the network as a multiple of that of the rules, 1280×960'
    return Goal(quantity, median(developed), 1.2, at_least=False, form='.2f')


def _times_table(times: Sequence[_CloudTimes]) -> Table:
    columns = [Column('cloud of 1280×960 points'), *(Column(f'{judge}, ms', '.0f') for judge in JUDGES)]
    rows: list[list[Cell]] = [[each.name, *each.ms, each.ratio] for each in times]
    return Table('learned_times', 'Wall time, medians in turns', [*columns, Column('ratio', '.2f')], rows)


def _calls(judge: NetworkJudge, heights: NDArray[np.float32]) -> list[Callable[[], object]]:
    return [
        lambda: find_outliers(heights),
        lambda: find_probable_outliers(heights, judge.probabilities),
    ]


def _worst(
    study: Study, files: Sequence[SurfaceFile], judge: NetworkJudge, made: Sequence[Section]
) -> list[Section]:
    """The clouds with the lowest F1 at 5 % irregular outliers: those left out, then the others."""
    judged = _judged_rows(made)
    paths = {file.path.stem: file.path for file in files}
    pictures = []
    check = CHECKS[1]
    for each in sorted(judged, key=lambda each: (each.group != 'left out', each.f1(1, 1)))[:PICTURES]:
        study.progress(f'{each.name}: picture')
        surface = read_surface(paths[each.name])
        cloud = insert_outliers(surface, check.share, study.plan.seeds[-1], check.shapes)
        found = _found(cloud.points[..., 2], judge)[1].outliers
        pictures.append(
            Picture(
                f'learned_{each.name}',
                drawings.judged(cloud, surface.cloud.unit, found),
                f'{each.name} ({each.group}), {check.name}: F1 {each.f1(1, 1):.3f}, rules {each.f1(1, 0):.3f};'
                f' untouched {each.removed(1):.2%} removed. The part with most errors.',
            )
        )
    return [Section('Worst clouds', items=pictures)]
