# SPDX-License-Identifier: Apache-2.0
"""Pixels with a depth that is not to be trusted are marked with the reason."""

import numpy as np
from focus.stacks import INNER

from socialcircle_ros.focus import Reason, count_reasons, depth_from_focus
from socialcircle_ros.settings import FocusSettings


def test_peak_at_the_end_of_the_scan_has_no_depth(noisy):
    result = depth_from_focus(noisy.frames[: len(noisy.z) // 2], noisy.z[: len(noisy.z) // 2])
    end = noisy.z[len(noisy.z) // 2 - 1]
    beyond = ((noisy.truth > end + 0.5) & (noisy.truth < end + 2))[INNER]
    assert np.all(result.reasons[INNER][beyond] & Reason.SCAN_END)
    assert np.all(np.isnan(result.depth[INNER][beyond]))
    assert np.all(result.quality[INNER][beyond] == 0)


def test_image_without_texture_has_no_depth():
    result = depth_from_focus(np.full((20, 40, 50), 90, np.uint8), np.arange(20))
    assert np.all(np.isnan(result.depth))
    assert np.all(result.quality == 0)
    assert np.all(result.reasons & Reason.LOW_CONTRAST)


def test_pure_noise_is_rarely_taken_for_a_surface():
    noise = np.random.default_rng(0).normal(100, 3, (40, 96, 128))
    result = depth_from_focus(np.rint(noise).astype(np.uint8), np.arange(40))
    assert np.mean(np.isnan(result.depth[INNER])) > 0.75
    assert np.mean(result.quality[INNER] > 0.5) < 0.01
    assert np.mean(result.reasons[INNER] & Reason.LOW_CONTRAST > 0) > 0.9


def test_only_saturated_pixels_are_marked_as_saturated(noisy):
    frames = noisy.frames.copy()
    frames[:, 30:60, 40:80] = np.minimum(frames[:, 30:60, 40:80].astype(int) * 4, 255)
    result = depth_from_focus(frames, noisy.z)
    saturated = (result.reasons & Reason.SATURATED) > 0
    assert saturated[36:54, 46:74].mean() > 0.9
    assert not saturated[:24].any()
    assert np.all(result.quality[saturated] == 0)


def test_saturation_setting_marks_saturated_pixels_of_a_12_bit_camera(noisy):
    frames = np.minimum(noisy.frames.astype(np.uint16) * 64, 4095)
    by_data_type = depth_from_focus(frames, noisy.z)
    by_setting = depth_from_focus(frames, noisy.z, FocusSettings(saturation=4095))
    assert not np.any(by_data_type.reasons & Reason.SATURATED)
    assert np.mean(by_setting.reasons & Reason.SATURATED > 0) > 0.5


def test_second_peak_is_marked(noisy):
    """The stack is repeated above itself, so that every pixel is in focus twice."""
    frames = np.concatenate([noisy.frames, noisy.frames])
    step = float(np.median(np.diff(noisy.z)))
    z = np.concatenate([noisy.z, noisy.z - noisy.z[0] + noisy.z[-1] + step])
    result = depth_from_focus(frames, z)
    assert np.mean((result.reasons & Reason.TWO_PEAKS)[INNER] > 0) > 0.95
    assert not np.any(depth_from_focus(noisy.frames, noisy.z).reasons[INNER] & Reason.TWO_PEAKS)


def test_good_pixel_has_no_reason(noisy):
    result = depth_from_focus(noisy.frames, noisy.z)
    assert np.mean(result.reasons[INNER] == 0) > 0.99


def test_pixel_with_two_reasons_counts_for_both():
    reasons = np.array([[0, Reason.NO_PEAK], [Reason.NO_PEAK | Reason.SATURATED, Reason.TWO_PEAKS]], np.uint8)
    counts = {
        'no_peak': 2,
        'scan_end': 0,
        'saturated': 1,
        'two_peaks': 1,
        'low_contrast': 0,
        'incomplete': 0,
        'few_pixels': 0,
        'out_of_picture': 0,
    }
    assert count_reasons(reasons) == counts
