# SPDX-License-Identifier: Apache-2.0
"""Depth from whole focus stacks, frame by frame or at once, in any order of the frames."""

from fractions import Fraction

import numpy as np
import pytest
from focus.stacks import INNER, errors, same

from socialcircle_ros.errors import StackError
from socialcircle_ros.focus import FocusStack, depth_from_focus, focus_measure
from socialcircle_ros.settings import FocusSettings


@pytest.mark.parametrize(('name', 'most'), [('clean', 0.04), ('noisy', 0.08), ('fine', 0.10)])
def test_depth_error_is_a_small_part_of_the_step(name, most, request):
    stack = request.getfixturevalue(name)
    result = depth_from_focus(stack.frames, stack.z)
    wrong = errors(result, stack.truth)
    assert wrong.size == result.depth[INNER].size
    assert wrong.std() <= most
    assert abs(wrong.mean()) <= 0.01


def test_image_shows_each_pixel_from_its_sharpest_frame(noisy):
    result = depth_from_focus(noisy.frames, noisy.z, FocusSettings(normalize=False))
    curves = np.stack([focus_measure(frame) for frame in noisy.frames])
    best = curves.argmax(0)
    expected = np.take_along_axis(noisy.frames, best[None], 0)[0]
    nearly_equal = np.sort(curves, 0)[-2] > 0.9996 * curves.max(0)  # two frames may have the same code
    assert result.image.dtype == noisy.frames.dtype
    assert np.array_equal(result.image[~nearly_equal], expected[~nearly_equal])


@pytest.mark.parametrize('name', ['clean', 'noisy'])
def test_result_does_not_depend_on_the_order_of_the_frames(name, request):
    stack = request.getfixturevalue(name)
    upward = depth_from_focus(stack.frames, stack.z)
    count = len(stack.z)
    rng = np.random.default_rng(3)
    there_and_back = np.r_[0:count:2, count - 1 - count % 2 : 0 : -2]
    orders = [np.arange(count)[::-1], there_and_back, *(rng.permutation(count) for _ in range(3))]
    for order in orders:
        other = depth_from_focus(stack.frames[order], stack.z[order])
        assert np.array_equal(other.image, upward.image)
        assert np.array_equal(other.depth[INNER], upward.depth[INNER], equal_nan=True)
        assert np.array_equal(other.quality[INNER], upward.quality[INNER])
        assert np.array_equal(other.reasons[INNER], upward.reasons[INNER])


def test_order_changes_little_for_wide_and_noisy_curves(fine):
    upward = depth_from_focus(fine.frames, fine.z)
    order = np.random.default_rng(0).permutation(len(fine.z))
    shuffled = depth_from_focus(fine.frames[order], fine.z[order])
    assert np.mean(shuffled.reasons == upward.reasons) > 0.9
    assert np.nanquantile(np.abs(shuffled.depth - upward.depth), 0.9) < 0.01
    assert errors(shuffled, fine.truth).std() < 0.10


def test_z_and_frames_may_be_any_iterable_of_numbers(noisy):
    expected = depth_from_focus(noisy.frames, noisy.z)
    assert same(depth_from_focus(iter(noisy.frames), (z for z in noisy.z)), expected)
    assert same(depth_from_focus(tuple(noisy.frames), [np.array(z) for z in noisy.z]), expected)
    counted = range(len(noisy.z))
    assert same(depth_from_focus(noisy.frames, map(Fraction, counted)), depth_from_focus(noisy.frames, counted))


def test_repeated_frames_change_nothing(noisy):
    twice = depth_from_focus(np.repeat(noisy.frames, 2, 0), np.repeat(noisy.z, 2))
    assert same(twice, depth_from_focus(noisy.frames, noisy.z))
    again = depth_from_focus([*noisy.frames, *noisy.frames[::-1]], [*noisy.z, *noisy.z[::-1]])
    assert same(again, depth_from_focus(noisy.frames, noisy.z))


