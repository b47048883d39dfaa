# SPDX-License-Identifier: Apache-2.0
"""The usual size of second differences, from the rows that stand for all."""

import numpy as np
import pytest

from socialcircle_ros.kernels.sampling import sampled_rows
from socialcircle_ros.repair.holes import PADDING
from socialcircle_ros.repair.second_differences import SAMPLED_POINTS, usual_squared_differences


def usual(heights, *, equal_pitches=False):
    padded = np.pad(heights, PADDING, constant_values=np.nan)
    return usual_squared_differences(padded, sampled_rows(*heights.shape, SAMPLED_POINTS), equal_pitches)


@pytest.mark.parametrize('period', [5, 6, 10])
@pytest.mark.parametrize('shape', [(640, 800), (800, 640)])
@pytest.mark.parametrize('axis', [0, 1])
def test_where_a_ruling_begins_changes_no_tolerance(period, shape, axis):
    noise = np.random.default_rng(1).normal(size=shape).astype(np.float32)
    found = []
    for first in range(period):
        ridges = 20 * ((np.arange(shape[axis]) + first) % period < 2).astype(np.float32)
        across = ridges[:, np.newaxis] if axis == 0 else ridges
        found.append(usual(noise + across, equal_pitches=True)[0])
    assert max(found) < 1.3 * min(found)


@pytest.mark.parametrize('shape', [(3, 100_000), (2000, 30), (60, 70)])
def test_noise_has_its_mean_square_in_clouds_of_any_shape(shape):
    noise = np.random.default_rng(2).normal(size=shape).astype(np.float32)
    np.testing.assert_allclose(usual(noise), 6, rtol=0.15)
    both, same = usual(noise, equal_pitches=True)
    assert both == same == pytest.approx(6, rel=0.1)


def test_a_cloud_without_three_points_in_a_line_has_none():
    assert usual(np.zeros((2, 2), np.float32)) == (0, 0)


@pytest.mark.parametrize('equal_pitches', [True, False])
def test_one_step_of_the_surface_changes_nothing(equal_pitches):
    heights = np.random.default_rng(0).normal(0, 2.0, (150, 140))
    heights[:, 60:] += 1000.0
    assert usual(heights, equal_pitches=equal_pitches) == pytest.approx((24, 24), rel=0.05)
