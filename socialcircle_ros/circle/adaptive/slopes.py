# SPDX-License-Identifier: Apache-2.0
"""The local slope of the surface: the first prediction of the difference between neighbours."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.kernels.order_statistics import median_of_sorted
from socialcircle_ros.kernels.sorting_networks import Comparators, run_network, sort_network

from .blocks import BlockRows, interpolate_columns, interpolate_row, median_of_blocks
from .heights import RelativeHeights

_BLOCK = 8
"""Side of a block in points; the median difference in a block is its slope."""
_ROW_STRIDE = 2
"""Every other row of a block is enough."""
_IN_BLOCK = _BLOCK * _BLOCK // _ROW_STRIDE
_LEAST_KNOWN = _BLOCK

BlockSlopes = npt.NDArray[np.float32]
"""(2, h, w) float32: slope along x and along y in each block, in the cloud's unit per point."""


class Slopes(NamedTuple):
    """Slopes along x and y, interpolated to the columns of a cloud."""

    along_x: BlockRows
    along_y: BlockRows

    @classmethod
    def from_blocks(cls, slopes: BlockSlopes, width: int) -> 'Slopes':
        """Interpolate the slopes of blocks to `width` columns."""
        return cls(interpolate_columns(slopes[0], _BLOCK, width), interpolate_columns(slopes[1], _BLOCK, width))


def block_slopes(heights: RelativeHeights) -> BlockSlopes:
    """Median difference of neighbours in each block, then the median of 3×3 blocks.

    Args:
        heights: (H, W) float32, NaN where not measured.

    Returns:
        (2, h, w) float32: along x and along y.
    """
    height, width = heights.shape
    sort = sort_network(_IN_BLOCK, _IN_BLOCK // 2 + 1)
    bands = in_bands(
        lambda rows: _block_medians(heights, sort, rows.start, rows.stop), -(-height // _BLOCK), _BLOCK * width
    )
    along_x, along_y = np.concatenate(bands, axis=1)
    return np.stack([median_of_blocks(along_x, 0.0), median_of_blocks(along_y, 0.0)])


@kernel
def _block_medians(heights: RelativeHeights, sort: Comparators, first: int, end: int) -> BlockSlopes:
    """(2, end - first, w) float32: median difference along x and along y; NaN where too few are known."""
    height, width = heights.shape
    columns = (width + _BLOCK - 1) // _BLOCK
    slopes = np.full((2, end - first, columns), np.nan, np.float32)
    found, counts = np.empty((_IN_BLOCK, columns), np.float32), np.empty(columns, np.int64)
    for axis in range(2):
        down, right = axis, 1 - axis
        for row in range(first, end):
            found[:], counts[:] = np.inf, 0
            for line in range(_BLOCK // _ROW_STRIDE):
                y = row * _BLOCK + line * _ROW_STRIDE
                if y >= height - down:
                    break
                here, there = heights[y, : width - right], heights[y + down, right:]
                for x in range(here.size):
                    difference = there[x] - here[x]
                    if not np.isnan(difference):
                        found[line * _BLOCK + x % _BLOCK, x // _BLOCK] = difference
                        counts[x // _BLOCK] += 1
            run_network(sort, found, columns)
            for column in range(columns):
                if counts[column] >= _LEAST_KNOWN:
                    slopes[axis, row - first, column] = median_of_sorted(found, counts[column], column)
    return slopes


@kernel
def load_slopes(slopes: Slopes, row: int, line: npt.NDArray[np.float32]) -> None:
    """Write the slopes along x and along y of one row of points to `line`, (2, W) float32."""
    interpolate_row(slopes.along_x, _BLOCK, row, line[0])
    interpolate_row(slopes.along_y, _BLOCK, row, line[1])
