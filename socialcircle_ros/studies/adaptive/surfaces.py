# SPDX-License-Identifier: Apache-2.0
"""Measured surfaces: with inserted outliers, and untouched."""

from collections.abc import Sequence
from functools import partial
from statistics import median

import numpy as np

from socialcircle_ros.report.content import Cell, Column, Item, Picture, Section, Table
from socialcircle_ros.studies.comparison.study import Study
from socialcircle_ros.studies.steps import Step, rows_of
from socialcircle_ros.studies.workload import DETECTION, INSERTION, TUNED_MEDIAN, million_points

from . import drawings
from .detection import detect
from .goals import GOALS, Goal, goals_section
from .inserted_outliers import OutlierShapes, StudiedSurface, insert_outliers

CONTROLS = ('alicona_fv_al3d1', 'alicona_fv_rubber')
"""Surfaces of the data folder that have no outliers."""
REPEATS = 5
"""Seeds for each surface and share."""
SHARES = (0.01, 0.05, 0.15, 0.3)
"""Shares of inserted outliers."""


_INSERTED = 'Measured surfaces with inserted outliers'
_UNTOUCHED = 'Untouched measured surfaces'
_NAMES: dict[OutlierShapes, str] = {'ellipses': 'adaptive_real', 'irregular': 'adaptive_irregular'}


def surface_steps(study: Study, surfaces: Sequence[StudiedSurface]) -> list[Step]:
    """Each surface with inserted outliers and untouched; then the goals."""
    seeds = len(study.plan.seeds[:REPEATS])
    per_point = 2 * len(SHARES) * seeds * (INSERTION + DETECTION + TUNED_MEDIAN) + DETECTION
    steps = [
        Step(
            f'adaptive_surface_{surface.cloud.name}',
            per_point * million_points(surface.plausible.shape),
            partial(_surface, study, surface),
        )
        for surface in surfaces
    ]
    return [*steps, Step('adaptive_surface_goals', 0.0, _goals)]


def _surface(study: Study, surface: StudiedSurface, _: Sequence[Section]) -> list[Section]:
    return [_contaminated(study, surface), _untouched(study, surface)]


def _goals(made: Sequence[Section]) -> list[Section]:
    goals = _contaminated_goals(rows_of(made, _NAMES['ellipses']))
    return [goals_section(GOALS, [*goals, *_untouched_goals(rows_of(made, 'adaptive_untouched'))])]


def _contaminated(study: Study, surface: StudiedSurface) -> Section:
    """Insert outliers, and compare the adaptive mode with the median residual tuned on the truth."""
    columns = [
        Column('surface'), Column('inserted', '.0%'), Column('F1', '.3f'), Column('recall', '.3f'),
        Column('false positives', '.2%'), Column('tuned median: F1', '.3f'), Column('lead', '+.3f'),
    ]  # fmt: skip
    text = (
        'Half of the inserted outliers are isolated. Half are in clusters of 2 to 8 points radius with sharp or'
        ' blurred flanks. They are 8 to 40 σ off, where σ is the robust residual of the surface to a 5×5 median.'
        ' Points of the untouched surface beyond 10 robust σ of its 11×11 median are not counted. The other filter'
        ' is |z − median 11×11| with the threshold that is best for each single cloud.'
        f' Medians over {len(study.plan.seeds[:REPEATS])} seeds.'
    )
    irregular_text = (
        'In the second table two of five inserted outliers are isolated. The others are in patches of irregular'
        ' outline with 6 to 900 points, which are smoothed up to eight times with [1 2 1] / 4. They are 7 to 60 σ'
        ' off.'
    )
    titles: dict[OutlierShapes, str] = {
        'ellipses': _INSERTED,
        'irregular': 'Large, irregular and blurred outliers',
    }
    tables = [
        Table(_NAMES[shapes], title, columns, _contaminated_rows(study, surface, shapes))
        for shapes, title in titles.items()
    ]
    return Section(_INSERTED, [text, irregular_text], items=tables)


def _contaminated_rows(study: Study, surface: StudiedSurface, shapes: OutlierShapes) -> list[list[Cell]]:
    """Medians over the seeds for each share."""
    rows: list[list[Cell]] = []
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


def _untouched(study: Study, surface: StudiedSurface) -> Section:
    """Filter a surface as measured: the plausible points removed, and the share of spikes removed."""
    cloud = surface.cloud
    study.progress(f'{cloud.name}: untouched')
    found = detect(cloud.points).outliers
    removed = float(found[surface.plausible].mean())
    spikes_removed = float(found[surface.spikes].mean()) if surface.spikes.any() else None
    columns = [
        Column('surface'), Column('plausible points removed', '.3%'), Column('beyond 10 σ', ',d'),
        Column('of those removed', '.1%'),
    ]  # fmt: skip
    text = (
        'The truth is unknown here. Points within 10 robust σ of the 11×11 median are plausible. Points beyond are'
        ' spikes, but also edges of pits and steep walls that belong to the part: see the pictures.'
    )
    row: list[Cell] = [cloud.name, removed, int(np.count_nonzero(surface.spikes)), spikes_removed]
    items: list[Item] = [Table('adaptive_untouched', _UNTOUCHED, columns, [row])]
    if surface.spikes.any():
        items.append(
            Picture(
                f'adaptive_spikes_{cloud.name}',
                drawings.spikes(cloud.points, cloud.unit, surface.spikes, found),
                f'{cloud.name}, untouched: the whole surface, and the part with most points beyond 10 robust σ'
                ' of the 11×11 median.',
            )
        )
    return Section(_UNTOUCHED, [text], items=items)


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
