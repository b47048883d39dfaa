# SPDX-License-Identifier: Apache-2.0
"""Robustness: scenes without outliers, ambiguous clouds, and clouds in other units."""

from collections.abc import Iterator
from statistics import median

import numpy as np

from socialcircle_ros.circle import CircleResult
from socialcircle_ros.circle.region import choose_region
from socialcircle_ros.cloud import Mask
from socialcircle_ros.metrics.scores import Scores
from socialcircle_ros.report.content import Cell, Column, Section, Table
from socialcircle_ros.simulation import make_scene
from socialcircle_ros.studies.comparison.labelled_clouds import LabelledCloud, OutlierKind, synthetic_cloud
from socialcircle_ros.studies.comparison.study import Study

from .detection import detect
from .goals import GOALS, Goal, goals_section

_SCENES = ('quantised', 'islands', 'discs', 'closed_groove', 'steep_groove', 'steps')
_REPEATS = 5
_MOST_FALSE_POSITIVES, _LEAST_RECALL = 0.005, 0.9
_CORRECT, _WARNED, _WRONG = 'correct', 'warned', 'wrong without a warning'
_UNITS: tuple[tuple[str, tuple[float, float, float]], ...] = (
    ('z · 10⁻³', (1, 1, 1e-3)),
    ('z · 10³', (1, 1, 1e3)),
    ('z · 2⁻¹⁰', (1, 1, 2**-10)),
    ('z · 2¹⁰', (1, 1, 2**10)),
    ('x, y · 7.3', (7.3, 7.3, 1)),
    ('x · 0.01', (0.01, 1, 1)),
)


def outlier_free_scenes(study: Study) -> list[Section]:
    """Filter simulated scenes that have no outliers, but structures that resemble them."""
    rows: list[list[Cell]] = []
    seeds = study.plan.seeds[:_REPEATS]
    for scene in _SCENES:
        study.progress(f'{scene}: no outliers')
        clouds = [make_scene(scene, *study.plan.small_size, seed=seed, share=0.0).points for seed in seeds]
        removed = [float(detect(points).outliers.mean()) for points in clouds]
        rows.append([scene, median(removed), max(removed)])
    worst = max(rows, key=lambda row: float(row[2] or 0))
    goal = Goal(
        f'Points removed, worst scene without outliers ({worst[0]})',
        float(worst[2] or 0),
        0.005,
        at_least=False,
        form='.2%',
    )
    columns = [Column('scene'), Column('removed, median', '.3%'), Column('most', '.3%')]
    table = Table('adaptive_breaking', f'Scenes without outliers; {len(seeds)} seeds', columns, rows)
    text = 'Every removed point is a false positive.'
    return [Section('Scenes without outliers', [text], items=[table]), goals_section(GOALS, [goal])]


def ambiguous_clouds(study: Study) -> list[Section]:
    """Filter clouds that are hard to decide: the result must be correct, or come with a warning."""
    rows: list[list[Cell]] = []
    for name, cloud in _ambiguous(study.plan.small_size, study.plan.seeds[0]):
        study.progress(name)
        result = detect(cloud.points)
        scores = cloud.score(result.outliers)
        recall = scores.recall if cloud.outlier.any() else None
        rows.append([name, recall, scores.false_positive_rate, _decision(result, scores)])
    wrong = sum(row[3] == _WRONG for row in rows)
    goal = Goal(f'Ambiguous clouds, of {len(rows)}: {_WRONG}', wrong, 0, at_least=False, form='.0f')
    columns = [Column('cloud'), Column('recall', '.3f'), Column('false positives', '.2%'), Column('result')]
    text = (
        f'A result is correct if at most {_MOST_FALSE_POSITIVES:.1%} of the good points and at least'
        f' {_LEAST_RECALL:.0%} of the outliers, where there are any, are removed. Other results must come with a'
        ' warning.'
    )
    table = Table('adaptive_decisions', 'Ambiguous clouds', columns, rows)
    return [Section('Ambiguous clouds', [text], items=[table]), goals_section(GOALS, [goal])]


def _decision(result: CircleResult, scores: Scores) -> str:
    # Recall is NaN without outliers, and NaN is not below the bound.
    if scores.false_positive_rate <= _MOST_FALSE_POSITIVES and not scores.recall < _LEAST_RECALL:
        return _CORRECT
    return _WARNED if result.warnings else _WRONG


def _ambiguous(size: tuple[int, int], seed: int) -> Iterator[tuple[str, LabelledCloud]]:
    """A cluster in the vote region, steps that belong to the surface, and heavy contamination."""
    flat = synthetic_cloud('flat', size, seed, share=0.0)
    sigma = float(np.nanstd(flat.points[..., 2] - flat.z_true))
    top, left, height, width = choose_region(flat.points)
    rows, columns = np.ogrid[: size[0], : size[1]]
    middle_row, middle_column = top + height // 2, left + width // 2
    cluster = (rows - middle_row) ** 2 + (columns - middle_column) ** 2 <= 8**2
    patch = (abs(rows - middle_row) < height // 3) & (abs(columns - middle_column) < width // 3)
    half = np.broadcast_to(columns >= size[1] // 2, size)
    none = np.zeros(size, np.bool_)
    yield (
        'cluster of 8 points radius in the middle of the vote region',
        _raised(flat, cluster, 30 * sigma, cluster),
    )
    yield 'patch with a step in the vote region', _raised(flat, patch, 30 * sigma, none)
    yield 'two plateaus', _raised(flat, half, 50 * sigma, none)
    kinds: tuple[OutlierKind, ...] = ('isolated', 'clustered')
    for kind in kinds:
        yield f'45 % {kind} outliers', synthetic_cloud('metal_groove', size, seed, kind, 0.45)


def _raised(flat: LabelledCloud, where: Mask, step: float, outlier: Mask) -> LabelledCloud:
    """The cloud with some points raised by a step, and the mask of those that are outliers."""
    points = flat.points.copy()
    points[where, 2] += step
    measured = np.isfinite(points[..., 2])
    return LabelledCloud(flat.title, points, outlier & measured, measured, flat.z_true, flat.pitch, {})


def changed_units(study: Study) -> list[Section]:
    """Count the points of the mask that change when the same cloud is given in another unit."""
    study.progress('other units')
    points = synthetic_cloud('flat', study.plan.small_size, study.plan.seeds[0]).points
    plain = detect(points).outliers
    rows: list[list[Cell]] = []
    for name, factors in _UNITS:
        changed = np.count_nonzero(detect(points * np.array(factors, np.float32)).outliers != plain)
        rows.append([name, int(changed), changed / plain.size])
    most = max(float(row[1] or 0) for row in rows)
    goal = Goal('Points of the mask that change in another unit of z, x or y', most, 0, at_least=False, form='.0f')
    text = 'A factor that is a power of two changes no digit; the other factors round each coordinate.'
    columns = [Column('unit'), Column('points that change', 'd'), Column('share', '.4%')]
    table = Table('adaptive_scales', 'The same cloud in other units', columns, rows)
    return [Section('Units', [text], items=[table]), goals_section(GOALS, [goal])]
