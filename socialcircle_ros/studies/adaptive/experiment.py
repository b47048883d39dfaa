# SPDX-License-Identifier: Apache-2.0
"""The adaptive mode against its goals: all evaluations on one page, the goals first."""

from collections.abc import Sequence

from socialcircle_ros.report.content import Section
from socialcircle_ros.studies.comparison.measured import MeasuredCloud
from socialcircle_ros.studies.comparison.study import Study

from .goals import goals_table
from .inserted_outliers import measured_surface
from .leave_one_out import leave_one_out
from .robustness import ambiguous_clouds, changed_units, outlier_free_scenes
from .run_time import run_time
from .stacks import simulated_stacks
from .surfaces import REPEATS, contaminated_surfaces, untouched_surfaces

DEFAULT_SEEDS = tuple(range(301, 321))
"""Seeds of the simulated stacks; no constant of the adaptive mode was chosen on them."""


def adaptive(study: Study, measured: Sequence[MeasuredCloud]) -> list[Section]:
    """Evaluate the adaptive mode.

    Args:
        study: its plan gives sizes, repeats and seeds.
        measured: surfaces of real instruments; without them their goals are not evaluated.
    """
    surfaces = [measured_surface(cloud) for cloud in measured]
    evaluations = [simulated_stacks(study)]
    if surfaces:
        evaluations += [contaminated_surfaces(study, surfaces), untouched_surfaces(study, surfaces)]
    if len(surfaces) > 1:
        evaluations.append(leave_one_out(surfaces, study.plan.seeds[:REPEATS], study.progress))
    evaluations += [outlier_free_scenes(study), ambiguous_clouds(study), changed_units(study), run_time(study)]
    goals = [goal for each in evaluations for goal in each.goals]
    warnings = [] if surfaces else ['No measured surfaces were given (--data): their goals are not evaluated.']
    first = Section(
        'Goals',
        findings=[goal.sentence for goal in goals],
        items=[goals_table('adaptive_goals', goals)],
        warnings=warnings,
    )
    return [first, *(each.section for each in evaluations)]
