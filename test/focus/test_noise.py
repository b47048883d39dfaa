# SPDX-License-Identifier: Apache-2.0
"""What noise and rounding give is no peak, and texture above them is."""

import numpy as np
import pytest
from focus.stacks import INNER, errors, make_stack
from hypothesis import example, given
from hypothesis import strategies as st

from socialcircle_ros.focus import FocusStack, depth_from_focus, focus_measure
from socialcircle_ros.focus.measure import MeasureParameters
from socialcircle_ros.focus.noise import NoiseSampler, spread_rows
from socialcircle_ros.settings import FocusSettings


def blank(seed, *, noise, level, dtype=np.uint8, unit=1, count=24, shape=(70, 96)):
    """Frames of a smooth slope of light without texture, with flicker."""
    rng = np.random.default_rng(seed)
    slope = level * (1 + 0.3 * np.linspace(0, 1, shape[1]) + 0.2 * np.linspace(0, 1, shape[0])[:, None])
    for _ in range(count):
        light = slope * (1 + 0.01 * rng.standard_normal()) + noise * rng.standard_normal(shape)
        yield np.clip(np.rint(light), 0, 255).astype(dtype) * dtype(unit)


@pytest.mark.parametrize('noise', [0.0, 0.15, 0.4, 1.0, 4.0])
@pytest.mark.parametrize(
    ('level', 'dtype', 'unit'), [(12, np.uint8, 1), (120, np.uint8, 1), (120, np.uint16, 256)]
)
def test_blank_areas_are_not_trusted(noise, level, dtype, unit):
    frames = list(blank(1, noise=noise, level=level, dtype=dtype, unit=unit))
    result = depth_from_focus(frames, np.arange(len(frames)))
    assert np.mean(result.quality >= 0.9) == 0
    assert np.mean(np.isfinite(result.depth)) < 0.15


@pytest.mark.parametrize('direction', [1, -1])
def test_floor_is_the_focus_measure_of_noise(direction):
    rng = np.random.default_rng(0)
    parameters = MeasureParameters.of(FocusSettings())
    texture = 5000 * rng.random((90, 200))
    frames = [
        np.rint(20000 + (texture if 10 < k < 14 else 0) + 300 * rng.standard_normal((90, 200))).astype(np.uint16)
        for k in range(25)
    ][::direction]
    sampler = NoiseSampler(frames[0], parameters)
    for frame in frames:
        sampler.add(frame, 1.0)
    floor = sampler.floor(frames[0], 1.0)
    codes = floor.table[frames[0].astype(int) >> floor.shift] + floor.rows[:, None] + floor.columns
    measured = focus_measure(frames[0 if direction > 0 else -1])
    ratio = 2.0 ** ((codes - 1) / 2048) / measured
    assert 0.8 < np.median(ratio[INNER]) < 1.1
    assert 0.7 < np.median(ratio[:3]) < 1.2  # the window is cut off at the edge
    assert 0.7 < np.median(ratio[:, -3:]) < 1.2


def test_the_direction_of_the_scan_does_not_change_the_floor(noisy):
    results = []
    for order in (slice(None), slice(None, None, -1)):
        stack = FocusStack()
        for frame, z in zip(noisy.frames[order], noisy.z[order], strict=True):
            stack.add(frame, z)
        results.append(stack.finish())
    for name in ('depth', 'quality', 'image', 'reasons'):
        np.testing.assert_array_equal(getattr(results[0], name), getattr(results[1], name))


def test_weak_texture_is_kept():
    stack = make_stack(5, electrons=20000, contrast=0.06, width=2.6, margin=14.0)
    result = depth_from_focus(stack.frames, stack.z)
    assert np.mean(np.isfinite(result.depth[INNER])) > 0.99
    assert np.mean(result.quality[INNER] >= 0.5) > 0.98
    assert errors(result, stack.truth).std() < 0.3


@given(height=st.integers(16, 9000), period=st.integers(2, 16))
@example(height=1020, period=4)  # evenly spaced rows have one phase there
def test_the_rows_of_the_noise_see_all_phases_of_a_period(height, period):
    rows = spread_rows(height)
    assert len(rows) == 16
    assert np.all(np.diff(rows) > 0)
    assert 0 <= rows[0] <= rows[-1] < height
    assert np.diff(rows).max() <= 2 * height / 16
    assert np.bincount(rows % period).max() <= 5 + 16 // period


@pytest.mark.parametrize(('height', 'count'), [(-4, 0), (0, 0), (1, 1), (5, 5), (15, 15)])
def test_a_low_frame_has_fewer_rows_for_the_noise(height, count):
    assert spread_rows(height).tolist() == list(range(count))


@pytest.mark.parametrize(('height', 'period'), [(65, 4), (125, 8)])
def test_weak_texture_beside_a_ruling_is_kept_wherever_the_lines_are(height, period):
    """At these heights evenly spaced rows are all at one phase; if that was the lines, all of it was lost."""
    z, rng = np.arange(25.0), np.random.default_rng(0)
    noise, weak = rng.standard_normal((25, height, 160)), 2 * rng.standard_normal((height, 80))
    sharpness = np.exp(-((z[:, None, None] - 9 - 6 * np.arange(160) / 160) ** 2) / 8)
    for phase in range(period):
        lines = np.where((np.arange(height) - phase) % period == 0, 100, -100 / (period - 1))
        part = np.hstack([np.repeat(lines[:, None], 80, 1), weak])
        frames = np.rint(100 + part * sharpness + noise).clip(0, 255).astype(np.uint8)
        depth = depth_from_focus(frames, z).depth
        assert np.isfinite(depth[:, 90:]).mean() > 0.99
