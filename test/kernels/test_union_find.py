# SPDX-License-Identifier: Apache-2.0
"""Disjoint sets."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.kernels.union_find import root_of


@given(st.integers(1, 40).flatmap(lambda n: st.tuples(*(st.integers(0, place) for place in range(n)))))
def test_the_root_is_the_end_of_the_path_and_path_halving_does_not_change_it(parents):
    def climbed(item):
        while parents[item] != item:
            item = parents[item]
        return item

    parent = np.array(parents, np.int32)
    expected = [climbed(item) for item in range(len(parents))]
    for _ in range(2):
        assert [root_of(parent, item) for item in range(len(parents))] == expected
