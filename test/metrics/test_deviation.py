# SPDX-License-Identifier: Apache-2.0
"""How far outliers lie from the surface round them."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.metrics.deviation import deviation


def naive(heights, outliers):
    """Over the mean of the kept points in the 3×3 blocks round each outlier; blocks grow until there is one."""
    found = np.full(heights.shape, np.nan)
    kept = np.isfinite(heights) & ~outliers
    for row, column in np.argwhere(outliers & np.isfinite(heights)):
        size = 1
        while size < 4 * max(heights.shape):
            top, left = (row // size - 1) * size, (column // size - 1) * size
            near = np.s_[max(0, top) : top + 3 * size, max(0, left) : left + 3 * size]
            if kept[near].any():
                found[row, column] = heights[row, column] - heights[near][kept[near]].mean()
                break
            size *= 2
    return found


@given(
    shape=st.tuples(st.integers(1, 23), st.integers(1, 17)), share=st.floats(0.0, 1.0), seed=st.integers(0, 99),
    scale=st.sampled_from([1e-6, 1.0, -1e5]),
)  # fmt: skip
def test_it_equals_the_slow_reference(shape, share, seed, scale):
    random = np.random.default_rng(seed)
    heights = scale * random.normal(size=shape)
    heights[random.random(shape) < 0.1] = np.nan
    outliers = random.random(shape) < share
    np.testing.assert_allclose(
        deviation(heights, outliers), naive(heights, outliers), rtol=1e-9, atol=1e-9 * abs(scale)
    )


def test_a_spike_stands_out_by_its_height_over_a_slope():
    rows, columns = np.mgrid[:30, :40].astype(np.float32)
    heights = 0.5 * rows - 0.2 * columns
    heights[12, 20] += 7
    outliers = np.zeros(heights.shape, bool)
    outliers[12, 20] = True
    assert deviation(heights, outliers)[12, 20].round(4) == 7
