# SPDX-License-Identifier: Apache-2.0
"""Frames that moved or grew are measured where the first frame shows the part."""

import numpy as np
import pytest
from focus.stacks import make_stack, same
from hypothesis import given, settings
from hypothesis import strategies as st

from socialcircle_ros.focus import FocusStack, PixelCurve, Reason, depth_from_focus
from socialcircle_ros.focus.registration import _WEIGHTS, Motion, Registration, _resample, _sampling
from socialcircle_ros.settings import FocusSettings
from socialcircle_ros.studies.bench.depth_trust import INNER, moving_frames


def rms(scan, result):
    found = np.full(scan.truth.depth.shape, np.nan)
    found[INNER] = result.depth
    error = scan.truth.classify(found).error / scan.optics.depth_of_field
    return np.sqrt(np.mean(error[np.abs(error) < 1] ** 2))


@pytest.mark.parametrize('specimen', ['flat', 'ball'])
@pytest.mark.parametrize(('moved', 'magnification'), [((-3.0, 6.0), 0.0), ((0.0, 0.0), 0.03), ((4.0, 2.0), -0.03)])
def test_motion_is_found_and_corrected(specimen, moved, magnification):
    scan, frames, z = moving_frames(specimen, moved, magnification, seed=5)
    plain, corrected = depth_from_focus(frames, z), depth_from_focus(frames, z, register=True)
    assert plain.registered is None
    assert rms(scan, corrected) < 0.7 * rms(scan, plain)
    assert corrected.registered.failed == 0
    assert max(corrected.registered.magnification, 1) == pytest.approx(
        max(1 + magnification, 1 / (1 + magnification)), abs=0.004
    )
    height, width = frames[0].shape
    corner = np.hypot(
        abs(moved[0]) + abs(magnification) * height / 2, abs(moved[1]) + abs(magnification) * width / 2
    )
    assert corrected.registered.moved == pytest.approx(corner, abs=0.7)


def test_what_left_the_picture_is_not_measured_and_marked():
    _, frames, z = moving_frames('flat', (0.0, 9.0), 0.0, seed=5)
    result = depth_from_focus(frames, z, FocusSettings(step=2), register=True)
    marked = result.reasons & Reason.OUT_OF_PICTURE > 0
    columns = np.flatnonzero(marked.all(axis=0))
    # The part moves to the right by 9 pixels, so that its right edge leaves the picture; 6 are the reach of F.
    assert abs(len(columns) - (9 + 6)) <= 1
    assert columns[-1] == frames[0].shape[1] - 1
    assert np.isnan(result.depth[marked]).all()
    assert np.all(result.quality[marked] == 0)
    assert np.isfinite(result.depth[~marked]).mean() > 0.95


def test_a_steady_stack_loses_nothing():
    scan, frames, z = moving_frames('flat', (0.0, 0.0), 0.0, seed=6)
    plain, corrected = depth_from_focus(frames, z), depth_from_focus(frames, z, register=True)
    assert not np.any(corrected.reasons & Reason.OUT_OF_PICTURE)
    assert rms(scan, corrected) < 1.05 * rms(scan, plain)
    assert corrected.registered.moved < 0.3


def test_the_order_of_the_frames_changes_nothing():
    _, frames, z = moving_frames('flat', (0.0, 4.0), 0.01, seed=5)
    upward = depth_from_focus(frames, z, register=True)
    order = np.random.default_rng(0).permutation(len(z))
    assert same(depth_from_focus([frames[k] for k in order], z[order], register=True), upward)
    streamed = FocusStack(register=True)
    for frame, position in zip(frames, z, strict=True):
        streamed.add(frame, position)
    assert same(streamed.finish(), upward)
    assert streamed.finish().registered == upward.registered


def test_downward_the_heights_are_those_where_the_highest_frame_shows_the_part():
    scan, frames, z = moving_frames('ball', (0.0, 6.0), 0.0, seed=5)
    downward = FocusStack(register=True)
    for k in range(len(z))[::-1]:
        downward.add(frames[k], z[k])
    inner = np.s_[20:-20, 20:-20]
    truth = scan.truth.depth[INNER]
    moved = np.roll(truth, 6, axis=1)
    depth = downward.finish().depth
    errors = [np.nanmedian(np.abs(depth - each)[inner]) for each in (moved, truth)]
    assert errors[0] < 0.7 * errors[1]


