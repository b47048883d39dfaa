# SPDX-License-Identifier: Apache-2.0
"""F1 of each filter from 2 to 45 % outliers: isolated, clustered, and clustered with blurred flanks."""

from collections.abc import Sequence
from functools import partial
from itertools import chain, product
from typing import get_args

import numpy as np

from socialcircle_ros.report.content import Cell, Column, Picture, Section, Table
from socialcircle_ros.studies.comparison.labelled_clouds import (
    PAPER_SCENES,
    TITLES,
    LabelledCloud,
    OutlierKind,
    synthetic_cloud,
)
from socialcircle_ros.studies.comparison.methods import SETTINGS_TYPES, Method, method, name_of
from socialcircle_ros.studies.comparison.search import best_settings
from socialcircle_ros.studies.comparison.study import Plan, Study
from socialcircle_ros.studies.steps import Step, rows_of
from socialcircle_ros.studies.workload import DRAWING, METHODS, SEARCH, SYNTHETIC, million_points

from . import drawings
from .verdicts import SAME_SHARE

_LABELS = [f'{name_of(each)}, {variant}' for each in SETTINGS_TYPES for variant in ('default', 'best')]


_TITLE = 'From 2 to 45 % outliers'
_KINDS: tuple[OutlierKind, ...] = tuple(kind for kind in get_args(OutlierKind) if kind != 'own')


def contaminations(study: Study) -> list[Step]:
    """Measure F1 of each filter for each scene, kind of outlier, and share of outliers; then draw the curves."""
    plan = study.plan
    points = million_points(plan.small_size)
    clouds = len(plan.seeds) + len(plan.search_seeds)
    searches = len(plan.search_seeds) * SEARCH + len(plan.seeds) * METHODS + clouds * SYNTHETIC
    work = len(plan.shares) * points * searches
    conditions = [
        Step(f'contamination_{scene}_{kind}', work, partial(_condition, study, scene, kind))
        for scene, kind in product(PAPER_SCENES, _KINDS)
    ]
    return [*conditions, Step('contamination_curves', DRAWING, partial(_curves_section, study))]


def _condition(study: Study, scene: str, kind: OutlierKind, _: Sequence[Section]) -> list[Section]:
    plan = study.plan
    rows: list[list[Cell]] = []
    for share in plan.shares:
        study.progress(f'{scene}: {100 * share:g} % {kind} outliers')
        rows.append([TITLES[scene], kind, share, *_mean_f1_of_methods(plan, scene, kind, share)])
    text = (
        f'Clouds of {plan.small_size[1]}×{plan.small_size[0]} points. Isolated outliers are single points.'
        ' Clustered outliers are clusters of 2 to 8 points radius that are displaced together, with sharp flanks.'
        ' The displacement of a blurred cluster rises over its whole radius, so that each point is close to the'
        ' next.'
    )
    columns = [
        Column('scene'),
        Column('outliers'),
        Column('share', '.0%'),
        *(Column(label, '.3f') for label in _LABELS),
    ]
    table = Table('contamination', 'F1 by scene, kind and share of outliers', columns, rows)
    return [Section(_TITLE, [text], items=[table])]


def _curves_section(study: Study, made: Sequence[Section]) -> list[Section]:
    rows = rows_of(made, 'contamination')
    caption = (
        'F1 against the share of outliers. Solid: best settings, searched for each point of the curve on other'
        ' seeds. Dashed: default settings.'
    )
    picture = Picture('contamination', drawings.contamination_curves(study.plan.shares, _curves(rows)), caption)
    return [Section(_TITLE, findings=[_finding(kind, rows) for kind in _KINDS], items=[picture])]


def _mean_f1_of_methods(plan: Plan, scene: str, kind: OutlierKind, share: float) -> list[float]:
    """Mean F1 of each filter at its default settings and at those that are best on the search seeds."""
    searched = [synthetic_cloud(scene, plan.small_size, seed, kind, share) for seed in plan.search_seeds]
    pairs = [(method(each(), 'default'), method(best_settings(each, searched), 'best')) for each in SETTINGS_TYPES]
    clouds = [synthetic_cloud(scene, plan.small_size, seed, kind, share) for seed in plan.seeds]
    return [_mean_f1(each, clouds) for each in chain(*pairs)]


def _mean_f1(each: Method, clouds: Sequence[LabelledCloud]) -> float:
    return float(np.mean([cloud.score(each(cloud.points).outliers).f1 for cloud in clouds]))


def _curves(rows: Sequence[Sequence[Cell]]) -> dict[tuple[str, str], dict[str, list[float]]]:
    """F1 over the shares: by scene and kind, then by label."""
    curves: dict[tuple[str, str], dict[str, list[float]]] = {}
    for scene, kind, _, *f1 in rows:
        curve = curves.setdefault((str(scene), str(kind)), {label: [] for label in _LABELS})
        for label, value in zip(_LABELS, f1, strict=True):
            curve[label].append(float(value or 0))
    return curves


def _finding(kind: str, rows: Sequence[Sequence[Cell]]) -> str:
    """In how many conditions the social circle has the highest F1, and the range of its F1."""
    scores = [[float(value or 0) for value in row[3:]] for row in rows if row[1] == kind]
    default, best = (sum(f1[own] >= max(f1[2:]) - SAME_SHARE for f1 in scores) for own in (0, 1))
    ours = [f1[0] for f1 in scores]
    return (
        f'{kind.capitalize()} outliers, {len(scores)} conditions, other filters at their best settings for'
        f' each: the social circle has the highest F1 (within {SAME_SHARE:g}) in {default} at its default settings'
        f' and in {best} at its best settings. At its default settings F1 is between {min(ours):.3f} and'
        f' {max(ours):.3f}.'
    )
