# SPDX-License-Identifier: Apache-2.0
"""The sideways drift of a focus stack is measured, or nothing is said about it."""

import numpy as np
import pytest
from focus.stacks import make_stack
from simulated_drift import drifting_frames

from socialcircle_ros.focus import FocusStack, depth_from_focus
from socialcircle_ros.focus.drift import DriftMeter, _thin
from socialcircle_ros.simulation import Camera


def drift_of(frames):
    meter = DriftMeter()
    for frame in frames:
        meter.add(np.ascontiguousarray(frame))
    return meter.drift


@pytest.mark.parametrize('specimen', ['flat', 'metal_groove'])
@pytest.mark.parametrize('moved', [(0, 0), (0, 1.5), (-2, 0), (3, 4)])
def test_a_known_drift_is_measured(specimen, moved):
    found = drift_of(drifting_frames(specimen, moved, shape=(176, 224)))
    # What is out of focus on the walls of the groove seems to move.
    assert found == pytest.approx(np.hypot(*moved), abs=0.8 if specimen == 'metal_groove' else 0.3)


def test_the_direction_of_the_scan_changes_little():
    frames = drifting_frames('flat', (2, -3))
    assert drift_of(frames[::-1]) == pytest.approx(drift_of(frames), abs=0.3)


def test_drift_there_and_back_counts_once():
    path = 4 * np.sin(np.linspace(0, np.pi, 15))
    frames = drifting_frames('flat', [(0, x) for x in path])
    assert drift_of(frames) == pytest.approx(4, abs=0.6)


@pytest.mark.parametrize('change', ['flicker', 'ramp'])
def test_light_that_changes_is_no_drift(change):
    frames = drifting_frames('flat', (0, 3))
    count = len(frames)
    shares = np.linspace(0.4, 1, count)
    if change == 'flicker':
        shares = 0.8 * (1 + 0.1 * np.random.default_rng(0).standard_normal(count))
    dimmed = [np.rint(frame * share).astype(np.uint8) for frame, share in zip(frames, shares, strict=True)]
    assert drift_of(dimmed) == pytest.approx(3, abs=0.6)


@pytest.mark.parametrize('tilt', [0.05, 0.2])
def test_a_band_in_focus_that_wanders_over_a_tilted_part_is_no_drift(tilt):
    found = drift_of(make_stack(seed=2, tilt=tilt, electrons=6000, shape=(120, 160)).frames)
    assert found is None or found < 1.5


@pytest.mark.parametrize('camera', [Camera(), Camera(exposure=0.12), Camera(bits=12, full_well=100_000)])
@pytest.mark.parametrize('lit', ['evenly', 'unevenly', 'not'])
def test_a_stack_without_texture_has_no_drift(camera, lit):
    shape = (150, 190)
    y, x = (np.mgrid[:150, :190] / np.array(shape)[:, None, None]) - 0.5
    light = {'evenly': 0.5 + 0 * x, 'unevenly': 0.9 * np.exp(-4 * (x**2 + y**2)), 'not': 0 * x}[lit]
    sensor = camera.sensor(shape, 1)
    frames = [sensor.expose(light.astype(np.float32), seed) for seed in range(10)]
    assert drift_of(frames) is None


def test_along_grooves_no_drift_is_made_up():
    """Texture in one direction tells nothing about the other."""
    rng = np.random.default_rng(4)
    profile = 100 + 30 * rng.standard_normal(250)
    frames = [
        np.clip(profile[k : k + 200] + 2 * rng.standard_normal((150, 200)), 0, 255).astype(np.uint8)
        for k in range(7)
    ]
    assert drift_of(frames) == pytest.approx(6, abs=0.3)
    assert drift_of([frame.T for frame in frames]) == pytest.approx(6, abs=0.3)


def test_frames_that_do_not_belong_together_have_no_drift():
    rng = np.random.default_rng(0)
    assert drift_of(rng.integers(0, 255, (10, 100, 140), np.uint8)) is None


@pytest.mark.parametrize('shape', [(1, 1), (5, 400), (31, 40), (32, 33)])
def test_small_frames_do_no_harm(shape):
    rng = np.random.default_rng(0)
    assert drift_of(rng.integers(0, 255, (7, *shape), np.uint8)) is None


@pytest.mark.parametrize(('shape', 'side'), [((7, 11), 3), ((4, 4), 2), ((9, 5), 5)])
@pytest.mark.parametrize('dtype', [np.uint8, np.uint16])
def test_thinning_adds_up_squares(shape, side, dtype):
    frame = np.random.default_rng(1).integers(0, np.iinfo(dtype).max, shape, dtype, endpoint=True)
    frame[:side, :side] = 0
    rows, columns = shape[0] // side, shape[1] // side
    thinned = np.empty((rows, columns), np.float32)
    _thin(frame, side, thinned)
    squares = frame[: rows * side, : columns * side].astype(float).reshape(rows, side, columns, side)
    np.testing.assert_allclose(thinned, np.maximum(squares.sum((1, 3)), 1), rtol=1e-6)


def test_the_result_of_a_stack_has_the_drift_of_its_own_frames():
    frames = drifting_frames('flat', (0, 4))
    z = np.arange(len(frames))
    assert depth_from_focus(frames, z).drift == pytest.approx(4, abs=0.6)
    stack = FocusStack()
    for k, frame in enumerate(frames):
        stack.add(frame, k)
    stack.reset()
    for k in z:
        stack.add(frames[0], k)
    assert stack.finish().drift == pytest.approx(0, abs=0.1)
