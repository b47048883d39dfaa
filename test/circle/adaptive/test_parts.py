# SPDX-License-Identifier: Apache-2.0
"""Removed islands that the network takes for parts of the surface."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import adaptive as naive

from socialcircle_ros.circle.adaptive.communities import label_communities
from socialcircle_ros.circle.adaptive.parts import taken_for_parts


@settings(max_examples=100)
@given(st.integers(0, 2**32), st.integers(1, 40), st.integers(1, 40), st.sampled_from([0.1, 0.5, 0.9]))
def test_parts_equal_the_reference(seed, height, width, share):
    random = np.random.default_rng(seed)
    outliers = np.kron(random.random((height // 8 + 1, width // 8 + 1)) < 0.4, np.ones((8, 8), bool))
    outliers[:, 12:13] = False
    known = (random.random(outliers.shape) < share) & outliers

    parts = taken_for_parts(label_communities(outliers), known)

    sizes = naive.taken_for_parts(outliers, known)
    assert parts == (len(sizes), sum(sizes), max(sizes, default=0))
