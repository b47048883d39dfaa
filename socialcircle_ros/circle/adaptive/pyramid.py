# SPDX-License-Identifier: Apache-2.0
"""The cloud at reduced resolution, and how results there are carried back to full resolution."""

import numpy as np

from socialcircle_ros.cloud import Mask
from socialcircle_ros.kernels.compiled import kernel

from .heights import RelativeHeights
from .islands import Steepness


@kernel
def halved(heights: RelativeHeights) -> RelativeHeights:
    """Halve the rows and columns; an odd last row or column is dropped.

    Each point is the mean of the middle two of its four points, the mean of fewer where fewer are measured, and
    NaN where none is.
    """
    height, width = heights.shape
    half = np.empty((height // 2, width // 2), np.float32)
    for row in range(height // 2):
        for column in range(width // 2):
            low, high = np.float32(np.inf), np.float32(-np.inf)
            total, count = np.float32(0), 0
            for y in range(2 * row, 2 * row + 2):
                for x in range(2 * column, 2 * column + 2):
                    value = heights[y, x]
                    if not np.isnan(value):
                        low, high = min(low, value), max(high, value)
                        total += value
                        count += 1
            if count > 2:
                total -= low + high
                count -= 2
            half[row, column] = total / count if count else np.nan
    return half


@kernel
def mark_expanded(reduced: Mask, reduction: int, mask: Mask) -> None:
    """Set in `mask`, (H, W), all points of the cloud that a set point of `reduced` stands for."""
    for row in range(reduced.shape[0]):
        for column in range(reduced.shape[1]):
            if reduced[row, column]:
                rows = slice(row * reduction, (row + 1) * reduction)
                mask[rows, column * reduction : (column + 1) * reduction] = True


@kernel
def raise_expanded(reduced: Steepness, reduction: int, steepness: Steepness) -> None:
    """Raise `steepness`, (H, W), to that of the reduced point that stands for a point."""
    for row in range(reduced.shape[0]):
        for column in range(reduced.shape[1]):
            value = reduced[row, column]
            if value > 0:
                for y in range(row * reduction, (row + 1) * reduction):
                    for x in range(column * reduction, (column + 1) * reduction):
                        steepness[y, x] = max(steepness[y, x], value)
