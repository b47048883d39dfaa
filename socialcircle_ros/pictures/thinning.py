# SPDX-License-Identifier: Apache-2.0
"""Fewer points for display: large clouds are thinned so that no outlier is lost."""

from typing import TypeVar

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask

PIXELS = 800
"""Most rows or columns of a map, unless another number is given."""

Scalar = TypeVar('Scalar', bound=np.generic)


def thinned(values: npt.NDArray[Scalar], pixels: int = PIXELS) -> npt.NDArray[Scalar]:
    """Every n-th row and column of an array, with the smallest n for which the result fits.

    Args:
        values: (H, W, ...) one value per point.
        pixels: most rows or columns of the result.

    Returns:
        A view of `values`.
    """
    step = _step(values.shape, pixels)
    return values[::step, ::step]


def any_in_tile(mask: Mask, pixels: int = PIXELS) -> Mask:
    """Thin a mask so that no True point is lost.

    Args:
        mask: (H, W).
        pixels: most rows or columns of the result.

    Returns:
        A mask with the shape of `thinned(mask, pixels)`: True where any point of the n×n tile is True.
    """
    return over_tiles(np.logical_or, mask, pixels)


def over_tiles(reduce: np.ufunc, values: npt.NDArray[Scalar], pixels: int = PIXELS) -> npt.NDArray[Scalar]:
    """Reduce each tile of an array to one value.

    Args:
        reduce: a binary ufunc, such as `np.maximum`.
        values: (H, W).
        pixels: most rows or columns of the result.

    Returns:
        One value per tile, in the shape of `thinned(values, pixels)`.
    """
    step = _step(values.shape, pixels)
    rows, columns = (np.arange(0, extent, step) for extent in values.shape)
    by_row = reduce.reduceat(values, rows, axis=0)
    tiles: npt.NDArray[Scalar] = reduce.reduceat(by_row, columns, axis=1)
    return tiles


def grown(values: npt.NDArray[np.float64], reach: int) -> npt.NDArray[np.float64]:
    """Let each value spread to its neighbours without one, so that a single one can be seen.

    Args:
        values: (H, W), NaN where there is none.
        reach: rows and columns that it spreads on each side.

    Returns:
        (H, W): of several neighbours, that which is farthest from 0.
    """
    padded = np.pad(values, reach, constant_values=np.nan)
    found = np.full_like(values, np.nan)
    height, width = values.shape
    for row in range(2 * reach + 1):
        for column in range(2 * reach + 1):
            near = padded[row : row + height, column : column + width]
            found = np.where(np.isnan(found) | (np.abs(near) > np.abs(found)), near, found)
    return np.where(np.isnan(values), found, values)


def _step(shape: tuple[int, ...], pixels: int) -> int:
    return max(1, -(-max(shape[:2]) // pixels))
