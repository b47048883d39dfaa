# SPDX-License-Identifier: Apache-2.0
"""Measured depths are classified by their errors, and the causes of failure are found."""

from dataclasses import replace

import numpy as np
import pytest

from socialcircle_ros.errors import CloudError, SettingError
from socialcircle_ros.simulation.camera import Camera
from socialcircle_ros.simulation.surfaces import Grid, steps
from socialcircle_ros.simulation.truth import Cause, DepthTruth, causes

SHAPE = (20, 30)
NOTHING = np.zeros(SHAPE, dtype=np.uint8)
TRUTH = DepthTruth(np.zeros(SHAPE), NOTHING, good_bound=1.0, bad_bound=3.0)


def test_depth_is_good_ambiguous_bad_or_missing():
    depth = np.zeros(SHAPE)
    depth[0, :5] = [0.9, -1.1, 2.9, -3.1, np.nan]
    verdict = TRUTH.classify(depth)
    assert list(verdict.good[0, :5]) == [True, False, False, False, False]
    assert list(verdict.ambiguous[0, :5]) == [False, True, True, False, False]
    assert list(verdict.bad[0, :5]) == [False, False, False, True, False]
    assert list(verdict.missing[0, :5]) == [False, False, False, False, True]
    masks = np.stack([verdict.good, verdict.ambiguous, verdict.bad, verdict.missing])
    assert (masks.sum(axis=0) == 1).all()
    assert verdict.error[0, 1] == -1.1
    assert np.isnan(verdict.error[0, 4])


def test_depth_between_those_of_the_neighbours_is_not_an_outlier():
    truth = replace(TRUTH, depth=steps(Grid(*SHAPE), [0.0, 20.0]))
    depth = truth.depth.copy()
    depth[5, 14:16] = 10.0  # halfway up the wall
    depth[5, 5] = 10.0
    verdict = truth.classify(depth)
    assert verdict.ambiguous[5, 14:16].all()
    assert verdict.bad[5, 5]


def test_another_size_and_wrong_bounds_are_refused():
    with pytest.raises(CloudError, match=r'\(3, 3\), the truth \(20, 30\)'):
        TRUTH.classify(np.zeros((3, 3)))
    with pytest.raises(SettingError, match='0 < good ≤ bad'):
        DepthTruth(np.zeros(SHAPE), NOTHING, good_bound=2.0, bad_bound=1.0)


def cause_of(*, light=1.0, texture=0.2, glare=0.0, surface=None):
    flat = np.zeros(SHAPE)
    sharp = light * (1 + texture * np.random.default_rng(0).standard_normal(SHAPE))
    flags = causes(
        flat if surface is None else surface,
        Grid(*SHAPE),
        sharp.astype(np.float32),
        np.full(SHAPE, glare, dtype=np.float32),
        Camera(),
    )
    return Cause(int(flags[10, 14]))


def test_each_cause_is_found():
    assert cause_of() is Cause.NONE
    assert cause_of(glare=2.0) is Cause.GLINT
    assert cause_of(light=2.2, texture=0.05) is Cause.SATURATED
    assert cause_of(light=0.1) is Cause.DARK
    assert cause_of(texture=0.005) is Cause.LOW_CONTRAST
    assert cause_of(surface=steps(Grid(*SHAPE), [0.0, 9.0])) is Cause.STEEP


def test_main_cause_is_the_first_of_several():
    flags = np.zeros(SHAPE, dtype=np.uint8)
    flags[0, 0] = Cause.DARK | Cause.STEEP
    flags[0, 1] = Cause.GLINT | Cause.LOW_CONTRAST
    main = replace(TRUTH, cause=flags).main_cause
    assert main[0, 0] == Cause.DARK
    assert main[0, 1] == Cause.GLINT
    assert main[1, 1] == Cause.NONE
