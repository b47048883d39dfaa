# SPDX-License-Identifier: Apache-2.0
"""The network and the rules on what every user expects: simulated scenes, and squares far off a plain surface."""

from collections.abc import Callable, Sequence
from statistics import median

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.circle.adaptive import AdaptiveResult
from socialcircle_ros.report.content import Cell, Column, Section, Table
from socialcircle_ros.simulation import make_scene
from socialcircle_ros.studies.comparison.labelled_clouds import OutlierKind, synthetic_cloud
from socialcircle_ros.studies.comparison.study import Study

SCENES = ('flat', 'metal_groove', 'quantised', 'islands', 'discs', 'closed_groove', 'steep_groove', 'steps')
SIDES = (1, 3, 6, 10, 16)
HEIGHTS = (10.0, 20.0, 40.0, 100.0, 1000.0)
"""In standard deviations of the noise."""
_PLAIN, _PLACES = (120, 160), ((20, 30), (60, 100), (90, 40))
_KINDS: tuple[OutlierKind, ...] = ('isolated', 'clustered')

Finder = Callable[[NDArray[np.floating]], Sequence[AdaptiveResult]]
"""What the rules and the network find in heights."""


def scenes(study: Study, find: Finder) -> list[Section]:
    """Simulated scenes without outliers, and with 5 % of them."""
    rows: list[list[Cell]] = []
    for scene in SCENES:
        study.progress(f'{scene}: rules and network')
        row: list[Cell] = [scene]
        clouds = [
            make_scene(scene, *study.plan.small_size, seed=seed, share=0.0).points for seed in study.plan.seeds
        ]
        found = [find(points[..., 2]) for points in clouds]
        row += [max(float(each.outliers.mean()) for each in by) for by in zip(*found, strict=True)]
        for kind in _KINDS:
            scores = []
            for seed in study.plan.seeds:
                cloud = synthetic_cloud(scene, study.plan.small_size, seed, kind, 0.05)
                scores.append([cloud.score(each.outliers).f1 for each in find(cloud.points[..., 2])])
            row += [median(by) for by in zip(*scores, strict=True)]
        rows.append(row)
    columns = [Column('scene'), *_both('no outliers: removed', '.3%')]
    for kind in _KINDS:
        columns += _both(f'{kind} 5 %: F1', '.3f')
    table = Table('learned_scenes', 'Simulated scenes', columns, rows)
    return [Section('Simulated scenes', items=[table])]


def squares(study: Study, find: Finder) -> list[Section]:
    """Squares far off a surface of white noise: as rough as the surface, or flat."""
    study.progress('squares: rules and network')
    rows: list[list[Cell]] = []
    for flat in (False, True):
        for side in SIDES:
            for height in HEIGHTS:
                recalls = [_recall(find, side, height, seed, flat=flat) for seed in study.plan.seeds]
                kind = 'flat' if flat else 'as rough as the surface'
                rows.append([kind, side, height, *(median(by) for by in zip(*recalls, strict=True))])
    columns = [
        Column('squares'), Column('side, points', 'd'), Column('height, σ of the noise', '.0f'),
        *_both('found', '.0%'),
    ]  # fmt: skip
    text = 'Three squares of points stand far off a surface of white noise of 120×160 points.'
    return [Section('Squares', [text], items=[Table('learned_squares', 'Squares far off', columns, rows)])]


def _recall(find: Finder, side: int, height: float, seed: int, *, flat: bool) -> list[float]:
    heights = np.random.default_rng(seed).normal(size=_PLAIN).astype(np.float32)
    squares = np.zeros(_PLAIN, np.bool_)
    for row, column in _PLACES:
        squares[row : row + side, column : column + side] = True
    heights[squares] = height + (0 if flat else heights[squares])
    return [float(each.outliers[squares].mean()) for each in find(heights)]


def _both(quantity: str, form: str) -> list[Column]:
    return [Column(f'{quantity}, {judge}', form) for judge in ('rules', 'network')]
