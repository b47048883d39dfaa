# SPDX-License-Identifier: Apache-2.0
"""Figures 4, 8, 10 and 11 of the paper, on clouds of known truth."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Literal

import numpy as np

from socialcircle_ros.circle.region import SIDE, choose_region
from socialcircle_ros.circle.seed import elect_seed
from socialcircle_ros.cloud import HeightMap, Mask
from socialcircle_ros.metrics.areal import texture
from socialcircle_ros.metrics.scores import rmse
from socialcircle_ros.repair import repair_holes
from socialcircle_ros.report.content import Cell, Column, Picture, Section, Table
from socialcircle_ros.settings import RepairMethod, RepairSettings
from socialcircle_ros.studies.comparison.drawings import removal_maps
from socialcircle_ros.studies.comparison.labelled_clouds import (
    TITLES,
    LabelledCloud,
    OutlierKind,
    synthetic_cloud,
)
from socialcircle_ros.studies.comparison.methods import SETTINGS_TYPES, Method
from socialcircle_ros.studies.comparison.plotting import PlotRegion
from socialcircle_ros.studies.comparison.study import Study
from socialcircle_ros.studies.steps import Step, rows_of
from socialcircle_ros.studies.workload import DRAWING, ELECTION, METHODS, REPAIRS, SYNTHETIC, million_points

from . import drawings

_LOW_SHARE, _HIGH_SHARE = 0.02, 0.45
_RegionChoice = Literal['chosen', 'anywhere']
_CHOICES: tuple[_RegionChoice, ...] = ('chosen', 'anywhere')
_FIGURE_4 = 'Figure 4: is the elected seed a good point?'
_REPAIRS: tuple[RepairMethod, ...] = ('spline', 'biharmonic')
_REPAIR_NAMES = {'spline': 'spline (the paper’s)', 'biharmonic': 'biharmonic'}
_COMPLETE = 0.95
"""Share of the points that must have a height before RMSE is taken as that of the whole surface."""


@dataclass(frozen=True)
class _Election:
    """A cloud, its vote region, and row and column of the elected seed."""

    cloud: LabelledCloud
    region: PlotRegion
    seed: tuple[int, int]

    @property
    def is_good(self) -> bool:
        """Whether the seed is a good point."""
        return bool(self.cloud.counted[self.seed] and not self.cloud.outlier[self.seed])

    @property
    def share(self) -> float:
        """Share of outliers in the vote region."""
        return float(self.cloud.outlier[self.region].mean())


def figure4(study: Study) -> list[Step]:
    """Test whether the elected seed is a good point, with few and with many outliers in the vote region."""
    plan = study.plan
    elections = plan.elections * len(tuple(_conditions()))
    work = elections * million_points(plan.small_size) * (SYNTHETIC + ELECTION)
    scenes = [Step(f'figure4_{scene}', work, partial(_elections, study, scene)) for scene in TITLES]
    return [*scenes, Step('figure4_findings', 0.0, _seed_findings)]


def _conditions() -> Iterator[tuple[OutlierKind, float, _RegionChoice]]:
    kinds: tuple[OutlierKind, ...] = ('isolated', 'clustered')
    return product(kinds, (_LOW_SHARE, _HIGH_SHARE), _CHOICES)


def _elections(study: Study, scene: str, _: Sequence[Section]) -> list[Section]:
    rows: list[list[Cell]] = []
    panels = []
    for kind, share, choice in _conditions():
        study.progress(f'{scene}: electing seeds among {100 * share:g} % {kind} outliers, region {choice}')
        held = [
            _election(scene, study.plan.small_size, study.plan.seeds[0] + number, kind, share, choice)
            for number in range(study.plan.elections)
        ]
        if (scene, kind, choice) == ('metal_groove', 'clustered', 'anywhere'):
            first = held[0]
            title = f'{100 * first.share:.1f} % outliers: the seed is {"good" if first.is_good else "an outlier"}'
            panels.append((title, first.cloud, first.region, first.seed))
        mean_share = float(np.mean([each.share for each in held]))
        rows.append(
            [TITLES[scene], kind, share, choice, mean_share, sum(each.is_good for each in held), len(held)]
        )
    columns = [
        Column('scene'), Column('outliers'), Column('share in the cloud', '.0%'), Column('vote region'),
        Column('share in the region', '.1%'), Column('good seeds', 'd'), Column('of', 'd'),
    ]  # fmt: skip
    text = (
        'The paper states that the point with the most votes is always a good point. In each row, clouds of'
        f' different seeds elect a seed in a region of {SIDE}×{SIDE} points. "chosen": the filter chooses the'
        ' smoothest, most completely measured region, its default. "anywhere": the region is random.'
    )
    caption = (
        'As the paper’s figure 4: a vote region with few and with many outliers, and the elected seed (metal'
        ' groove, clustered outliers, random region).'
    )
    pictures = [Picture('figure4', drawings.elections(panels), caption)] if panels else []
    table = Table('figure4', 'Elections in which the seed is a good point', columns, rows)
    return [Section(_FIGURE_4, [text], items=[*pictures, table])]


def _seed_findings(made: Sequence[Section]) -> list[Section]:
    rows = rows_of(made, 'figure4')
    return [Section(_FIGURE_4, findings=[_seed_finding(rows, choice) for choice in _CHOICES])]


def _election(
    scene: str, size: tuple[int, int], seed: int, kind: OutlierKind, share: float, choice: _RegionChoice
) -> _Election:
    cloud = synthetic_cloud(scene, size, seed, kind, share)
    if choice == 'chosen':
        region = choose_region(cloud.points)
    else:
        random = np.random.default_rng(seed)
        top, left = (int(random.integers(extent - SIDE)) for extent in cloud.outlier.shape)
        region = top, left, SIDE, SIDE
    top, left, height, width = region
    return _Election(
        cloud, (slice(top, top + height), slice(left, left + width)), elect_seed(cloud.points, region)
    )


def _seed_finding(rows: Sequence[Sequence[Cell]], choice: _RegionChoice) -> str:
    """In how many elections the seed is a good point."""
    parts = []
    for share in (_LOW_SHARE, _HIGH_SHARE):
        counts = [(row[5], row[6]) for row in rows if row[3] == choice and row[2] == share]
        good, total = (sum(int(pair[i] or 0) for pair in counts) for i in (0, 1))
        parts.append(f'{good} of {total} elections at {100 * share:g} % outliers')
    region = 'Vote region chosen by the filter' if choice == 'chosen' else 'Random vote region'
    return f'{region}: the elected seed is a good point in {parts[0]}, and in {parts[1]}.'


def figure8(study: Study) -> list[Step]:
    """Draw what each filter keeps and removes, at its default and at its best settings."""
    steps = []
    for scene, from_stack in study.plan.scenes:
        work = study.search_work(scene, from_stack=from_stack) + len(study.plan.drawn_variants) * DRAWING
        work += study.clouds_work(from_stack=from_stack, per_cloud=METHODS) / len(study.plan.seeds)
        key = f'figure8_{scene}{"_stack" if from_stack else ""}'
        steps.append(Step(key, work, partial(_removals, study, scene, from_stack)))
    return steps


def _removals(study: Study, scene: str, from_stack: bool, _: Sequence[Section]) -> list[Section]:
    methods = study.methods(scene, from_stack=from_stack)
    study.progress(f'{scene}: drawing what each filter removed')
    cloud = study.cloud(scene, study.plan.seeds[0], from_stack=from_stack)
    pictures = []
    for variant in study.plan.drawn_variants:
        found = [(each.label, each(cloud.points).outliers) for each in methods if each.variant == variant]
        pictures.append(
            Picture(
                f'figure8_{scene}{"_stack" if from_stack else ""}_{variant}',
                removal_maps(cloud, found),
                f'{cloud.title}, {variant} settings. Above: the heights that remain; points that are removed or'
                ' not measured are orange. Below: the framed part, which has most outliers, and the decisions of'
                ' each filter there.',
            )
        )
    return [Section('Figure 8: what each filter removes', items=pictures)]


def figure10(study: Study) -> list[Step]:
    """Filter and repair the metal groove, and the steep groove that the exact mode cannot climb."""
    return [
        _repair_step(study, 'metal_groove', 'Figure 10: the metal groove, filtered and repaired'),
        _repair_step(study, 'steep_groove', 'Beyond figure 10: the steep groove, filtered and repaired'),
    ]


def figure11(study: Study) -> list[Step]:
    """Filter and repair the composite material."""
    return [_repair_step(study, 'composite', 'Figure 11: the composite material, filtered and repaired')]


def _repair_step(study: Study, scene: str, heading: str) -> Step:
    repairs = 2 * len(SETTINGS_TYPES) * REPAIRS  # at default and at best settings
    work = study.search_work(scene) + study.clouds_work(per_cloud=METHODS + repairs) + DRAWING
    return Step(f'repaired_{scene}', work, lambda _: [_repaired(study, scene, heading)])


def _repaired(study: Study, scene: str, heading: str) -> Section:
    """Filter one scene with each method and repair it: quality of the surfaces, and their pictures."""
    methods = study.methods(scene)
    clouds = study.clouds(scene)
    rows: list[list[Cell]] = [['nothing', 'none', *_mean_quality([cloud.points for cloud in clouds], clouds)]]
    drawn: list[tuple[str, HeightMap]] = []
    for each in methods:
        study.progress(f'{scene}: repairing after {each.label}')
        found = [each(cloud.points).outliers for cloud in clouds]
        for repair in _REPAIRS:
            filled = [
                _filled(cloud, outliers, RepairSettings(method=repair))
                for cloud, outliers in zip(clouds, found, strict=True)
            ]
            rows.append([each.label, _REPAIR_NAMES[repair], *_mean_quality(filled, clouds)])
            if _is_drawn(each, repair):
                drawn.append((f'{each.label}\n{_REPAIR_NAMES[repair]}', filled[0][..., 2]))
    study.progress(f'{scene}: drawing the repaired surfaces')
    name = f'repaired_{scene}'
    caption = (
        f'{TITLES[scene]}: the part with most outliers, filtered at the best settings and repaired. White: no'
        ' height. Below: distance to the true surface on a logarithmic scale.'
    )
    return Section(
        heading,
        findings=[_repair_finding(TITLES[scene], rows)],
        items=[
            Picture(name, drawings.repaired_surfaces(clouds[0], drawn), caption),
            _quality_table(name, f'{TITLES[scene]}, filtered and repaired', rows),
        ],
    )


def _quality_table(name: str, title: str, rows: Sequence[Sequence[Cell]]) -> Table:
    columns = [
        Column('filter'), Column('repair'), Column('RMSE [µm]', '.3f'), Column('points with a height', '.2%'),
        *(Column(f'{parameter} change', '+.2%') for parameter in ('Sa', 'Sq', 'Sz')),
    ]  # fmt: skip
    note = (
        'RMSE: heights after filtering and repair against the true surface, where there is a height. Holes of more'
        ' than 1000 points, and holes without a rim on three sides, stay empty; read RMSE together with the share'
        ' of points with a height. Sa, Sq, Sz: ISO 25178-2 after levelling, relative to the true surface. All of'
        ' them include measurement noise.'
    )
    return Table(name, title, columns, rows, note)


def _is_drawn(each: Method, repair: RepairMethod) -> bool:
    """Whether the picture shows it: all filters with the paper's repair, the social circle with both repairs."""
    return each.variant == 'best' and (repair == 'spline' or each.name == 'Social circle')


