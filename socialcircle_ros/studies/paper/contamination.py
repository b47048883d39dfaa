# SPDX-License-Identifier: Apache-2.0
"""F1 of each filter from 2 to 45 % outliers: isolated, clustered, and clustered with blurred flanks."""

from collections.abc import Sequence
from dataclasses import dataclass
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

from . import drawings
from .verdicts import SAME_SHARE

_LABELS = [f'{name_of(each)}, {variant}' for each in SETTINGS_TYPES for variant in ('default', 'best')]


@dataclass(frozen=True)
class _Condition:
    """Mean F1 of the methods, in the order of `_LABELS`, on one scene with one kind and share of outliers."""

    scene: str
    kind: OutlierKind
    share: float
    f1: list[float]


def contaminations(study: Study) -> list[Section]:
    """Measure F1 of each filter for each scene, kind of outlier, and share of outliers."""
    plan = study.plan
    kinds: list[OutlierKind] = [kind for kind in get_args(OutlierKind) if kind != 'own']
    conditions = []
    for scene, kind, share in product(PAPER_SCENES, kinds, plan.shares):
        study.progress(f'{scene}: {100 * share:g} % {kind} outliers')
        conditions.append(_Condition(TITLES[scene], kind, share, _mean_f1_of_methods(plan, scene, kind, share)))
    text = (
        f'Clouds of {plan.small_size[1]}×{plan.small_size[0]} points. Isolated outliers are single points.'
        ' Clustered outliers are clusters of 2 to 8 points radius that are displaced together, with sharp flanks.'
        ' The displacement of a blurred cluster rises over its whole radius, so that each point is close to the'
        ' next.'
    )
    caption = (
        'F1 against the share of outliers. Solid: best settings, searched for each point of the curve on other'
        ' seeds. Dashed: default settings.'
    )
    columns = [
        Column('scene'),
        Column('outliers'),
        Column('share', '.0%'),
        *(Column(label, '.3f') for label in _LABELS),
    ]
    rows: list[list[Cell]] = [[each.scene, each.kind, each.share, *each.f1] for each in conditions]
    return [
        Section(
            'From 2 to 45 % outliers',
            [text],
            findings=[_finding(kind, [each for each in conditions if each.kind == kind]) for kind in kinds],
            items=[
                Picture('contamination', drawings.contamination_curves(plan.shares, _curves(conditions)), caption),
                Table('contamination', 'F1 by scene, kind and share of outliers', columns, rows),
            ],
        )
    ]


def _mean_f1_of_methods(plan: Plan, scene: str, kind: OutlierKind, share: float) -> list[float]:
    """Mean F1 of each filter at its default settings and at those that are best on the search seeds."""
    searched = [synthetic_cloud(scene, plan.small_size, seed, kind, share) for seed in plan.search_seeds]
    pairs = [(method(each(), 'default'), method(best_settings(each, searched), 'best')) for each in SETTINGS_TYPES]
    clouds = [synthetic_cloud(scene, plan.small_size, seed, kind, share) for seed in plan.seeds]
    return [_mean_f1(each, clouds) for each in chain(*pairs)]


def _mean_f1(each: Method, clouds: Sequence[LabelledCloud]) -> float:
    return float(np.mean([cloud.score(each(cloud.points).outliers).f1 for cloud in clouds]))


def _curves(conditions: Sequence[_Condition]) -> dict[tuple[str, str], dict[str, list[float]]]:
    """F1 over the shares: by scene and kind, then by label."""
    curves: dict[tuple[str, str], dict[str, list[float]]] = {}
    for each in conditions:
        curve = curves.setdefault((each.scene, each.kind), {label: [] for label in _LABELS})
        for label, f1 in zip(_LABELS, each.f1, strict=True):
            curve[label].append(f1)
    return curves


def _finding(kind: str, conditions: Sequence[_Condition]) -> str:
    """In how many conditions the social circle has the highest F1, and the range of its F1."""
    default, best = (sum(each.f1[own] >= max(each.f1[2:]) - SAME_SHARE for each in conditions) for own in (0, 1))
    ours = [each.f1[0] for each in conditions]
    return (
        f'{kind.capitalize()} outliers, {len(conditions)} conditions, other filters at their best settings for'
        f' each: the social circle has the highest F1 (within {SAME_SHARE:g}) in {default} at its default settings'
        f' and in {best} at its best settings. At its default settings F1 is between {min(ours):.3f} and'
        f' {max(ours):.3f}.'
    )
