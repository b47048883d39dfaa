# SPDX-License-Identifier: Apache-2.0
"""How far removed points lie from the surface round them."""

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import HeightMap, Mask


def deviation(heights: HeightMap, outliers: Mask) -> npt.NDArray[np.float64]:
    """Compute the height of each outlier over the kept points round it.

    The surface at an outlier is the mean of the kept points in the 3×3 blocks round it. The blocks have the
    smallest size of 1, 2×2, 4×4 … points with which there is a kept point. The blocks are those of push-pull
    interpolation (S. J. Gortler et al.: The lumigraph, SIGGRAPH 1996, doi:10.1145/237170.237200).

    Args:
        heights: (H, W), NaN where not measured.
        outliers: (H, W) the removed points.

    Returns:
        (H, W) in the unit of the heights; NaN where no outlier is, and everywhere if no point is kept.
    """
    kept = np.where(outliers, np.nan, heights).astype(np.float64)
    found = np.isfinite(kept)
    rows, columns = np.nonzero(outliers & np.isfinite(heights))
    surface = np.full(len(rows), np.nan)
    if not found.any():
        return _placed(surface, rows, columns, heights.shape)
    sums, counts, step = np.where(found, kept, 0.0), found.astype(np.float64), 1
    while np.isnan(surface).any():
        at = rows // step, columns // step
        near_sums, near_counts = _three_by_three(sums)[at], _three_by_three(counts)[at]
        open_now = np.isnan(surface) & (near_counts > 0)
        surface[open_now] = near_sums[open_now] / near_counts[open_now]
        sums, counts, step = _halved(sums), _halved(counts), 2 * step
    return _placed(heights[rows, columns].astype(np.float64) - surface, rows, columns, heights.shape)


def _three_by_three(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Sums over the 3×3 values round each."""
    padded = np.pad(values, 1)
    by_row = padded[:-2] + padded[1:-1] + padded[2:]
    return by_row[:, :-2] + by_row[:, 1:-1] + by_row[:, 2:]


def _halved(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Sums over blocks of 2×2; the last row and column stand alone where their number is odd."""
    by_row = np.add.reduceat(values, np.arange(0, values.shape[0], 2), axis=0)
    return np.asarray(np.add.reduceat(by_row, np.arange(0, values.shape[1], 2), axis=1))


def _placed(
    values: npt.NDArray[np.float64],
    rows: npt.NDArray[np.int64],
    columns: npt.NDArray[np.int64],
    shape: tuple[int, ...],
) -> npt.NDArray[np.float64]:
    placed = np.full(shape, np.nan)
    placed[rows, columns] = values
    return placed
