# SPDX-License-Identifier: Apache-2.0
"""The individuals chart."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from naive import control_chart as naive

from socialcircle_ros.archive.control_chart import RULES, ControlLimits, control_limits, signals

# Whole and half numbers, so that values lie on the limits as well.
VALUES = st.lists(st.integers(-8, 8).map(lambda number: number / 2), max_size=40)


@given(VALUES, st.sampled_from([0.0, 0.5, 1.0]))
def test_signals_are_those_of_the_handbook(values, centre):
    found = signals(np.array(values, float), ControlLimits(centre, 1.0))
    assert found.tolist() == naive.signals(values, centre, 1.0)


@pytest.mark.parametrize(
    ('values', 'rule'),
    [
        ([0, 0, 3.1], 'one point beyond 3 sigma'),
        ([2.1, 0, 2.2], 'two of three points beyond 2 sigma on one side'),
        ([-1.1, -1.2, 0, -1.3, -1.4], 'four of five points beyond 1 sigma on one side'),
        ([0.1] * 8, 'eight points on one side of the centre line'),
    ],
)
def test_each_rule_is_completed_by_the_last_point(values, rule):
    found = signals(np.array(values, float), ControlLimits(0.0, 1.0))
    assert [name for bit, name in enumerate(RULES) if found[-1] >> bit & 1] == [rule]
    assert not found[:-1].any()


def test_points_on_two_sides_give_no_signal():
    assert not signals(np.array([2.5, -2.5, 1.5, -1.5] * 4), ControlLimits(0.0, 1.0)).any()


def test_the_limits_come_from_the_moving_range_of_the_baseline():
    values = np.array([1.0, 3.0] * 10 + [100.0] * 10)
    limits = control_limits(values, 20)
    assert limits == ControlLimits(2.0, 2.0 / 0.954)
    assert limits.upper - limits.lower == pytest.approx(6 * limits.sigma)
    assert control_limits(values[:7], 20) is None


def test_a_bad_part_in_the_baseline_hides_nothing_and_accuses_no_other():
    values = np.array([1.0, 3.0] * 30)
    values[7] = 500.0
    limits = control_limits(values, 50)
    assert limits == ControlLimits(2.0, 2.0 / 0.954)
    assert np.flatnonzero(signals(values, limits) & 1).tolist() == [7]


def test_values_that_seldom_change_have_a_sigma_above_0():
    values = np.zeros(40)
    values[::9] = 1.0
    assert control_limits(values, 40).sigma == pytest.approx(np.abs(np.diff(values)).mean() / 1.128)


def test_equal_values_give_no_signal():
    values = np.full(40, 26 / 5594)
    assert not signals(values, control_limits(values, 20)).any()


def test_a_large_offset_and_a_tiny_spread_are_kept_apart():
    generator = np.random.default_rng(0)
    values = 1e6 + 1e-3 * generator.standard_normal(200)
    limits = control_limits(values, 200)
    assert 0.8e-3 < limits.sigma < 1.2e-3
    assert (signals(values, limits) & 1).sum() <= 3
