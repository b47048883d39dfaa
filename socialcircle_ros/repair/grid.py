"""Filled points take their place on the grid."""

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.cloud import Cloud, Mask
from socialcircle_ros.kernels.compiled import kernel


@kernel
def fill_points(
    xyz: Cloud,
    filled: Mask,
    points: NDArray[np.int32],
    rims: NDArray[np.int32],
    chosen: Mask,
    heights: NDArray[np.float64],
) -> None:
    """Write the chosen points into `xyz` and `filled`; the other points of the holes become NaN.

    x and y of a point, where they are not both finite, are linear between the two rims in its row and between
    the two in its column; where both exist, weighted by 1/gap² as the heights of a spline are.
    """
    for point in range(len(points)):
        row, column = points[point]
        if not (chosen[point] and np.isfinite(heights[point])):
            xyz[row, column] = np.nan
            continue
        left, right, above, below = rims[point]
        has_place = np.isfinite(xyz[row, column, 0]) and np.isfinite(xyz[row, column, 1])
        for axis in range(2):
            if has_place:
                break
            total, weights = 0.0, 0.0
            if left > 0 and right > 0:
                first, second = xyz[row, column - left, axis], xyz[row, column + right, axis]
                weight = 1.0 / (left + right) ** 2
                total += weight * ((right * np.float64(first) + left * np.float64(second)) / (left + right))
                weights += weight
            if above > 0 and below > 0:
                first, second = xyz[row - above, column, axis], xyz[row + below, column, axis]
                weight = 1.0 / (above + below) ** 2
                total += weight * ((below * np.float64(first) + above * np.float64(second)) / (above + below))
                weights += weight
            xyz[row, column, axis] = total / weights
        xyz[row, column, 2] = heights[point]
        filled[row, column] = True
