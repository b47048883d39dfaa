# SPDX-License-Identifier: Apache-2.0
"""Frames that were lost are numbered by the stamps of those that came."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.errors import StackError
from socialcircle_ros.pipeline.frame_stamps import frame_numbers, period_of

PERIOD = 20_000_000


@given(
    st.lists(st.integers(0, 4), min_size=7, max_size=60).filter(
        lambda lost: sum(n == 0 for n in lost) > len(lost) / 2
    ),
    st.integers(1, 10**9),
    st.integers(0, 2**60),
)
def test_gaps_of_whole_periods_are_lost_frames(lost, period, start):
    numbers = np.r_[0, np.cumsum(np.asarray(lost) + 1)]
    np.testing.assert_array_equal(frame_numbers((start + numbers * period).tolist()), numbers)


@given(st.integers(0, 2**32 - 1), st.floats(0, 0.1))
def test_jitter_and_late_stamps_are_no_lost_frames(seed, jitter):
    rng = np.random.default_rng(seed)
    numbers = np.arange(300)
    stamps = numbers * PERIOD * 1.0003 + rng.uniform(0, jitter, 300) * PERIOD
    stamps[rng.choice(np.arange(10, 290, 20), 3)] += 0.8 * PERIOD
    np.testing.assert_array_equal(frame_numbers(np.sort(stamps).astype(int).tolist()), numbers)


def test_a_gap_that_is_no_whole_number_of_periods_is_refused():
    stamps = np.arange(12) * PERIOD
    stamps[7:] += int(1.5 * PERIOD)
    with pytest.raises(StackError, match='show 2.50 periods of 20 ms between its frames 6 and 7'):
        frame_numbers(stamps.tolist())


def test_a_period_that_changes_is_refused():
    times = np.r_[np.full(20, PERIOD), np.full(20, int(1.2 * PERIOD))]
    with pytest.raises(StackError, match='deviate by'):
        frame_numbers(np.cumsum(times).tolist())


@pytest.mark.parametrize('stamps', [[], [5], [5, 9], [0] * 9, [1, 1, 1, 1, 2]])
def test_stamps_that_tell_nothing_number_nothing(stamps):
    assert frame_numbers(stamps) is None


def test_period_is_the_median():
    assert period_of([0, 10, 20, 31, 60]) == 10