def test_missing_frames_do_not_bias_the_depth(clean):
    kept = np.delete(np.arange(len(clean.z)), [8, 12])
    wrong = errors(depth_from_focus(clean.frames[kept], clean.z[kept]), clean.truth)
    assert abs(wrong.mean()) < 0.03
    assert wrong.std() < 0.1


def test_frame_by_frame_equals_all_at_once(noisy):
    stack = FocusStack()
    for frame, z in zip(noisy.frames, noisy.z, strict=True):
        stack.add(frame, z)
    assert same(stack.finish(), depth_from_focus(noisy.frames, noisy.z))


def test_finish_midway_measures_the_frames_so_far_and_changes_nothing(noisy):
    stack = FocusStack()
    half = len(noisy.z) // 2
    for count, (frame, z) in enumerate(zip(noisy.frames, noisy.z, strict=True)):
        if count == half:
            midway = stack.finish()
            image = midway.image.copy()
        stack.add(frame, z)
    assert same(midway, depth_from_focus(noisy.frames[:half], noisy.z[:half]))
    assert np.array_equal(midway.image, image)
    assert same(stack.finish(), depth_from_focus(noisy.frames, noisy.z))


def test_reset_stack_equals_a_new_one(clean, noisy, fine):
    stack = FocusStack()
    for measured in (clean, fine, noisy):  # another data type, another number of frames, then the stack to compare
        for frame, z in zip(measured.frames, measured.z, strict=True):
            stack.add(frame, z)
        last = stack.finish()
        stack.reset()
        assert stack.places == 0
    assert same(last, depth_from_focus(noisy.frames, noisy.z))


def test_depth_is_as_accurate_far_from_zero(clean):
    """The offset is 10 mm and the step 1 µm, in metres."""
    result = depth_from_focus(clean.frames, 0.01 + clean.z * 1e-6)
    wrong = (result.depth - 0.01)[INNER] * 1e6 - clean.truth[INNER]
    assert wrong.std() <= 0.04


@pytest.mark.parametrize('frames', [30, 60])
def test_memory_does_not_grow_with_the_number_of_frames(frames):
    stack = FocusStack()
    rng = np.random.default_rng(0)
    for place in range(frames):
        stack.add(rng.integers(0, 65535, (40, 50), np.uint16), place)
    curves = [scale.curves for scale in stack._scales]
    held = sum(array.nbytes for each in curves for array in (*each.arrays, each.image))
    assert held == 60 * (40 * 50 + 10 * 12)  # the frame, and the frame of binned pixels


def test_threshold_keeps_the_depth_accurate_under_noise(noisy):
    result = depth_from_focus(noisy.frames, noisy.z, FocusSettings(threshold=12))
    assert errors(result, noisy.truth).std() < 0.08


NO_NUMBERS = [
    ('x', r"^A frame needs one number for its z, not 'x'\.$"),
    ('1.5', "not '1.5'"),
    (None, 'not None'),
    (np.zeros(1), r'not array\(\[0\.\]\)'),
    ([1.0], r'not \[1\.0\]'),
    ([[1.0], [1.0, 2.0]], 'one number'),
    (np.ma.masked, 'not masked'),
    (10**400, 'not 1000'),
]


