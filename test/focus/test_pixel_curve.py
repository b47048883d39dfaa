# SPDX-License-Identifier: Apache-2.0
"""The whole focus curve of one pixel."""

import numpy as np
import pytest

from socialcircle_ros.focus import PixelCurve, depth_from_focus, focus_measure
from socialcircle_ros.settings import FocusSettings

SETTINGS = FocusSettings(normalize=False, step=2, half_window=3)


def measured(frames, z, settings, place):
    stack = PixelCurve(settings, place)
    for frame, position in zip(frames, z, strict=True):
        stack.add(frame, position)
    stack.finish()
    return stack.curve


@pytest.mark.parametrize('place', [(0, 0), (40, 60), (95, 127), (3, 125)])
def test_the_curve_holds_the_focus_measure_of_each_frame_also_at_the_border(noisy, place):
    frames, z = noisy.frames[::-1], noisy.z[::-1]
    curve = measured(frames, z, SETTINGS, place)
    np.testing.assert_array_equal(curve.z, noisy.z)
    np.testing.assert_array_equal(curve.measure, [focus_measure(frame, SETTINGS)[place] for frame in noisy.frames])


def test_light_is_divided_out_and_the_depth_is_that_of_the_stack(noisy):
    place = 40, 60
    curve = measured(noisy.frames, noisy.z, FocusSettings(), place)
    darker = measured(noisy.frames // 2, noisy.z, FocusSettings(), place)
    np.testing.assert_allclose(darker.measure, curve.measure, rtol=0.2)
    result = depth_from_focus(noisy.frames, noisy.z)
    assert (curve.depth, curve.quality) == (result.depth[place], result.quality[place])
    assert curve.reasons == ()
    assert abs(curve.z[curve.measure.argmax()] - curve.depth) < 1


def test_of_two_frames_at_one_z_the_sharper_one_counts_and_a_reset_forgets_them(noisy):
    stack = PixelCurve(SETTINGS, (40, 60))
    stack.add(noisy.frames[0], 99.0)
    stack.reset()
    for frame, position in zip(noisy.frames, noisy.z, strict=True):
        stack.add(frame, position)
        stack.add(np.full_like(frame, 7), position)
    stack.finish()
    np.testing.assert_array_equal(stack.curve.measure, measured(noisy.frames, noisy.z, SETTINGS, (40, 60)).measure)


def test_objections_to_the_depth_are_named(noisy):
    blown = noisy.frames.copy()
    blown[:, 30:50, 50:70] = 255
    assert 'saturated' in measured(blown, noisy.z, FocusSettings(), (40, 52)).reasons
