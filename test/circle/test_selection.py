# SPDX-License-Identifier: Apache-2.0
"""The value at a rank."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.circle.selection import select

NUMBERS = st.lists(
    st.sampled_from([0.0, -1.0, 2.0, 3.5, np.inf]) | st.floats(allow_nan=False), min_size=1, max_size=60
)


@given(NUMBERS, st.integers(0, 59))
def test_selected_value_is_that_of_the_sorted_values_and_divides_the_others(numbers, rank):
    rank %= len(numbers)
    values = np.array(numbers)

    found = select(values, rank)

    assert found == sorted(numbers)[rank]
    assert (values[:rank] <= found).all()
    assert (values[rank:] >= found).all()
    np.testing.assert_array_equal(np.sort(values), np.sort(numbers))
