# SPDX-License-Identifier: Apache-2.0
"""The positions of filled points on the grid of the cloud."""

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
    """Write the chosen points to the cloud; the other points of the holes become NaN.

    x and y are kept if both are finite. Otherwise they are interpolated linearly between the two rims in the row,
    and between the two in the column. Where both pairs of rims exist, the weights are 1/gap², with gaps in points:
    on a regular grid both pairs give the same place.

    Args:
        xyz: (H, W, 3), updated.
        filled: (H, W), set to True for the filled points.
        points: (N, 2) rows and columns.
        rims: (N, 4) distances to the rims: left, right, above, below; 0: no rim.
        chosen: (N,), the points to fill.
        heights: (N,), NaN where no height was found.
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
