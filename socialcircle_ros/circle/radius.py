"""The radius of the social circle (section 3.2.2): the median of the ring round the seed."""

from typing import Any

import numpy as np

from socialcircle_ros.cloud import Cloud
from socialcircle_ros.errors import NoRadiusError


def ring_limit(xyz: Cloud, seed: tuple[int, int], window: int) -> Any:
    """R² by eq. 6 and 7, in the arithmetic of the cloud.

    The window of 2k+1 points a side is doubled to 4k+1; its outer ring has 16k points. The squared
    distances from the seed are sorted, and the one at index 8k is R²: outliers gather at the end, and do
    not reach it. Where ring points are missing it is the middle one of those that are measured.

    Args:
        xyz: (H, W, 3) organized cloud.
        seed: row and column of the initial point I.
        window: side of the search window in points, odd.

    Returns:
        R², a scalar of the cloud's own dtype: distances are compared squared, so that no root rounds.

    Raises:
        NoRadiusError: no point of the ring is measured.
    """
    row, column = seed
    k = window // 2
    reach = 2 * k
    top, left = max(row - reach, 0), max(column - reach, 0)
    square = xyz[top : row + reach + 1, left : column + reach + 1]
    rows, columns = np.ogrid[top : top + square.shape[0], left : left + square.shape[1]]
    on_ring = np.maximum(abs(rows - row), abs(columns - column)) == reach
    points = square[on_ring]
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) == 0:
        raise NoRadiusError(
            f'No point of the ring round the seed at row {row}, column {column} is measured, so eq. 7 gives'
            ' no radius; set circle.radius, or circle.vote_region to a fully measured part.'
        )
    with np.errstate(over='ignore'):
        dx, dy, dz = (points - xyz[row, column]).T
        squared = np.sort((dx * dx + dy * dy) + dz * dz)
    return squared[len(squared) // 2]


def circle_limit(xyz: Cloud, seed: tuple[int, int], window: int, radius: float | None, scale: float) -> Any:
    """R² in force: given by the user or found by eq. 7, times the square of `scale`.

    Args:
        xyz: (H, W, 3) organized cloud.
        seed: row and column of the initial point I.
        window: side of the search window in points, odd.
        radius: in the unit of the cloud; None: eq. 7.
        scale: factor on the radius.

    Returns:
        R², a scalar of the cloud's own dtype.

    Raises:
        NoRadiusError: the radius is to be found, and no point of the ring is measured.
    """
    real = xyz.dtype.type
    with np.errstate(over='ignore'):
        limit = ring_limit(xyz, seed, window) if radius is None else real(radius) * real(radius)
        return limit if scale == 1.0 else limit * (real(scale) * real(scale))
