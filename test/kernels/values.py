# SPDX-License-Identifier: Apache-2.0
"""Values that a sort may meet."""

import numpy as np
from hypothesis import strategies as st

SMALLEST = float(np.finfo(np.float32).smallest_subnormal)
VALUES = st.one_of(
    st.floats(allow_nan=False, width=32),
    st.sampled_from([0.0, -0.0, np.inf, -np.inf, SMALLEST, -SMALLEST]),
    st.integers(-3, 3).map(float),  # many that are equal
)
"""Float32 numbers without NaN."""
