"""Areal surface texture parameters (ISO 25178-2) of a height map."""

from dataclasses import dataclass

import numpy as np

from socialcircle_ros.cloud import HeightMap


@dataclass(frozen=True)
class Texture:
    """Texture of a surface after a least squares plane is subtracted, in the unit of the heights.

    The form of the surface, such as a curvature, is not removed.
    """

    sa: float
    """Arithmetical mean height: the mean of |z|."""
    sq: float
    """Root mean square height."""
    sz: float
    """Maximum height: the highest peak minus the deepest pit. A single outlier changes it."""


def texture(heights: HeightMap) -> Texture:
    """Compute Sa, Sq and Sz of a height map.

    Args:
        heights: (H, W) float32 or float64; NaN is not measured and is left out.

    Returns:
        The texture; all values are NaN where fewer than three points are measured.
    """
    measured = np.isfinite(heights)
    count = int(np.count_nonzero(measured))
    if count < 3:
        return Texture(float('nan'), float('nan'), float('nan'))
    z = np.where(measured, heights, 0.0).astype(np.float64, copy=False)
    # Sums over rows and columns give the normal equations of the plane in less than half the time of a list of
    # points. Coordinates and heights are centred, so that the equations stay well conditioned on large maps.
    per_row, per_column = measured.sum(axis=1), measured.sum(axis=0)
    rows, columns = (np.arange(len(n)) - n @ np.arange(len(n)) / count for n in (per_row, per_column))
    mean = z.sum() / count
    row_sums, column_sums = z.sum(axis=1) - mean * per_row, z.sum(axis=0) - mean * per_column
    mixed = rows @ (measured @ columns)
    squares = [[per_row @ rows**2, mixed], [mixed, per_column @ columns**2]]
    products = np.array([row_sums @ rows, column_sums @ columns])
    (row_slope, column_slope), *_ = np.linalg.lstsq(np.array(squares), products)
    z -= mean + (row_slope * rows)[:, None] + column_slope * columns
    residuals = z[measured]
    return Texture(
        sa=float(np.mean(np.abs(residuals))),
        sq=float(np.sqrt(np.mean(residuals**2))),
        sz=float(np.ptp(residuals)),
    )