class TestBadInput:
    @pytest.fixture
    def stack(self, noisy):
        stack = FocusStack()
        for frame, z in zip(noisy.frames[:8], noisy.z[:8], strict=True):
            stack.add(frame, z)
        return stack

    @pytest.mark.parametrize(
        ('frame', 'z', 'message'),
        [
            (np.zeros((5, 5), np.uint8), 1.0, r'\(5, 5\) uint8 cannot join a stack of \(96, 128\) uint8'),
            (np.zeros((96, 128), np.uint16), 1.0, 'uint16 cannot join'),
            (np.zeros((96, 128), np.float32), 1.0, 'must be uint8 or uint16'),
            (np.zeros((96, 128, 3), np.uint8), 1.0, 'must be a gray image'),
            (np.zeros((96, 128), np.uint8), float('nan'), 'finite z, not nan'),
            (np.zeros((96, 128), np.uint8), float('inf'), 'finite z, not inf'),
            (np.zeros((96, 128), np.uint8), np.float32('nan'), 'finite z, not nan'),
            *((np.zeros((96, 128), np.uint8), z, message) for z, message in NO_NUMBERS),
        ],
    )
    def test_bad_frame_is_refused_and_leaves_the_stack_unchanged(self, stack, frame, z, message):
        before = stack.finish()
        with pytest.raises(StackError, match=message):
            stack.add(frame, z)
        assert stack.places == 8
        assert same(stack.finish(), before)

    def test_fewer_than_three_z_are_refused(self, noisy):
        stack = FocusStack()
        with pytest.raises(StackError, match='three different z at least; the stack has 0'):
            stack.finish()
        for z in (1.0, 2.0, 2.0):
            stack.add(noisy.frames[0], z)
        with pytest.raises(StackError, match='three different z at least; the stack has 2'):
            stack.finish()

    @pytest.mark.filterwarnings('error::RuntimeWarning')
    @pytest.mark.parametrize('z', [(0.0, 1e294, 2e294), (-1.7e308, 0.0, 1.7e308), (0.0, 1e-6, 2e-6, 1e300)])
    def test_z_that_reach_too_far_for_float32_are_refused(self, noisy, z):
        with pytest.raises(StackError, match='too far: check their unit'):
            depth_from_focus(noisy.frames[: len(z)], z)

    @pytest.mark.filterwarnings('error::RuntimeWarning')
    @pytest.mark.parametrize(('z', 'message'), NO_NUMBERS)
    def test_one_z_that_is_no_number_is_refused_with_all(self, noisy, stack, z, message):
        with pytest.raises(StackError, match=message):
            depth_from_focus(noisy.frames[:4], [0.0, 1.0, z, 3.0])
        with pytest.raises(StackError, match=message):
            stack.finish([*noisy.z[:7], z])

    def test_a_column_of_z_and_what_has_no_items_are_refused(self, noisy, stack):
        with pytest.raises(StackError, match=r'one number for its z, not array\(\['):
            depth_from_focus(noisy.frames[:8], noisy.z[:8, None])
        with pytest.raises(StackError, match=r'one number for its z, not array\(\['):
            stack.finish(noisy.z[:8, None])
        for z in (1.0, None, np.array(1.0)):
            with pytest.raises(StackError, match='z must have one item for each frame, but is '):
                depth_from_focus(noisy.frames[:8], z)
        with pytest.raises(StackError, match='frames must have one item for each frame, but is None'):
            depth_from_focus(None, noisy.z)

    def test_different_numbers_of_frames_and_z_are_refused(self, noisy):
        with pytest.raises(StackError, match='3 frames and 2 z'):
            depth_from_focus(noisy.frames[:3], noisy.z[:2])


def test_result_does_not_depend_on_the_number_of_threads(monkeypatch):
    texture = np.random.default_rng(0).integers(0, 200, (41, 37)).astype(np.float32)
    stack = FocusStack()
    for place in range(15):
        stack.add((texture * np.exp(-(((place - 7) / 3) ** 2))).astype(np.uint8), float(place))
    one = stack.finish()
    monkeypatch.setattr('socialcircle_ros.kernels.bands._LEAST', 100)
    monkeypatch.setattr('socialcircle_ros.kernels.bands.limit', 3)
    three = stack.finish()
    for name in ('depth', 'quality', 'reasons', 'image'):
        np.testing.assert_array_equal(getattr(one, name), getattr(three, name))


def test_masked_colours_are_refused():
    frame = np.zeros((8, 9), np.uint8)
    colours = np.ma.masked_array(np.zeros((8, 9, 3), np.uint8), np.eye(8, 9)[..., None].repeat(3, axis=2))
    with pytest.raises(StackError, match='The colours of a frame cannot be masked'):
        FocusStack().add(frame, 0.0, colours)
