# SPDX-License-Identifier: Apache-2.0
"""Measured surfaces: with inserted outliers, and untouched."""

from collections.abc import Sequence
from statistics import median

import numpy as np

from socialcircle_ros.report.content import Cell, Column, Picture, Section, Table
from socialcircle_ros.studies.comparison.study import Study

from . import drawings
from .detection import detect
from .goals import Evaluation, Goal
from .inserted_outliers import OutlierShapes, StudiedSurface, insert_outliers

CONTROLS = ('alicona_fv_al3d1', 'alicona_fv_rubber')
"""Surfaces of the data folder that have no outliers."""
REPEATS = 5
"""Seeds for each surface and share."""
SHARES = (0.01, 0.05, 0.15, 0.3)
"""Shares of inserted outliers."""


def contaminated_surfaces(study: Study, surfaces: Sequence[StudiedSurface]) -> Evaluation:
    """Insert outliers, and compare the adaptive mode with the median residual tuned on the truth."""
    seeds = study.plan.seeds[:REPEATS]
    rows = _contaminated_rows(study, surfaces, 'ellipses')
    irregular_rows = _contaminated_rows(study, surfaces, 'irregular')
    columns = [
        Column('surface'), Column('inserted', '.0%'), Column('F1', '.3f'), Column('recall', '.3f'),
        Column('false positives', '.2%'), Column('tuned median: F1', '.3f'), Column('lead', '+.3f'),
    ]  # fmt: skip
    text = (
        'Half of the inserted outliers are isolated. Half are in clusters of 2 to 8 points radius with sharp or'
        ' blurred flanks. They are 8 to 40 σ off, where σ is the robust residual of the surface to a 5×5 median.'
        ' Points of the untouched surface beyond 10 robust σ of its 11×11 median are not counted. The other filter'
        ' is |z − median 11×11| with the threshold that is best for each single cloud.'
        f' Medians over {len(seeds)} seeds.'
    )
    irregular_text = (
        'In the second table two of five inserted outliers are isolated. The others are in patches of irregular'
        ' outline with 6 to 900 points, which are smoothed up to eight times with [1 2 1] / 4. They are 7 to 60 σ'
        ' off.'
    )
    tables = [
        Table('adaptive_real', 'Measured surfaces with inserted outliers', columns, rows),
        Table('adaptive_irregular', 'Large, irregular and blurred outliers', columns, irregular_rows),
    ]
    section = Section('Measured surfaces with inserted outliers', [text, irregular_text], items=[*tables])
    return Evaluation(section, _contaminated_goals(rows))


def _contaminated_rows(
    study: Study, surfaces: Sequence[StudiedSurface], shapes: OutlierShapes
) -> list[list[Cell]]:
    """Medians over the seeds for each surface and share."""
    rows: list[list[Cell]] = []
    for surface in surfaces:
        for share in SHARES:
            study.progress(f'{surface.cloud.name}: {100 * share:g} % inserted outliers, {shapes}')
            seeds = study.plan.seeds[:REPEATS]
            contaminated = [insert_outliers(surface, share, seed, shapes) for seed in seeds]
            scores = [each.score(detect(each.points).outliers) for each in contaminated]
            tuned = median(each.best_median_f1() for each in contaminated)
            f1 = median(each.f1 for each in scores)
            recall = median(each.recall for each in scores)
            false_positives = median(each.false_positive_rate for each in scores)
            rows.append([surface.cloud.name, share, f1, recall, false_positives, tuned, f1 - tuned])
    return rows


def _contaminated_goals(rows: Sequence[Sequence[Cell]]) -> list[Goal]:
    at_five = [float(row[2] or 0) for row in rows if row[1] == 0.05]
    worst = min(rows, key=lambda row: float(row[6] or 0))
    return [
        Goal(f'Median F1 on {len(at_five)} measured surfaces with 5 % inserted outliers', median(at_five), 0.92),
        Goal(
            'Least lead in F1 over the tuned median residual, measured surfaces with 1 to 30 % inserted outliers'
            f' ({worst[0]}, {worst[1]:.0%})',
            float(worst[6] or 0),
            0.1,
            form='+.3f',
        ),
    ]


def untouched_surfaces(study: Study, surfaces: Sequence[StudiedSurface]) -> Evaluation:
    """Filter the surfaces as measured: the plausible points removed, and the share of spikes removed."""
    rows: list[list[Cell]] = []
    pictures = []
    for surface in surfaces:
        cloud = surface.cloud
        study.progress(f'{cloud.name}: untouched')
        found = detect(cloud.points).outliers
        has_spikes = bool(surface.spikes.any())
        removed = float(found[surface.plausible].mean())
        spikes_removed = float(found[surface.spikes].mean()) if has_spikes else None
        rows.append([cloud.name, removed, int(np.count_nonzero(surface.spikes)), spikes_removed])
        if has_spikes:
            pictures.append(
                Picture(
                    f'adaptive_spikes_{cloud.name}',
                    drawings.spikes(cloud.points[..., 2], cloud.unit, surface.spikes, found),
                    f'{cloud.name}, untouched: the whole surface, and the part with most points beyond 10 robust σ'
                    ' of the 11×11 median.',
                )
            )
    columns = [
        Column('surface'), Column('plausible points removed', '.3%'), Column('beyond 10 σ', ',d'),
        Column('of those removed', '.1%'),
    ]  # fmt: skip
    text = (
        'The truth is unknown here. Points within 10 robust σ of the 11×11 median are plausible. Points beyond are'
        ' spikes, but also edges of pits and steep walls that belong to the part: see the pictures.'
    )
    table = Table('adaptive_untouched', 'Untouched measured surfaces', columns, rows)
    return Evaluation(
        Section('Untouched measured surfaces', [text], items=[table, *pictures]), _untouched_goals(rows)
    )


def _untouched_goals(rows: Sequence[Sequence[Cell]]) -> list[Goal]:
    removed = [float(row[1] or 0) for row in rows]
    removed_of_controls = [float(row[1] or 0) for row in rows if row[0] in CONTROLS]
    goals = [
        Goal('Plausible points removed, worst untouched surface', max(removed), 0.003, at_least=False, form='.2%')
    ]
    if removed_of_controls:
        worst = max(removed_of_controls)
        goals.append(
            Goal('Plausible points removed, worst outlier-free surface', worst, 0.001, at_least=False, form='.2%')
        )
    return goals
