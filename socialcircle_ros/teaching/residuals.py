# SPDX-License-Identifier: Apache-2.0
"""How far points stand off their surroundings, and where a surface is steep, both free of its tilt.

Heights are compared along the local slope that the adaptive mode estimates. A median of plain heights is no
measure on a slope: there the height of the point itself is the median, however noisy it is.
"""

import numpy as np
import numpy.typing as npt

from socialcircle_ros.circle.adaptive.heights import RelativeHeights
from socialcircle_ros.circle.adaptive.slopes import Slopes, block_slopes, load_slopes
from socialcircle_ros.cloud import Mask
from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

Residuals = npt.NDArray[np.float32]
"""(H, W) float32, at least 0, in the unit of the heights; NaN where not measured, or with nothing around."""

_BAND = 10_000  # points worth a thread
_STEEP = 0.95
"""Quantile of the steps between neighbours above which a point is on an edge."""
_NEAR = 2
"""Points from an edge or from a hole that are still beside it."""


def residuals(heights: RelativeHeights, side: int, stride: int = 1) -> Residuals:
    """Distance of each point from the median of the window around it, where points slide down the local slope.

    Args:
        heights: (H, W) float32, NaN where not measured.
        side: side of the window in points, odd; it is cut at the border.
        stride: every so many rows and columns of the window are enough.
    """
    slopes = _slopes(heights)
    height, width = heights.shape
    bands = in_bands(
        lambda rows: _residuals(heights, slopes, side // 2, stride, rows.start, rows.stop), height, width, _BAND
    )
    return np.concatenate(bands)


def beside_edges(heights: RelativeHeights) -> Mask:
    """Find the points near the highest steps between neighbours, or near points that are not measured.

    Args:
        heights: (H, W) float32, NaN where not measured.

    Returns:
        (H, W) bool, measured points only.
    """
    measured: Mask = np.isfinite(heights)
    if not measured.any():
        return measured
    steps = _steps(heights, _slopes(heights))
    edges = (steps > np.quantile(steps[measured], _STEEP)) | ~measured
    for axis in (0, 1):
        padded = np.pad(edges, [(_NEAR, _NEAR) if each == axis else (0, 0) for each in (0, 1)])
        edges = np.asarray(np.lib.stride_tricks.sliding_window_view(padded, 2 * _NEAR + 1, axis).any(axis=-1))
    beside: Mask = edges & measured
    return beside


def _slopes(heights: RelativeHeights) -> Slopes:
    return Slopes.from_blocks(block_slopes(heights), heights.shape[1])


@kernel
def _residuals(
    heights: RelativeHeights, slopes: Slopes, reach: int, stride: int, first: int, end: int
) -> Residuals:
    """The residuals of rows `first` to `end` - 1."""
    height, width = heights.shape
    result = np.full((end - first, width), np.nan, np.float32)
    line, found = np.empty((2, width), np.float32), np.empty((2 * reach + 1) ** 2, np.float32)
    for row in range(first, end):
        load_slopes(slopes, row, line)
        for column in range(width):
            here = heights[row, column]
            if np.isnan(here):
                continue
            count = 0
            for y in range(row - reach, min(height, row + reach + 1), stride):
                for x in range(column - reach, min(width, column + reach + 1), stride):
                    if y >= 0 and x >= 0 and not np.isnan(heights[y, x]):
                        slid = (x - column) * line[0, column] + (y - row) * line[1, column]
                        found[count] = heights[y, x] - here - slid
                        count += 1
            if count:
                result[row - first, column] = abs(np.median(found[:count]))
    return result


@kernel
def _steps(heights: RelativeHeights, slopes: Slopes) -> Residuals:
    """The highest step from each point to one of its four neighbours, beyond the local slope; 0 without one."""
    height, width = heights.shape
    result, line = np.zeros((height, width), np.float32), np.empty((2, width), np.float32)
    for row in range(height):
        load_slopes(slopes, row, line)
        for column in range(width):
            for axis in range(2):
                y, x = row + axis, column + 1 - axis
                if y < height and x < width:
                    step = abs(heights[y, x] - heights[row, column] - line[axis, column])
                    if not np.isnan(step):
                        result[row, column] = max(result[row, column], step)
                        result[y, x] = max(result[y, x], step)
    return result
