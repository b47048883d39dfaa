# SPDX-License-Identifier: Apache-2.0
"""Light that changes from frame to frame moves no peak."""

import numpy as np
import pytest
from focus.stacks import errors, make_stack

from socialcircle_ros.focus import depth_from_focus
from socialcircle_ros.settings import FocusSettings


def dimmed(stack, shares):
    return np.rint(stack.frames * np.asarray(shares)[:, None, None]).astype(stack.frames.dtype)


@pytest.fixture(scope='module')
def bright():
    return make_stack(seed=3, dtype=np.uint16, width=2.6, margin=10.0)


@pytest.mark.parametrize('change', ['flicker', 'ramp'])
def test_light_of_the_frames_is_divided_out(bright, change):
    count = len(bright.z)
    flicker = 1 + 0.05 * np.random.default_rng(0).standard_normal(count)
    shares = 0.8 * flicker if change == 'flicker' else np.linspace(0.5, 1.0, count)
    frames = dimmed(bright, shares)
    steady = errors(depth_from_focus(bright.frames, bright.z), bright.truth)
    wrong = errors(depth_from_focus(frames, bright.z), bright.truth)
    uncorrected = errors(depth_from_focus(frames, bright.z, FocusSettings(normalize=False)), bright.truth)
    assert np.sqrt(np.mean(wrong**2)) < 1.1 * np.sqrt(np.mean(steady**2)) + 0.003
    assert np.sqrt(np.mean(uncorrected**2)) > 1.5 * np.sqrt(np.mean(steady**2))


def test_flicker_is_measured(bright):
    shares = np.where(np.arange(len(bright.z)) % 2, 0.9, 1.0)
    result = depth_from_focus(dimmed(bright, shares), bright.z)
    assert result.flicker == pytest.approx(np.std(shares) / np.mean(shares), rel=0.05)
    assert depth_from_focus(bright.frames, bright.z).flicker < 0.01


def test_black_frames_are_no_division_by_zero(bright):
    frames = bright.frames.copy()
    frames[::3] = 0
    assert np.isfinite(depth_from_focus(frames, bright.z).quality).all()


@pytest.mark.parametrize('order', [1, -1])
def test_light_that_follows_the_focus_of_the_part_is_not_divided_out(order):
    """As with a mirror or in a confocal microscope: divided out, no frame would be sharper than another."""
    texture = np.random.default_rng(0).integers(0, 200, (30, 40))
    z = np.arange(9.0)[::order]
    frames = [(texture * np.exp(-(((each - 4.2) / 2) ** 2))).astype(np.uint8) for each in z]
    result = depth_from_focus(frames, z)
    assert abs(np.nanmedian(result.depth) - 4.2) < 0.2
    assert np.isfinite(result.depth).mean() > 0.9
