# SPDX-License-Identifier: Apache-2.0
"""Points with few neighbours that stand beyond all other heights: hardly a neighbour could be in touch with them.

What is measured alone, where nothing else is, is often glare. The network and the rules compare neighbours, and so
keep such a point, however far off it is. Heights count from a plane, so that a tilt changes nothing.
"""

from typing import NamedTuple

import numpy as np

from socialcircle_ros.cloud import HeightMap, Mask
from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

LEAST_NEIGHBOURS = 3
"""A point with fewer measured neighbours, of eight, has few."""
BEYOND = 0.5
"""Such points further beyond the heights of the others than this share of their range are outliers."""
MOST = 0.1
"""Share of the measured points above which such points are how the surface was sampled."""
_SAMPLE = 4096  # points that tell the plane
_ROUNDINGS = 8


class _Others(NamedTuple):
    """What is known of all other points: their number, and their lowest and highest height."""

    number: int
    low: float
    high: float


def outliers_with_few_neighbours(heights: HeightMap) -> Mask:
    """Find the points with few neighbours that stand beyond the heights of all others.

    Args:
        heights: (H, W), NaN where not measured; the unit plays no part.

    Returns:
        (H, W) bool.
    """
    sparse: Mask = np.zeros(heights.shape, np.bool_)
    slopes = _plane(heights)
    bands = in_bands(lambda rows: _Others(*_find(heights, slopes, rows.start, rows.stop, sparse)), *heights.shape)
    others = sum(band.number for band in bands)
    found = np.flatnonzero(sparse)
    if not len(found) or len(found) > MOST * (len(found) + others):
        sparse[:] = False
        return sparse
    low, high = min(band.low for band in bands), max(band.high for band in bands)
    rows, columns = np.divmod(found, heights.shape[1])
    own = heights[rows, columns].astype(np.float64)
    values = own - slopes[0] * columns - slopes[1] * rows
    largest = max(float(np.abs(own).max()), abs(low), abs(high))
    rounding = (
        _ROUNDINGS * float(np.finfo(heights.dtype).eps) * largest
    )  # all that a noiseless plane has as a range
    sparse.flat[found] = np.maximum(low - values, values - high) > BEYOND * (high - low) + rounding
    return sparse


def _plane(heights: HeightMap) -> tuple[float, float]:
    """The slopes of the least squares plane of some points, from a column to the next and from a row to the next.

    Medians of the differences would be 0 on a tilt of less than a step of quantised heights.
    """
    at = np.flatnonzero(np.isfinite(heights))
    if len(at) > _SAMPLE:
        at = np.random.default_rng(0).choice(at, _SAMPLE)  # equal steps could lie in one column
    rows, columns = np.divmod(at, heights.shape[1])
    numbers = np.column_stack([columns, rows, np.ones(len(at))]).astype(np.float64)
    column, row, _ = np.linalg.lstsq(numbers, heights[rows, columns].astype(np.float64), rcond=None)[0]
    return float(column), float(row)


@kernel
def _find(
    heights: HeightMap, slopes: tuple[float, float], first: int, last: int, sparse: Mask
) -> tuple[int, float, float]:
    """Mark the points with few neighbours of the rows from `first` to before `last`.

    Args:
        heights: (H, W), NaN where not measured.
        slopes: of the plane, from a column to the next and from a row to the next.
        first: row.
        last: row.
        sparse: (H, W) is written.

    Returns:
        Number, lowest and highest height of the other measured points; ∞ and -∞ without any.
    """
    height, width = heights.shape
    count, low, high = 0, np.inf, -np.inf
    measured = np.zeros(width + 2, np.uint8)  # of the three rows, in each column
    for row in range(first, last):
        measured[:] = 0
        for near in range(max(0, row - 1), min(height, row + 2)):
            values = heights[near]
            for column in range(width):
                measured[column + 1] += np.uint8(values[column] == values[column])
        values, marks = heights[row], sparse[row]
        for column in range(width):
            value = values[column] - slopes[0] * column - slopes[1] * row
            known = value == value  # noqa: PLR0124 - not NaN
            neighbours = measured[column] + measured[column + 1] + measured[column + 2] - 1
            marks[column] = known and neighbours < LEAST_NEIGHBOURS
            if known and neighbours >= LEAST_NEIGHBOURS:
                count += 1
                low, high = min(low, value), max(high, value)
    return count, low, high
