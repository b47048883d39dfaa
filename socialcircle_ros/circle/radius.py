# SPDX-License-Identifier: Apache-2.0
"""The radius R of the social circle (section 3.2.2): the median distance of the ring round the seed (eq. 6, 7)."""

import numpy as np

from socialcircle_ros.cloud import Cloud
from socialcircle_ros.errors import CloudError, NoRadiusError

from .arrays import Real


def ring_limit(xyz: Cloud, seed: tuple[int, int], window: int) -> Real:
    """Return R² by eq. 6 and 7.

    The search window of 2k+1 points a side is doubled to 4k+1, and its outer ring has 16k points. Their squared
    distances from the seed are sorted (eq. 6), and the one at index 8k is R² (eq. 7). Outliers have large
    distances, which gather at the end and do not affect that index. Where ring points are missing, the middle
    one of those that are measured takes its place.

    Args:
        xyz: (H, W, 3) organized cloud.
        seed: row and column of the initial point I.
        window: side of the search window in points, odd.

    Returns:
        R², in the cloud's own dtype.

    Raises:
        NoRadiusError: no point of the ring is measured, or R is 0.
    """
    row, column = seed
    reach = 2 * (window // 2)
    top, left = max(row - reach, 0), max(column - reach, 0)
    square = xyz[top : row + reach + 1, left : column + reach + 1]
    rows, columns = np.ogrid[top : top + square.shape[0], left : left + square.shape[1]]
    on_ring = np.maximum(abs(rows - row), abs(columns - column)) == reach
    ring = square[on_ring]
    ring = ring[np.isfinite(ring).all(axis=1)]
    if len(ring) == 0:
        raise NoRadiusError(
            f'No point of the ring round the seed at row {row}, column {column} is measured, so eq. 7 gives'
            ' no radius; set circle.radius, or circle.vote_region to a fully measured part.'
        )
    with np.errstate(over='ignore'):
        dx, dy, dz = (ring - xyz[row, column]).T
        squared = np.sort((dx * dx + dy * dy) + dz * dz)
    limit: Real = squared[len(squared) // 2]
    if limit == 0:
        raise NoRadiusError(
            f'Half of the ring round the seed at row {row}, column {column} is exactly at the seed, so eq. 7 gives'
            ' the radius 0. Such points are not measured: see circle.not_measured; or set circle.radius.'
        )
    return limit


def circle_limit(xyz: Cloud, seed: tuple[int, int], window: int, radius: float | None, scale: float) -> Real:
    """Return R² in force: from the user or from eq. 7, times the square of `scale`.

    Args:
        xyz: (H, W, 3) organized cloud.
        seed: row and column of the initial point I.
        window: side of the search window in points, odd.
        radius: in the unit of the cloud; None: eq. 7.
        scale: factor on the radius.

    Returns:
        R², in the cloud's own dtype.

    Raises:
        NoRadiusError: `radius` is None, and no point of the ring is measured, or R is 0.
        CloudError: the dtype does not hold the squared distances of the ring.
    """
    real = xyz.dtype.type
    with np.errstate(over='ignore'):
        limit = ring_limit(xyz, seed, window) if radius is None else real(radius) * real(radius)
        limit = limit if scale == 1.0 else limit * (real(scale) * real(scale))
    # If R² is finite, a distance with an infinite square is above R. So only an infinite R² needs a look.
    if np.isinf(limit) and _ring_overflows(xyz, seed, window):
        raise CloudError(
            f'{xyz.dtype} does not hold the squares of the distances round the seed at row {seed[0]}, column'
            f' {seed[1]}: check the coordinates, or give the cloud in a larger unit.'
        )
    return limit


def _ring_overflows(xyz: Cloud, seed: tuple[int, int], window: int) -> bool:
    try:
        return bool(np.isinf(ring_limit(xyz, seed, window)))
    except NoRadiusError:
        return False
