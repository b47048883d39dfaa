# SPDX-License-Identifier: Apache-2.0
"""The focus measure is exact, and refuses what is not a frame."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import focus as naive

from socialcircle_ros.errors import StackError
from socialcircle_ros.focus import focus_measure
from socialcircle_ros.settings import FocusSettings


def _noise(shape, dtype, seed=0):
    return np.random.default_rng(seed).integers(0, np.iinfo(dtype).max, shape, dtype, endpoint=True)


@pytest.mark.parametrize('dtype', [np.uint8, np.uint16])
@pytest.mark.parametrize('threshold', [0, 300, 262140])
def test_measure_equals_the_reference(dtype, threshold):
    frame = _noise((23, 31), dtype)
    measure = focus_measure(frame, FocusSettings(step=2, half_window=3, threshold=threshold))
    assert np.array_equal(measure, naive.focus_measure(frame, 2, 3, threshold))


@settings(max_examples=40, deadline=None)
@given(
    height=st.integers(1, 20),
    width=st.integers(1, 20),
    step=st.integers(1, 8),
    half_window=st.integers(0, 15),
    seed=st.integers(0, 99),
)
def test_borders_of_frames_of_any_size_equal_the_reference(height, width, step, half_window, seed):
    frame = _noise((height, width), np.uint8, seed)
    measure = focus_measure(frame, FocusSettings(step=step, half_window=half_window))
    assert np.array_equal(measure, naive.focus_measure(frame, step, half_window, 0))


def test_largest_possible_sum_is_exact():
    frame = np.zeros((40, 40), np.uint16)
    frame[::2, ::2] = frame[1::2, 1::2] = 65535
    settings_ = FocusSettings(step=1, half_window=15)
    assert np.array_equal(focus_measure(frame, settings_), naive.focus_measure(frame, 1, 15, 0))
    assert focus_measure(frame, settings_).max() > 250_000_000 * 29**2 // 31**2


def test_views_and_read_only_frames_are_accepted():
    whole = _noise((40, 60), np.uint8)
    view = whole[3:33:2, 50:10:-2]
    assert np.array_equal(focus_measure(view), focus_measure(view.copy()))
    whole.flags.writeable = False
    assert np.array_equal(focus_measure(whole), focus_measure(whole.copy()))


@pytest.mark.parametrize(
    ('frame', 'message'),
    [
        (np.zeros((4, 4, 3), np.uint8), r'gray image of shape \(H, W\), not \(4, 4, 3\)'),
        (np.zeros((0, 4), np.uint8), 'gray image'),
        (np.zeros((4, 4)), 'uint8 or uint16 .* not float64'),
        (np.zeros((4, 4), np.dtype(np.uint16).newbyteorder()), 'byte order'),
        (np.ma.masked_array(np.zeros((4, 4), np.uint8), np.eye(4)), 'cannot have masked pixels'),
    ],
)
def test_array_that_is_not_a_frame_is_refused(frame, message):
    with pytest.raises(StackError, match=message):
        focus_measure(frame)
