# SPDX-License-Identifier: Apache-2.0
"""The baselines point by point: the slow reference, easy to compare with their definitions."""

import math

import numpy as np


def neighbours(xyz, row, column, window):
    """The measured points of the window around a point, without the point itself."""
    reach = window // 2
    return [
        xyz[r, c]
        for r in range(max(row - reach, 0), min(row + reach + 1, xyz.shape[0]))
        for c in range(max(column - reach, 0), min(column + reach + 1, xyz.shape[1]))
        if (r, c) != (row, column) and np.isfinite(xyz[r, c]).all()
    ]


def squared_distances(xyz, row, column, window):
    squared = []
    for point in neighbours(xyz, row, column, window):
        dx, dy, dz = point - xyz[row, column]
        squared.append((dx * dx + dy * dy) + dz * dz)
    return squared


def measured(xyz):
    return np.isfinite(xyz).all(axis=2)


def radius_outliers(xyz, window, radius, min_neighbours):
    outliers = np.zeros(xyz.shape[:2], bool)
    limit = xyz.dtype.type(radius) * xyz.dtype.type(radius)
    for row, column in np.argwhere(measured(xyz)):
        near = [d for d in squared_distances(xyz, row, column, window) if d <= limit]
        outliers[row, column] = len(near) < min_neighbours
    return outliers


def added(values):
    """The sum in this order. Python's own sum is more exact from 3.12 on, and has other last digits."""
    total = 0.0
    for value in values:
        total += value
    return total


def mean_distances(xyz, window, count):
    mean = np.full(xyz.shape[:2], np.nan, xyz.dtype)
    for row, column in np.argwhere(measured(xyz)):
        nearest = sorted(squared_distances(xyz, row, column, window))[:count]
        mean[row, column] = added(float(np.sqrt(d)) for d in nearest) / len(nearest) if nearest else np.inf
    return mean


def statistical_threshold(mean, std_factor):
    values = [float(value) for value in mean.ravel() if np.isfinite(value)]
    if not values:
        return math.inf
    n, total, squares = len(values), added(values), added(value * value for value in values)
    variance = max(squares - total * total / n, 0.0) / max(n - 1, 1)
    return total / n + std_factor * math.sqrt(variance)


def window_median(xyz, window):
    median = np.full(xyz.shape[:2], np.nan, xyz.dtype)
    for row, column in np.argwhere(measured(xyz)):
        heights = [point[2] for point in neighbours(xyz, row, column, window)] + [xyz[row, column, 2]]
        median[row, column] = sorted(heights)[len(heights) // 2]
    return median
