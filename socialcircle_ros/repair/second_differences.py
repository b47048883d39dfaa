# SPDX-License-Identifier: Apache-2.0
"""Second differences of the heights of a cloud: their usual size, and their sums over boxes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.cloud import Floats
from socialcircle_ros.kernels.compiled import kernel

from .holes import MEASURED, PADDING

_MEDIAN_OF_SQUARES = 0.4549
"""Median of the square of a normal variable of variance 1."""

_LARGEST = 1e4
"""Limit of a squared second difference, as a multiple of the usual one."""


SAMPLED_POINTS = 20_000
"""Of the rows from which the usual difference is; each cloud waits for them."""


class DifferenceTables(NamedTuple):
    """Summed-area tables of squared second differences, (H + 1, W + 1) each.

    The value at (r, c) is that of the differences with the middle in a row above r and a column left of c. Source:
    F. C. Crow, Summed-area tables for texture mapping, SIGGRAPH 1984, DOI 10.1145/800031.808600.
    """

    sums: NDArray[np.float64]
    """Sum of the differences, each a multiple of the usual one and `_LARGEST` at most."""

    counts: NDArray[np.float64]
    """Number of the differences."""


@kernel
def measured_heights(z: Floats, unknowns: NDArray[np.int32]) -> Floats:
    """Copy the measured heights to a contiguous array.

    Args:
        z: (H, W) heights.
        unknowns: padded map of the unknowns, from `number_points`.

    Returns:
        The heights in the shape of `unknowns` and the data type of `z`, NaN where nothing is measured.
    """
    height, width = z.shape
    heights = np.full(unknowns.shape, np.nan, z.dtype)
    for row in range(height):
        for column in range(width):
            if unknowns[row + PADDING, column + PADDING] == MEASURED:
                heights[row + PADDING, column + PADDING] = z[row, column]
    return heights


@kernel
def usual_squared_differences(
    heights: Floats, rows: NDArray[np.int64], equal_pitches: bool
) -> tuple[float, float]:
    """Estimate the mean squared second difference, from the median: steps do not change it.

    Args:
        heights: padded, from `measured_heights`.
        rows: those that stand for all, without padding.
        equal_pitches: whether points are as far apart along rows as along columns. Otherwise the differences of
            one surface are larger in one direction, which is no step: each direction then has its own.

    Returns:
        The mean squares along rows and along columns, in the squared unit of the heights; 0 where nothing is
        measured.
    """
    width = heights.shape[1] - 2 * PADDING
    squares = np.empty((2, len(rows) * width))
    count = 0
    for row in rows:
        for column in range(PADDING, PADDING + width):
            squares[0, count], squares[1, count] = squared_differences(heights, row + PADDING, column)
            count += 1
    if equal_pitches:
        both = _mean_square(squares.ravel())
        return both, both
    return _mean_square(squares[0]), _mean_square(squares[1])


@kernel
def _mean_square(squares: NDArray[np.float64]) -> float:
    known = squares[~np.isnan(squares)]
    return np.median(known) / _MEDIAN_OF_SQUARES if len(known) > 0 else 0.0


@kernel
def squared_differences(heights: Floats, row: int, column: int) -> tuple[float, float]:
    """Squared second differences along the row and along the column; NaN where one of the points is missing."""
    twice = 2.0 * heights[row, column]
    along = heights[row, column - 1] - twice + heights[row, column + 1]
    across = heights[row - 1, column] - twice + heights[row + 1, column]
    return along * along, across * across


@kernel
def sum_differences(heights: Floats, usual: tuple[float, float]) -> DifferenceTables:
    """Make the summed-area tables of the squared second differences.

    Args:
        heights: padded, from `measured_heights`.
        usual: from `usual_squared_differences`.

    Returns:
        The tables. The differences are limited, so that a spike does not make rounding hide the others.
    """
    height, width = heights.shape[0] - 2 * PADDING, heights.shape[1] - 2 * PADDING
    sums, counts = np.zeros((height + 1, width + 1)), np.zeros((height + 1, width + 1))
    scale_along = 1.0 / usual[0] if usual[0] > 0 else np.inf
    scale_across = 1.0 / usual[1] if usual[1] > 0 else np.inf
    line, numbers = np.empty(width), np.empty(width)
    for row in range(height):
        for column in range(width):
            along, across = squared_differences(heights, row + PADDING, column + PADDING)
            line[column] = (min(along * scale_along, _LARGEST) if along > 0 else 0.0) + (
                min(across * scale_across, _LARGEST) if across > 0 else 0.0
            )
            numbers[column] = (1.0 if along >= 0 else 0.0) + (1.0 if across >= 0 else 0.0)
        total, number = 0.0, 0.0
        for column in range(width):
            total += line[column]
            number += numbers[column]
            sums[row + 1, column + 1] = sums[row, column + 1] + total
            counts[row + 1, column + 1] = counts[row, column + 1] + number
    return DifferenceTables(sums, counts)
