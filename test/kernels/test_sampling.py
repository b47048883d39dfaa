# SPDX-License-Identifier: Apache-2.0
"""The rows that stand for all."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.kernels.sampling import SAMPLES, sampled_rows


@given(st.integers(1, 5000), st.integers(1, 5000))
def test_rows_exist_come_once_and_are_neither_few_nor_many(height, width):
    rows = sampled_rows(height, width)
    assert (np.diff(rows) > 0).all()
    assert 0 <= rows[0] <= rows[-1] < height
    assert len(rows) >= min(height, 12)
    assert len(rows) * width <= 4 * SAMPLES


def test_all_rows_of_a_small_cloud_are_taken():
    assert sampled_rows(300, 200).tolist() == list(range(300))


@pytest.mark.parametrize('period', [4, 6, 10, 12])
def test_a_fine_ruling_is_seen_at_all_its_places(period):
    rows = sampled_rows(2000, 2000)
    seen = np.bincount(rows % period, minlength=period)
    assert seen.min() >= seen.max() / 2
