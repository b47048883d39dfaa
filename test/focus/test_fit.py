# SPDX-License-Identifier: Apache-2.0
"""The fit of the focus curve: position of the peak, quality, and width."""

import numpy as np
import pytest
from focus.stacks import INNER, make_stack
from naive import focus as naive

from socialcircle_ros.focus import FocusStack, Reason, depth_from_focus, focus_measure
from socialcircle_ros.settings import FocusSettings
from socialcircle_ros.simulation import simulate


@pytest.mark.parametrize('fit', ['gauss', 'gauss3'])
def test_peak_equals_the_reference(noisy, fit, monkeypatch):
    monkeypatch.setattr('socialcircle_ros.focus.scales.correct_for_centroid', lambda depth, *_: depth)
    settings = FocusSettings(fit=fit)
    result = depth_from_focus(noisy.frames, noisy.z, settings)
    curves = np.stack([focus_measure(frame, settings) * naive.scale_of(frame) for frame in noisy.frames])
    for row, column in np.random.default_rng(0).integers(10, 86, (60, 2)):
        curve = curves[:, row, column]
        best = int(np.argmax(curve))
        near = slice(best - 1, best + 2)
        expected = (
            naive.peak_of_three(noisy.z[near], curve[near])
            if fit == 'gauss3'
            else naive.peak_of_curve(noisy.z, curve, 7)
        )
        assert result.depth[row, column] == pytest.approx(expected, abs=2e-3)


def test_quality_is_the_probability_of_a_good_depth():
    """A good depth is within a quarter of the depth of field, which is about 1.1 times the half width here."""
    quality, good = [], []
    for seed, contrast in enumerate([0.02, 0.04, 0.06, 0.1, 0.3]):
        stack = make_stack(seed, electrons=6000, contrast=contrast, width=2.6, margin=16.0)
        result = depth_from_focus(stack.frames, stack.z)
        quality.append(result.quality[INNER].ravel())
        good.append(np.abs(result.depth - stack.truth)[INNER].ravel() < 2.6 * 1.1 / 4)
    quality, good = np.concatenate(quality), np.concatenate(good)
    for least in (0.5, 0.7, 0.9):
        above = quality >= least
        assert above.mean() > 0.1
        assert good[above].mean() >= least
    assert good[(quality > 0) & (quality < 0.5)].mean() < 0.7


@pytest.mark.parametrize('instrument', ['5x', '10x'])
def test_depth_of_field_is_estimated_from_the_curve_widths(instrument):
    simulation = simulate('flat', 60, 80, seed=4, instrument=instrument)
    stack = FocusStack()
    for frame in simulation.frames():
        stack.add(frame.image, frame.z)
    assert stack.finish().depth_of_field == pytest.approx(simulation.optics.depth_of_field, rel=0.1)


def test_depth_of_field_is_proportional_to_curve_width_and_unit_of_z():
    narrow = make_stack(electrons=6000, width=1.3, margin=16.0)
    wide = make_stack(electrons=6000, width=2.6, margin=16.0)
    of_narrow, of_wide = (depth_from_focus(stack.frames, stack.z).depth_of_field for stack in (narrow, wide))
    assert of_wide == pytest.approx(2 * of_narrow, rel=0.1)
    assert depth_from_focus(narrow.frames, 1e-3 * narrow.z).depth_of_field == pytest.approx(1e-3 * of_narrow)


def test_depth_of_field_is_none_without_a_trusted_curve():
    assert depth_from_focus(np.full((20, 40, 50), 90, np.uint8), np.arange(20)).depth_of_field is None


def test_depth_of_field_is_none_if_all_curves_are_saturated(noisy):
    frames = np.minimum(noisy.frames.astype(int) * 4, 255).astype(np.uint8)
    result = depth_from_focus(frames, noisy.z)
    assert np.all(result.reasons & Reason.SATURATED)
    assert result.depth_of_field is None
