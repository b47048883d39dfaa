# SPDX-License-Identifier: Apache-2.0
"""Windows around points: the rows of a strip of the cloud, read once into separate x, y and z."""

import numpy as np

from socialcircle_ros.cloud import Cloud, Floats
from socialcircle_ros.kernels.compiled import kernel

STRIP = 256
"""Columns of a strip: few enough for the buffers of one strip to stay in the cache."""


@kernel
def load_strip_row(xyz: Cloud, row: int, left: int, rows: Floats) -> None:
    """Copy columns `left`, `left` + 1, ... of one row of the cloud into `rows` (3, n): x, y, z.

    x is NaN where a point is not measured or lies outside of the cloud, so that every distance to it is NaN.
    """
    height, width = xyz.shape[:2]
    first = max(-left, 0)
    last = max(min(width - left, rows.shape[1]), 0)
    if row < 0 or row >= height:
        last = 0
    rows[0, :first] = np.nan
    for column in range(first, last):
        x, y, z = xyz[row, left + column, 0], xyz[row, left + column, 1], xyz[row, left + column, 2]
        # 0 · finite is 0, 0 · Inf and 0 · NaN are NaN: the sum leaves x as it is, or makes it NaN.
        rows[0, column] = x + ((x * 0 + y * 0) + z * 0)
        rows[1, column] = y
        rows[2, column] = z
    rows[0, last:] = np.nan
