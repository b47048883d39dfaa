"""What is kept of the focus curves is right, in whichever order the frames come."""

import numpy as np
import pytest

from socialcircle_ros.focus import FocusStack, focus_measure
from socialcircle_ros.focus.curve_rows import CODES_PER_OCTAVE, SLOTS


def code_of(measure):
    """1 + CODES_PER_OCTAVE log2 F, rounded; 0 where F is 0."""
    with np.errstate(divide='ignore'):
        return np.where(measure > 0, np.rint(1 + CODES_PER_OCTAVE * np.log2(measure)), 0)


def upward(count, _):
    return np.arange(count)


def downward(count, _):
    return np.arange(count)[::-1]


def shuffled(count, rng):
    return rng.permutation(count)


def shuffled_with_repeats(count, rng):
    return np.r_[rng.permutation(count), rng.integers(0, count, count)]


def there_and_back(count, _):
    return np.r_[0:count:2, count - 1 - count % 2 : 0 : -2]


@pytest.mark.parametrize('order', [upward, downward, shuffled, shuffled_with_repeats, there_and_back])
@pytest.mark.parametrize('seed', range(6))
def test_kept_codes_are_those_of_their_frames(order, seed):
    """Noise with many peaks is the worst case. Frames may be missing, but no slot may hold another frame."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 50))
    amplitude = np.exp(-0.5 * ((np.arange(count) - rng.uniform(0, count)) / rng.uniform(1, 20)) ** 2)
    frames = (128 + rng.integers(-127, 128, (count, 9, 14)) * amplitude[:, None, None]).astype(np.uint8)
    stack = FocusStack()
    for index in order(count, rng):
        stack.add(frames[index], float(index))
    curves, image = stack._curves.arrays, stack._curves.image
    codes = np.stack([code_of(focus_measure(frame)) for frame in frames])

    centre = curves.centre - stack._first
    assert np.all(np.abs(curves.peak - codes.max(0)) <= 1)
    assert np.all(np.abs(curves.lowest - codes.min(0)) <= 1)
    assert np.all(np.take_along_axis(codes, centre[None], 0)[0] >= codes.max(0) - 1)
    assert np.array_equal(image, np.take_along_axis(frames, centre[None], 0)[0])
    kept = 0
    for row, column in np.ndindex(centre.shape):
        here = int(centre[row, column])
        for index in range(max(here - 7, 0), min(here + 8, count)):
            place = index + stack._first
            code = int(curves.slots[row, place % SLOTS, column])
            if curves.valid_from[row, column] <= place <= curves.valid_to[row, column] and code:
                assert abs(code - codes[index, row, column]) <= 1
                kept += 1
    assert kept >= 0.8 * centre.size * min(count, 8)
