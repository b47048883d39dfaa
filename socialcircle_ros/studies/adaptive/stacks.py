# SPDX-License-Identifier: Apache-2.0
"""Clouds from simulated focus stacks: the adaptive mode against filters that are tuned on the same clouds."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from statistics import median

from socialcircle_ros.baselines.settings import MedianSettings, RadiusSettings, StatisticalSettings
from socialcircle_ros.metrics.scores import Scores
from socialcircle_ros.report.content import Cell, Column, Picture, Section, Table
from socialcircle_ros.studies.comparison.drawings import removal_maps
from socialcircle_ros.studies.comparison.labelled_clouds import LabelledCloud, scanned_cloud
from socialcircle_ros.studies.comparison.methods import FilterSettings, Method, describe, method, name_of
from socialcircle_ros.studies.comparison.search import best_settings
from socialcircle_ros.studies.comparison.study import Study
from socialcircle_ros.studies.steps import Step
from socialcircle_ros.studies.workload import DETECTION, DRAWING, SCAN, SEARCH, million_points

from .detection import detect
from .goals import GOALS, Goal, goals_section

_TUNED: tuple[type[FilterSettings], ...] = (RadiusSettings, StatisticalSettings, MedianSettings)


@dataclass(frozen=True)
class _StackComparison:
    """Scores of the adaptive mode and of the tuned filters, one for each cloud."""

    title: str
    clouds: list[LabelledCloud]
    adaptive: list[Scores]
    tuned: list[tuple[Method, list[Scores]]]

    @property
    def strongest(self) -> tuple[Method, list[Scores]]:
        """The tuned filter with the highest median F1."""
        return max(self.tuned, key=lambda each: _median_f1(each[1]))

    @property
    def rows(self) -> list[list[Cell]]:
        """Rows of the table: the adaptive mode first."""
        return [
            [self.title, 'adaptive', 'none to set', *_summary(self.adaptive)],
            *([self.title, each.name, describe(each.settings), *_summary(scores)] for each, scores in self.tuned),
        ]


def simulated_stacks(study: Study) -> list[Step]:
    """Scan two specimens with the virtual instrument, and filter the clouds."""
    plan = study.plan
    work = len(plan.seeds) * million_points(plan.small_size) * (SCAN + DETECTION + SEARCH) + DRAWING
    return [
        Step('adaptive_stacks_flat', work, partial(_stacks, study, 'flat', 'flat rough surface', _flat_goals)),
        Step(
            'adaptive_stacks_groove', work, partial(_stacks, study, 'steep_groove', 'steep groove', _groove_goals)
        ),
    ]


def _stacks(
    study: Study, specimen: str, title: str, goals: Callable[[_StackComparison], list[Goal]], _: Sequence[Section]
) -> list[Section]:
    compared = _compare(study, specimen, title)
    columns = [
        Column('surface'), Column('filter'), Column('settings'), Column('F1, median', '.3f'),
        Column('least', '.3f'), Column('precision', '.3f'), Column('recall', '.3f'),
        Column('false positives', '.2%'),
    ]  # fmt: skip
    text = (
        'The outliers result from the simulated optics: the depth is wrong where the images carry too little'
        ' information. The other filters have the settings that are best on these very clouds. The adaptive mode'
        ' has the heights, and the depth of field that it estimates from the focus curves of the stack.'
    )
    table = Table('adaptive_stacks', 'Focus stacks; medians over the seeds', columns, compared.rows)
    section = Section('Simulated focus stacks', [text], items=[table, _picture(study, specimen, compared)])
    return [section, goals_section(GOALS, goals(compared))]


def _compare(study: Study, specimen: str, title: str) -> _StackComparison:
    plan = study.plan
    study.progress(f'{specimen}: scanning {len(plan.seeds)} focus stacks')
    clouds = [scanned_cloud(specimen, plan.small_size, seed) for seed in plan.seeds]
    adaptive = [cloud.score(detect(cloud.points, cloud.depth_of_field).outliers) for cloud in clouds]
    tuned = []
    for settings_type in _TUNED:
        study.progress(f'{specimen}: tuning on the truth, {name_of(settings_type).lower()}')
        best = method(best_settings(settings_type, clouds), 'best')
        tuned.append((best, [cloud.score(best(cloud.points).outliers) for cloud in clouds]))
    return _StackComparison(title, clouds, adaptive, tuned)


def _flat_goals(flat: _StackComparison) -> list[Goal]:
    where = _where(flat)
    lost = sum(own.f1 < other.f1 for own, other in zip(flat.adaptive, flat.strongest[1], strict=True))
    return [
        Goal(f'Median F1, {where}', _median_f1(flat.adaptive), 0.98),
        Goal(f'Seeds lost to the best tuned filter, {where}', lost, 0, at_least=False, form='.0f'),
    ]


def _groove_goals(groove: _StackComparison) -> list[Goal]:
    where = _where(groove)
    false_positives = median(each.false_positive_rate for each in groove.adaptive)
    lead = _median_f1(groove.adaptive) - _median_f1(groove.strongest[1])
    return [
        Goal(f'Median F1, {where}', _median_f1(groove.adaptive), 0.95),
        Goal(f'Median false-positive rate, {where}', false_positives, 0.005, at_least=False, form='.2%'),
        Goal(f'Lead in F1 over the best tuned filter, {where}', lead, 0.05, form='+.3f'),
    ]


def _where(comparison: _StackComparison) -> str:
    return f'simulated stacks of the {comparison.title} (n = {len(comparison.clouds)})'


def _picture(study: Study, specimen: str, comparison: _StackComparison) -> Picture:
    cloud, best = comparison.clouds[0], comparison.strongest[0]
    found = [
        ('adaptive', detect(cloud.points, cloud.depth_of_field).outliers),
        (best.name, best(cloud.points).outliers),
    ]
    return Picture(
        f'adaptive_stack_{specimen}',
        removal_maps(cloud, found),
        f'{cloud.title}, seed {study.plan.seeds[0]}: the heights that remain, and the decisions of both filters.',
    )


def _summary(scores: Sequence[Scores]) -> list[Cell]:
    return [
        _median_f1(scores),
        min(each.f1 for each in scores),
        median(each.precision for each in scores),
        median(each.recall for each in scores),
        median(each.false_positive_rate for each in scores),
    ]


def _median_f1(scores: Sequence[Scores]) -> float:
    return median(each.f1 for each in scores)