def test_a_stack_is_registered_from_its_own_first_frame():
    _, frames, z = moving_frames('flat', (0.0, 4.0), 0.0, seed=5)
    stack = FocusStack(register=True)
    for frame, position in zip(frames[::-1], z, strict=True):
        stack.add(frame, position)
    stack.reset()
    for frame, position in zip(frames, z, strict=True):
        stack.add(frame, position)
    assert same(stack.finish(), depth_from_focus(frames, z, register=True))
    stack.reset()
    stack.register = False
    for frame, position in zip(frames, z, strict=True):
        stack.add(frame, position)
    assert stack.finish().registered is None


def test_the_curve_of_a_pixel_is_that_of_registered_frames():
    _, frames, z = moving_frames('flat', (0.0, 8.0), 0.0, seed=5)
    curves = []
    for register in (False, True):
        pixel = PixelCurve(FocusSettings(), (90, 100))
        pixel.register = register
        for frame, position in zip(frames, z, strict=True):
            pixel.add(frame, position)
        pixel.finish()
        curves.append(pixel.curve.measure)
    assert curves[0][0] == curves[1][0]
    assert not np.allclose(curves[0][-3:], curves[1][-3:], rtol=0.02)


def test_frames_that_cannot_be_compared_are_counted():
    frames = np.random.default_rng(0).integers(0, 255, (6, 100, 140), np.uint8)
    result = depth_from_focus(frames, np.arange(6), register=True)
    assert (result.registered.failed, result.registered.moved) == (5, 0)


@pytest.mark.parametrize('shape', [(1, 1), (40, 300), (47, 60)])
def test_small_frames_are_not_moved(shape):
    frames = np.random.default_rng(0).integers(0, 255, (5, *shape), np.uint8)
    registered, plain = (depth_from_focus(frames, np.arange(5), register=each) for each in (True, False))
    assert same(registered, plain)
    assert registered.registered.moved == 0


def test_colours_move_along():
    _, frames, _ = moving_frames('flat', (0.0, 5.0), 0.0, seed=5)
    colours = [np.repeat(frame[..., None], 3, axis=2) for frame in frames]
    registration = Registration(frames[0].shape)
    for frame, colour in zip(frames, colours, strict=True):
        registered, moved = registration.add(frame, colour)
    assert np.array_equal(moved[:, :200, 0], colours[-1][:, 5:205, 0])
    assert np.abs(moved[:, :200, 0].astype(int) - registered[:, :200]).mean() < 10


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 999),
    height=st.integers(1, 12),
    width=st.integers(1, 15),
    down=st.integers(-3, 3),
    right=st.floats(-3, 3),
    magnification=st.floats(0.9, 1.1),
    dtype=st.sampled_from([np.uint8, np.uint16]),
)
def test_interpolation_equals_the_reference(seed, height, width, down, right, magnification, dtype):
    frame = np.random.default_rng(seed).integers(0, np.iinfo(dtype).max, (height, width), dtype, endpoint=True)
    rows, columns = _sampling(height, 1.0, down), _sampling(width, magnification, right)
    found = np.empty_like(frame)
    _resample(frame, rows, columns, _WEIGHTS, found)
    at = np.rint(64 * (magnification * (np.arange(width) - (width - 1) / 2) + (width - 1) / 2 + right)) / 64
    at = np.clip(at, 0, width - 1)
    expected = np.empty(frame.shape)
    for row in range(height):
        pixels = frame[min(max(row + down, 0), height - 1)].astype(float)
        for column, x in enumerate(at):
            near = np.arange(int(np.floor(x)) - 2, int(np.floor(x)) + 4)
            weights = np.sinc(x - near) * np.sinc((x - near) / 3)
            expected[row, column] = weights @ pixels[np.clip(near, 0, width - 1)] / weights.sum()
    expected = np.clip(expected, 0, np.iinfo(dtype).max)
    np.testing.assert_allclose(found, expected, atol=0.52 if dtype == np.uint8 else 0.6)


def test_motions_follow_each_other():
    one, two = Motion(3.0, -2.0, 1.1), Motion(-1.0, 5.0, 0.9)
    at = np.array([7.0, -4.0])
    first = one.magnification * at + (one.down, one.right)
    both = two.after(one)
    np.testing.assert_allclose(
        both.magnification * at + (both.down, both.right), two.magnification * first + (two.down, two.right)
    )


def test_a_textured_stack_of_another_kind_is_not_spoilt():
    stack = make_stack(seed=2, electrons=6000)
    plain, registered = (depth_from_focus(stack.frames, stack.z, register=each) for each in (False, True))
    errors = [np.nanmedian(np.abs(each.depth - stack.truth)) for each in (plain, registered)]
    assert errors[1] < 1.3 * errors[0] + 0.01
