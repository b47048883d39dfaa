# SPDX-License-Identifier: Apache-2.0
"""What is kept of the focus curves is right, in whichever order the frames come."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import focus as naive

from socialcircle_ros.focus import FocusStack, Reason, depth_from_focus, focus_measure
from socialcircle_ros.focus.curve_rows import NO_FRAME, REACH, SLOTS
from socialcircle_ros.focus.order import RECENT
from socialcircle_ros.settings import FocusSettings


def noise(seed, count, dtype=np.uint8):
    """Frames of noise, with curves of many peaks: the worst case."""
    rng = np.random.default_rng(seed)
    amplitude = np.exp(-0.5 * ((np.arange(count) - rng.uniform(0, count)) / rng.uniform(1, 20)) ** 2)
    return (128 + rng.integers(-127, 128, (count, 9, 14)) * amplitude[:, None, None]).astype(dtype)


def measured(frames, order):
    stack = FocusStack()
    for index in order:
        stack.add(frames[index], float(index))
    return stack


def kept(stack):
    """Codes by place for each pixel, and the highest code elsewhere, once all frames are released."""
    order, curves = stack._order, stack._scales[0].curves
    for part in range(len(order.z), RECENT):
        curves.clear_slots(part)
    curves.release_all(order.rows, order.recent, order.places)
    return curves.arrays


def upward(count, _):
    return np.arange(count)


def downward(count, _):
    return np.arange(count)[::-1]


def neighbours_swapped(count, rng):
    """Each frame comes up to seven frames early or late."""
    return np.argsort(np.arange(count) + rng.uniform(0, 7.9, count), kind='stable')


def swapped_downward(count, rng):
    return neighbours_swapped(count, rng)[::-1]


def repeated(count, rng):
    return np.repeat(neighbours_swapped(count, rng), 2)


def shuffled(count, rng):
    return rng.permutation(count)


def shuffled_with_repeats(count, rng):
    return np.r_[rng.permutation(count), rng.integers(0, count, count)]


def there_and_back(count, _):
    return np.r_[0:count:2, count - 1 - count % 2 : 0 : -2]


def turning_late(count, rng):
    """A stage that trembles before it moves down."""
    start = count - min(count, 13)
    return np.r_[start + rng.permutation(count - start), np.arange(start)[::-1]]


IN_TURN = [upward, downward]
OUT_OF_TURN = [
    neighbours_swapped,
    swapped_downward,
    repeated,
    shuffled,
    shuffled_with_repeats,
    there_and_back,
    turning_late,
]


@pytest.mark.parametrize('order', IN_TURN)
@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(3, 45), st.booleans())
def test_all_is_kept_while_the_stage_moves_in_one_direction(order, seed, count, midway):
    frames = noise(seed, count)
    half = max(count // 2, 3)
    stack = measured(frames, order(count, None)[:half])
    if midway:
        stack.finish()  # changes nothing
    for index in order(count, None)[half:]:
        stack.add(frames[index], float(index))
    codes = np.stack([naive.codes_of(focus_measure(frame), naive.scale_of(frame)) for frame in frames])
    first, arrays = stack._order.first, kept(stack)
    for row, column in np.ndindex(codes.shape[1:]):
        centre, near, lowest, outside = naive.kept_of_curve(codes[:, row, column], REACH)
        assert arrays.centre[row, column] - first == centre
        assert arrays.peak[row, column] == near[centre]
        assert arrays.lowest[row, column] == lowest
        assert arrays.outside[row, column] == outside
        assert stack._scales[0].image[row, column] == frames[centre, row, column]
        for index, code in near.items():
            assert arrays.slots[row, (index + first) % SLOTS, column] == code


@pytest.mark.parametrize('order', OUT_OF_TURN)
@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(3, 45))
def test_frames_out_of_turn_may_be_missing_but_are_never_others(order, seed, count):
    frames = noise(seed, count)
    stack = measured(frames, order(count, np.random.default_rng(seed)))
    codes = np.stack([naive.codes_of(focus_measure(frame), naive.scale_of(frame)) for frame in frames])
    first, arrays = stack._order.first, kept(stack)
    for row, column in np.ndindex(codes.shape[1:]):
        centre, near, lowest, outside = naive.kept_of_curve(codes[:, row, column], REACH)
        assert arrays.centre[row, column] - first == centre
        assert arrays.peak[row, column] == near[centre]
        assert arrays.lowest[row, column] == lowest
        held = {index: int(arrays.slots[row, (index + first) % SLOTS, column]) for index in near}
        lost = [near[index] for index, code in held.items() if code == NO_FRAME]
        assert all(code in (near[index], NO_FRAME) for index, code in held.items())
        assert outside <= arrays.outside[row, column] <= max([outside, *lost])


@pytest.mark.parametrize('order', OUT_OF_TURN)
@pytest.mark.parametrize('fit', ['gauss', 'gauss3'])
@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(3, 45))
def test_pixels_without_a_mark_do_not_depend_on_the_order(order, fit, seed, count):
    frames = noise(seed, count)
    rule = FocusSettings(fit=fit, threshold=1)  # without a floor from the noise, which the order changes slightly
    stack = FocusStack(rule)
    for index in order(count, np.random.default_rng(seed)):
        stack.add(frames[index], float(index))
    result, expected = stack.finish(), depth_from_focus(frames, np.arange(count), rule)
    assert not np.any(expected.reasons & Reason.INCOMPLETE)
    np.testing.assert_array_equal(result.image, expected.image)
    whole = result.reasons & Reason.INCOMPLETE == 0
    np.testing.assert_array_equal(result.quality[whole], expected.quality[whole])
    assert (result.quality[~whole] <= 0.5).all()
    if fit == 'gauss3':  # the centroid correction also uses the depths of the neighbours
        np.testing.assert_array_equal(result.depth[whole], expected.depth[whole])


@pytest.mark.parametrize('order', [neighbours_swapped, swapped_downward])
def test_frames_that_are_little_late_lose_little(order):
    marked = [
        np.mean(
            measured(noise(seed, 40), order(40, np.random.default_rng(seed))).finish().reasons & Reason.INCOMPLETE
            > 0
        )
        for seed in range(8)
    ]
    assert np.mean(marked) < 0.2


def test_of_equally_sharp_frames_at_one_z_the_brighter_pixels_are_shown():
    frames, rule = noise(0, 12) // 2, FocusSettings(normalize=False)
    brighter = [frame + 1 for frame in frames]
    results = [
        depth_from_focus([*frames, *brighter], [*range(12), *range(12)], rule).image,
        depth_from_focus([*brighter, *frames], [*range(12), *range(12)], rule).image,
    ]
    np.testing.assert_array_equal(*results)
    np.testing.assert_array_equal(results[0], depth_from_focus(frames, np.arange(12), rule).image + 1)
