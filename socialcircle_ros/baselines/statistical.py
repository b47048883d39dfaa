# SPDX-License-Identifier: Apache-2.0
"""The statistical filter: a point is an outlier if its neighbours are unusually far away for this cloud."""

import math

import numpy as np
import numpy.typing as npt

from socialcircle_ros.arguments import settings_or_default
from socialcircle_ros.cloud import Cloud, organized
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.kernels.sorting_networks import Comparators, run_network, sort_network

from .result import FilterResult, Score, judge
from .settings import StatisticalSettings
from .window import STRIP, load_strip_row


def statistical_filter(xyz: npt.ArrayLike, settings: StatisticalSettings | None = None) -> FilterResult:
    """Remove the points with an unusually large mean distance to their nearest neighbours.

    This is PCL's StatisticalOutlierRemoval with a window instead of the k-d tree. The mean distance is over the
    `neighbours` nearest measured points of the window, or over all where there are fewer; without any it is Inf.
    An outlier is above mean + std_factor · s of all finite mean distances d, with PCL's s² = (Σ d² - (Σ d)² / n)
    / (n - 1). Distances are in the cloud's data type, their sums in float64.

    Args:
        xyz: (H, W, 3) float32 or float64 organized cloud; a point with a NaN or Inf is not measured.
        settings: the parameters; None: their defaults.

    Returns:
        Masks, and as the score the mean distance in the unit of the cloud.

    Raises:
        CloudError: not an organized cloud.
    """
    settings = settings_or_default(StatisticalSettings, settings)
    cloud = organized(xyz)
    nearest = sort_network(settings.window**2 - 1, settings.neighbours)
    score: Score = np.empty(cloud.shape[:2], cloud.dtype)
    _mean_distance(cloud, settings.window // 2, nearest, settings.neighbours, score)
    return judge(score, _threshold(score, settings.std_factor))


def _threshold(score: Score, std_factor: float) -> float:
    count, total, squares = _moments(score)
    if count == 0:
        return math.inf
    # A single value has no deviation; rounding may make the difference of the two sums slightly negative.
    variance = max(squares - total * total / count, 0.0) / max(count - 1, 1)
    return float(total / count + std_factor * math.sqrt(variance))


@kernel
def _moments(score: Score) -> tuple[int, float, float]:
    """Number, sum and sum of squares of the finite scores, row by row."""
    count, total, squares = 0, 0.0, 0.0
    for row in range(score.shape[0]):
        for column in range(score.shape[1]):
            value = np.float64(score[row, column])
            if value < np.inf:
                count += 1
                total += value
                squares += value * value
    return count, total, squares


@kernel
def _mean_distance(xyz: Cloud, reach: int, nearest: Comparators, neighbours: int, score: Score) -> None:
    """Fill `score`: mean distance to the nearest `neighbours`; Inf without any, NaN where not measured."""
    height, width = xyz.shape[:2]
    window = 2 * reach + 1
    # The rows of the window, in a ring: row r of the cloud lies in slot r % window.
    rows = np.empty((window, 3, STRIP + 2 * reach), xyz.dtype)
    near_squared = np.empty((window * window - 1, STRIP), xyz.dtype)
    total = np.empty(STRIP, np.float64)
    found = np.empty(STRIP, np.float64)
    infinite = xyz.dtype.type(np.inf)
    for left in range(0, width, STRIP):
        count = min(STRIP, width - left)
        for row in range(-reach, reach):
            load_strip_row(xyz, row, left - reach, rows[row % window])
        for row in range(height):
            load_strip_row(xyz, row + reach, left - reach, rows[(row + reach) % window])
            here = rows[row % window, :, reach : reach + count]
            x, y, z = here[0], here[1], here[2]
            place = 0
            for near_row in range(row - reach, row + reach + 1):
                for shift in range(window):
                    if near_row == row and shift == reach:
                        continue
                    near = rows[near_row % window, :, shift : shift + count]
                    near_x, near_y, near_z = near[0], near[1], near[2]
                    squared = near_squared[place]
                    place += 1
                    for column in range(count):
                        dx, dy, dz = (
                            near_x[column] - x[column],
                            near_y[column] - y[column],
                            near_z[column] - z[column],
                        )
                        distance = (dx * dx + dy * dy) + dz * dz
                        squared[column] = min(infinite, distance)  # Inf for a NaN
            run_network(nearest, near_squared, count)
            total[:] = 0.0
            found[:] = 0.0
            for rank in range(neighbours):
                squared = near_squared[rank]
                for column in range(count):
                    exists = squared[column] < infinite
                    total[column] += np.float64(np.sqrt(squared[column])) if exists else 0.0
                    found[column] += 1.0 if exists else 0.0
            mean = score[row, left : left + count]
            for column in range(count):
                if found[column] > 0:
                    mean[column] = total[column] / found[column]
                else:
                    mean[column] = x[column] * 0 + infinite
