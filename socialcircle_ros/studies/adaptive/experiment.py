# SPDX-License-Identifier: Apache-2.0
"""The adaptive mode against its goals: all evaluations on one page, the goals first."""

from collections.abc import Sequence

from socialcircle_ros.report.content import Section
from socialcircle_ros.studies.comparison.measured import MeasuredCloud
from socialcircle_ros.studies.comparison.study import Study
from socialcircle_ros.studies.steps import Step
from socialcircle_ros.studies.workload import DETECTION, SYNTHETIC, million_points

from .goals import GOALS, goals_met
from .inserted_outliers import measured_surface
from .leave_one_out import leave_one_out
from .robustness import ambiguous_clouds, changed_units, outlier_free_scenes
from .run_time import run_time, run_time_work
from .stacks import simulated_stacks
from .surfaces import REPEATS, surface_steps

DEFAULT_SEEDS = tuple(range(301, 321))
"""Seeds of the simulated stacks; no constant of the adaptive mode was chosen on them."""


def adaptive(study: Study, measured: Sequence[MeasuredCloud]) -> list[Step]:
    """Evaluate the adaptive mode.

    Args:
        study: its plan gives sizes, repeats and seeds.
        measured: surfaces of real instruments; without them their goals are not evaluated.
    """
    plan = study.plan
    surfaces = [measured_surface(cloud) for cloud in measured]
    warnings = [] if surfaces else ['No measured surfaces were given (--data): their goals are not evaluated.']
    small = million_points(plan.small_size) * (SYNTHETIC + DETECTION)
    steps = [
        Step('adaptive_introduction', 0.0, lambda _: [Section('Goals', warnings=warnings)]),
        *simulated_stacks(study),
    ]
    if surfaces:
        steps += surface_steps(study, surfaces)
    if len(surfaces) > 1:
        steps += leave_one_out(surfaces, plan.seeds[:REPEATS], study.progress)
    return [
        *steps,
        Step('adaptive_breaking', 30 * small, lambda _: outlier_free_scenes(study)),
        Step('adaptive_decisions', 5 * small, lambda _: ambiguous_clouds(study)),
        Step('adaptive_scales', 7 * small, lambda _: changed_units(study)),
        Step('adaptive_times', run_time_work(study), lambda _: run_time(study)),
        Step('adaptive_goals', 0.0, lambda made: [goals_met(GOALS, made)]),
    ]
