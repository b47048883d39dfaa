# SPDX-License-Identifier: Apache-2.0
"""Small clouds for the tests of the baselines."""

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst


@st.composite
def clouds(draw, most=14):
    """Organized clouds on a slightly uneven grid, with points that are not measured, in every layout."""
    shape = draw(st.tuples(st.integers(1, most), st.integers(1, most)))
    dtype = draw(st.sampled_from([np.float32, np.float64]))
    heights = draw(npst.arrays(np.int8, shape)) / 16
    kinds = draw(npst.arrays(np.int8, shape, elements=st.integers(0, 12)))
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    xyz = np.dstack([columns * 1.25 + heights / 64, rows * 1.25, heights]).astype(dtype)
    xyz[kinds == 0] = np.nan
    xyz[kinds == 1, 2] = np.inf
    xyz[kinds == 2, 0] = np.nan
    layout = draw(st.sampled_from(['plain', 'transposed', 'padded', 'reversed']))
    if layout == 'transposed':
        return xyz.transpose(1, 0, 2)
    if layout == 'padded':
        wide = np.zeros((*shape, 5), dtype)
        wide[..., 1:4] = xyz
        return wide[..., 1:4]
    return xyz[::-1, ::-1] if layout == 'reversed' else xyz


def rough(height, width, dtype=np.float32, seed=0):
    """A rough grid with spikes and gaps, and the mask of the spikes."""
    random = np.random.default_rng(seed)
    rows, columns = np.mgrid[:height, :width]
    z = random.normal(0, 0.2, (height, width))
    spikes = random.random((height, width)) < 0.03
    z[spikes] += random.choice([-9, 9], spikes.sum())
    xyz = np.dstack([columns, rows, z]).astype(dtype)
    gaps = random.random((height, width)) < 0.05
    xyz[gaps] = np.nan
    return xyz, spikes & ~gaps
