"""The expansion of the social circle (section 3.2.3)."""

from typing import Any

import numpy as np

from socialcircle_ros.compiled import kernel

from .cloud import Cloud, Mask


def expand(xyz: Cloud, seed: tuple[int, int], limit: Any, window: int) -> Mask:
    """Grow the circle from the seed over the grid until nobody joins (steps 1 to 7).

    Args:
        xyz: (H, W, 3) organized cloud.
        seed: row and column of the initial point I, which is measured.
        limit: R², a scalar of the cloud's own dtype.
        window: side of the search window W in points, odd.

    Returns:
        Mask (H, W): True where the point belongs to the circle.
    """
    return _expand(xyz, seed[0], seed[1], xyz.dtype.type(limit), window // 2)


@kernel
def _expand(xyz: Cloud, seed_row: int, seed_column: int, limit: Any, k: int) -> Mask:
    """`expand` with a window of 2k+1 points a side.

    V1 and V2 of the paper, each emptied in the order in which it was filled, are together one queue.
    A NaN or an infinite distance is never below the limit, so that points that are not measured stay out
    without being asked for.
    """
    height, width = xyz.shape[:2]
    joined = np.zeros((height, width), np.bool_)
    queue = np.empty((height * width, 2), np.int32)
    joined[seed_row, seed_column] = True
    queue[0] = seed_row, seed_column
    first, last = 0, 1
    while first < last:
        row, column = queue[first]
        first += 1
        x, y, z = xyz[row, column, 0], xyz[row, column, 1], xyz[row, column, 2]
        for r in range(max(row - k, 0), min(row + k + 1, height)):
            for c in range(max(column - k, 0), min(column + k + 1, width)):
                if joined[r, c]:
                    continue
                dx, dy, dz = xyz[r, c, 0] - x, xyz[r, c, 1] - y, xyz[r, c, 2] - z
                if (dx * dx + dy * dy) + dz * dz < limit:
                    joined[r, c] = True
                    if max(abs(r - row), abs(c - column)) == k:
                        queue[last] = r, c
                        last += 1
    return joined
