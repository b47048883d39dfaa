# SPDX-License-Identifier: Apache-2.0
"""Grids of blocks of points: smoothing, and interpolation between the blocks' centres."""

import numpy as np
import numpy.typing as npt

from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.kernels.order_statistics import median_of_sorted
from socialcircle_ros.kernels.sorting_networks import Comparators, run_network, sort_network

Blocks = npt.NDArray[np.float32]
"""(h, w) float32: a value for each block of a cloud."""
BlockRows = npt.NDArray[np.float64]
"""(h, W) float64: each row of a grid of blocks, interpolated to the columns of the cloud."""

_AROUND = 9  # blocks


def median_of_blocks(blocks: Blocks, otherwise: float) -> Blocks:
    """Median of each block and the eight around it.

    Args:
        blocks: (h, w) float32, NaN where not known.
        otherwise: the result where none of the nine is known.

    Returns:
        (h, w) float32.
    """
    return _median_of_blocks(blocks, otherwise, sort_network(_AROUND, _AROUND // 2 + 1))


@kernel
def _median_of_blocks(blocks: Blocks, otherwise: float, sort: Comparators) -> Blocks:
    rows, columns = blocks.shape
    smooth = np.empty_like(blocks)
    found, counts = np.empty((_AROUND, columns), np.float32), np.empty(columns, np.int64)
    for row in range(rows):
        found[:], counts[:] = np.inf, 0
        for place in range(_AROUND):
            y, right = row + place // 3 - 1, place % 3 - 1
            if 0 <= y < rows:
                for column in range(max(0, -right), columns - max(0, right)):
                    if not np.isnan(blocks[y, column + right]):
                        found[place, column] = blocks[y, column + right]
                        counts[column] += 1
        run_network(sort, found, columns)
        for column in range(columns):
            smooth[row, column] = median_of_sorted(found, counts[column], column) if counts[column] else otherwise
    return smooth


@kernel
def interpolate_columns(blocks: Blocks, side: int, width: int) -> BlockRows:
    """Interpolate the rows of a grid of blocks to columns of points.

    Values are linear between the centres of the blocks, and constant beyond the outermost.

    Args:
        blocks: (h, w) float32.
        side: side of a block in points.
        width: W, columns of the cloud.

    Returns:
        (h, W) float64.
    """
    rows, columns = blocks.shape
    before, after, share = np.empty(width, np.int64), np.empty(width, np.int64), np.empty(width)
    for column in range(width):
        right = min(max((column + 0.5) / side - 0.5, 0.0), columns - 1.0)
        before[column] = int(right)
        after[column] = min(before[column] + 1, columns - 1)
        share[column] = right - before[column]
    wide = np.empty((rows, width))
    for row in range(rows):
        for column in range(width):
            right = share[column]
            wide[row, column] = blocks[row, before[column]] * (1 - right) + blocks[row, after[column]] * right
    return wide


@kernel
def interpolate_row(blocks: BlockRows, side: int, row: int, values: npt.NDArray[np.float32]) -> None:
    """Write one row of points to `values`, (W,) float32; with `interpolate_columns` this is bilinear."""
    rows = blocks.shape[0]
    down = min(max((row + 0.5) / side - 0.5, 0.0), rows - 1.0)
    above = int(down)
    down -= above
    upper, lower = blocks[above], blocks[min(above + 1, rows - 1)]
    for column in range(values.size):
        values[column] = upper[column] * (1 - down) + lower[column] * down
