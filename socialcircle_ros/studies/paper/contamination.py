"""From little to heavy contamination: F1 of each filter, for isolated, clustered and blurred outliers."""

from collections.abc import Sequence
from itertools import chain, product
from typing import Any, get_args

import numpy as np

from socialcircle_ros.report.content import Cell, Column, Picture, Section, Table
from socialcircle_ros.studies.comparison import drawings
from socialcircle_ros.studies.comparison.labelled_clouds import (
    PAPERS_SCENES,
    TITLES,
    LabelledCloud,
    OutlierKind,
    synthetic_cloud,
)
from socialcircle_ros.studies.comparison.methods import KINDS, Method, method, name_of
from socialcircle_ros.studies.comparison.search import best_settings
from socialcircle_ros.studies.comparison.study import Study, judged

from .verdicts import SAME_SHARE

_NAMES = [f'{name_of(kind)}, {variant}' for kind in KINDS for variant in ('default', 'best')]


def contaminations(study: Study) -> list[Section]:
    """F1 of each filter from little to heavy contamination, for each kind of outlier."""
    plan = study.plan
    kinds: list[OutlierKind] = [kind for kind in get_args(OutlierKind) if kind != 'own']
    curves: dict[tuple[str, str], dict[str, list[float]]] = {}
    rows: list[list[Cell]] = []
    for scene, kind, share in product(PAPERS_SCENES, kinds, plan.shares):
        study.tell(f'{scene}: {100 * share:g} % {kind} outliers')
        known = [synthetic_cloud(scene, plan.smaller, seed, kind, share) for seed in plan.search_seeds]
        pairs = [(method(each(), 'default'), method(best_settings(each, known), 'best')) for each in KINDS]
        clouds = [synthetic_cloud(scene, plan.smaller, seed, kind, share) for seed in plan.seeds]
        means = [_mean_f1(each, clouds) for each in chain(*pairs)]
        rows.append([TITLES[scene], kind, share, *means])
        curve = curves.setdefault((TITLES[scene], kind), {name: [] for name in _NAMES})
        for name, value in zip(_NAMES, means, strict=True):
            curve[name].append(value)
    kinds_explained = (
        f'Clouds of {plan.smaller[1]}×{plan.smaller[0]} points. Isolated outliers stand alone; clustered ones lie'
        ' in blobs of 2 to 8 points radius that are displaced together, with sharp flanks; blurred blobs rise'
        ' over their whole radius, so that each point is near the next.'
    )
    caption = (
        'F1 over the share of outliers. Solid: best settings, searched for each single point of the curve on other'
        ' seeds; dashed: defaults.'
    )
    columns = [
        Column('scene'),
        Column('outliers'),
        Column('share', '.0%'),
        *(Column(name, '.3f') for name in _NAMES),
    ]
    return [
        Section(
            'From 2 to 45 % outliers',
            [kinds_explained],
            findings=_where_best(rows, kinds),
            items=[
                Picture('contamination', drawings.contamination(plan.shares, curves), caption),
                Table('contamination', 'F1 by scene, kind and share of outliers', columns, rows),
            ],
        )
    ]


def _mean_f1(each: Method, clouds: Sequence[LabelledCloud]) -> float:
    return float(np.mean([judged(each(cloud.points).outliers, cloud).f1 for cloud in clouds]))


def _where_best(rows: Sequence[Sequence[Any]], kinds: Sequence[str]) -> list[str]:
    """For each kind of outlier: how often ours leads, and over which range its F1 goes."""
    default, best, others = 3, 4, slice(5, None)
    sentences = []
    for kind in kinds:
        of_kind = [row for row in rows if row[1] == kind]
        leads = [sum(row[i] >= max(row[others]) - SAME_SHARE for row in of_kind) for i in (default, best)]
        ours = [row[default] for row in of_kind]
        sentences.append(
            f'{kind.capitalize()} outliers: against the others at their best for each of {len(of_kind)} conditions'
            f' F1 of the social circle is the highest (within {SAME_SHARE:g}) in {leads[0]} at its default and in'
            f' {leads[1]} at its best; at its default it goes from {min(ours):.3f} to {max(ours):.3f}.'
        )
    return sentences
