# SPDX-License-Identifier: Apache-2.0
"""Leave-one-out validation of the adaptive mode's rules."""

import numpy as np
import pytest

from socialcircle_ros.circle.adaptive import Rules
from socialcircle_ros.studies.adaptive import leave_one_out as module
from socialcircle_ros.studies.adaptive.goals import GOALS
from socialcircle_ros.studies.adaptive.inserted_outliers import measured_surface
from socialcircle_ros.studies.adaptive.leave_one_out import leave_one_out
from socialcircle_ros.studies.comparison.measured import MeasuredCloud
from socialcircle_ros.studies.steps import merged, rows_of

BLIND = Rules(steep=2.0)
"""No border is so steep: only isolated points are outliers."""


def plate(name, seed, islands=0):
    rows, columns = np.mgrid[:150, :180].astype(np.float32)
    heights = np.random.default_rng(seed).normal(0, 0.3, rows.shape)
    for place in range(islands):
        row, column = 8 + 15 * (place // 10), 8 + 17 * (place % 10)
        heights[row : row + 4, column : column + 4] += 2 + 0.4 * (place % 7)
    return measured_surface(MeasuredCloud(name, np.dstack([columns, rows, heights.astype(np.float32)]), 'µm'))


def validate(surfaces):
    """The rows of the table by surface, and the goal as it is written."""
    told, made = [], []
    for step in leave_one_out(surfaces, (1, 2, 3), told.append):
        made = merged([*made, *step.make(made)])
    assert told
    ((goal, _, measured, _),) = rows_of(made, GOALS)
    assert 'leave-one-out' in goal
    return {row[0]: row[1:] for row in rows_of(made, 'adaptive_leave_one_out')}, float(measured)


def test_the_rules_that_are_best_on_the_other_surfaces_are_judged(monkeypatch):
    monkeypatch.setattr(module, 'candidates', lambda: [BLIND, Rules(), BLIND])
    rows, goal = validate([plate('one', 1), plate('two', 2)])
    for steep, _, _, f1, removed in rows.values():
        assert steep == Rules().steep
        assert f1 > 0.7
        assert removed < 0.003
    assert goal == pytest.approx(np.median([row[3] for row in rows.values()]), abs=5e-4)


def test_rules_that_harm_an_untouched_surface_are_not_chosen_if_it_takes_part_in_the_choice(monkeypatch):
    monkeypatch.setattr(module, 'candidates', lambda: [BLIND, Rules(steep=0.8)])
    rows, _ = validate([plate('plain', 1), plate('islands', 2, islands=80)])
    assert rows['plain'][0] == BLIND.steep
    assert rows['islands'][0] == 0.8
