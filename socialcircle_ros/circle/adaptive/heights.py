# SPDX-License-Identifier: Apache-2.0
"""The heights that the adaptive mode works on, and how it fills holes in them."""

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask
from socialcircle_ros.kernels.compiled import kernel

RelativeHeights = npt.NDArray[np.float32]
"""(H, W) float32, NaN where not measured."""

_SAMPLES = 10_000
_FURTHEST = float(np.finfo(np.float32).max) / 16
"""Greatest height: sums and differences of several such heights are finite in float32."""
_RINGS = 6
_LEAST_NEIGHBOURS = 3


def relative_heights(heights: npt.NDArray[np.float32] | npt.NDArray[np.float64]) -> RelativeHeights:
    """Convert heights to float32 without losing digits to an offset.

    Args:
        heights: (H, W) float32 or float64, NaN where not measured; at least one height is measured.

    Returns:
        (H, W) float32, contiguous. Float32 heights are unchanged; float64 heights are relative to about their
        median, and clipped to what float32 can add up.
    """
    if heights.dtype == np.float32:
        return np.ascontiguousarray(heights, np.float32)
    sample = heights[np.isfinite(heights)]
    with np.errstate(over='ignore'):
        relative = heights - np.median(sample[:: max(1, sample.size // _SAMPLES)])
    return np.clip(relative, -_FURTHEST, _FURTHEST).astype(np.float32, order='C')


def with_holes_filled(heights: RelativeHeights, holes: Mask) -> RelativeHeights:
    """Fill holes ring by ring, each point with the mean of its known neighbours.

    The result serves to examine the remaining points; it is never published.

    Args:
        heights: (H, W) float32, NaN where not measured.
        holes: (H, W) bool.

    Returns:
        (H, W) float32, a copy. The innermost points of holes that are deeper than six rings are NaN.
    """
    filled = heights.copy()
    points = np.flatnonzero(holes)
    filled.ravel()[points] = np.nan
    _fill(filled, points)
    return filled


@kernel
def _fill(heights: RelativeHeights, holes: npt.NDArray[np.int64]) -> None:
    """Fill in place the points `holes`, (n,), which are numbered in row order."""
    height, width = heights.shape
    left = holes.copy()
    values = np.empty(holes.size, np.float32)
    for _ in range(_RINGS):
        count = 0
        for place in range(left.size):
            row, column = left[place] // width, left[place] % width
            total, known = 0.0, 0
            for y in range(max(0, row - 1), min(height, row + 2)):
                for x in range(max(0, column - 1), min(width, column + 2)):
                    if not np.isnan(heights[y, x]):
                        total += heights[y, x]
                        known += 1
            values[place] = total / known if known >= _LEAST_NEIGHBOURS else np.nan
        for place in range(left.size):
            # A ring is written when it is complete, so that no point depends on the order of the others.
            if np.isnan(values[place]):
                left[count] = left[place]
                count += 1
            else:
                heights[left[place] // width, left[place] % width] = values[place]
        if count == left.size:
            break
        left = left[:count]