def _filled(cloud: LabelledCloud, outliers: Mask, settings: RepairSettings) -> HeightMap:
    """The cloud (H, W, 3) without the removed outliers, with its holes filled where the settings allow."""
    cleaned = cloud.points.copy()
    cleaned[outliers, 2] = np.nan
    filled: HeightMap = repair_holes(cleaned, ~np.isfinite(cleaned[..., 2]), settings).xyz
    return filled


def _mean_quality(surfaces: Sequence[HeightMap], clouds: Sequence[LabelledCloud]) -> list[Cell]:
    """RMSE, share of points with a height, and relative change of Sa, Sq and Sz; means over the clouds."""
    quality = []
    for points, cloud in zip(surfaces, clouds, strict=True):
        z = points[..., 2]
        now, true = texture(z), texture(cloud.z_true)
        changes = [now.sa / true.sa - 1, now.sq / true.sq - 1, now.sz / true.sz - 1]
        quality.append([rmse(z, cloud.z_true), float(np.isfinite(z).mean()), *changes])
    return [float(value) for value in np.mean(quality, axis=0)]


def _repair_finding(title: str, rows: Sequence[Sequence[Cell]]) -> str:
    """The rank by RMSE of the social circle with the paper's repair, and its RMSE with the biharmonic repair."""
    spline = [row for row in rows if row[1] == _REPAIR_NAMES['spline']]
    ours = next(row for row in spline if row[0] == 'Social circle, default')
    biharmonic = next(row for row in rows if row[0] == ours[0] and row[1] == _REPAIR_NAMES['biharmonic'])
    complete = sorted((row for row in spline if _number(row[3]) >= _COMPLETE), key=lambda row: _number(row[2]))
    lowest = f' The lowest RMSE is {complete[0][2]:.3f} µm ({complete[0][0]}).' if complete else ''
    head = f'{title}, social circle at default settings, repaired with the paper’s spline:'
    if ours not in complete:
        return (
            f'{head} {_number(ours[3]):.1%} of the points have a height, so the surface is incomplete.'
            f' {len(complete)} of {len(spline)} methods leave at least {_COMPLETE:.0%}.{lowest}'
        )
    return (
        f'{head} RMSE {ours[2]:.3f} µm, rank {complete.index(ours) + 1} of the {len(complete)} methods that leave'
        f' at least {_COMPLETE:.0%} of the points with a height.{lowest} With the biharmonic repair RMSE is'
        f' {biharmonic[2]:.3f} µm.'
    )


def _number(cell: Cell) -> float:
    return float(cell or 0)
