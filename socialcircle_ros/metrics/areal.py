# SPDX-License-Identifier: Apache-2.0
"""Areal surface texture parameters (ISO 25178-2) of a height map."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import HeightMap, Mask, Pitch


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


@dataclass(frozen=True)
class ArealTexture(Texture):
    """Texture with the shape of the height distribution and the developed area."""

    ssk: float
    """Skewness of the heights; 0 if the surface has as many high peaks as deep pits."""
    sku: float
    """Kurtosis of the heights; 3 for a normal distribution."""
    sdr: float
    """Developed interfacial area ratio: the share by which the area exceeds its projection."""


FILTERS = 'S-filter: none; F-operation: least squares plane; L-filter: none'
"""The filters of ISO 25178-3 behind all textures, in words."""


def texture(heights: HeightMap) -> Texture:
    """Compute Sa, Sq and Sz of a height map.

    Args:
        heights: (H, W) float32 or float64; NaN is not measured and is left out.

    Returns:
        The texture; all values are NaN where fewer than three points are measured.
    """
    z, measured = _levelled(heights)
    return _texture(z[measured])


def areal_texture(heights: HeightMap, pitch: Pitch | None) -> ArealTexture:
    """Compute Sa, Sq, Sz, Ssk, Sku and Sdr of a height map (ISO 25178-2).

    Sdr is the area of the triangles between neighbouring points over the area below them; each square of four
    measured points is split along both of its diagonals, and counts with the mean of the two areas.

    Args:
        heights: (H, W) float32 or float64; NaN is not measured and is left out.
        pitch: distance of the columns and of the rows, in the unit of the heights; None: not known.

    Returns:
        The texture. All values are NaN where fewer than three points are measured, Ssk and Sku on a plane, and Sdr
        without a pitch or without four measured points in a square.
    """
    z, measured = _levelled(heights)
    residuals = z[measured]
    basic = _texture(residuals)
    # Normalised first, because the fourth power of very small or large heights leaves the range of numbers.
    normal = residuals / basic.sq if basic.sq > 0 else np.array([np.nan])
    return ArealTexture(
        basic.sa,
        basic.sq,
        basic.sz,
        ssk=float(np.mean(normal**3)),
        sku=float(np.mean(normal**4)),
        sdr=float('nan') if pitch is None else _developed_ratio(np.where(measured, z, np.nan), pitch),
    )


def _levelled(heights: HeightMap) -> tuple[npt.NDArray[np.float64], Mask]:
    """The heights without their least squares plane, (H, W), of any value where not measured; what is measured."""
    measured = np.isfinite(heights)
    count = int(np.count_nonzero(measured))
    z = np.where(measured, heights, 0.0).astype(np.float64, copy=False)
    if count < 3:
        return z, np.zeros_like(measured)
    # Sums over rows and columns give the normal equations of the plane in less than half the time of a list of
    # points. Coordinates and heights are centred, so that the equations stay well conditioned on large maps.
    per_row, per_column = measured.sum(axis=1), measured.sum(axis=0)
    rows, columns = (np.arange(len(n)) - n @ np.arange(len(n)) / count for n in (per_row, per_column))
    mean = z.sum() / count
    row_sums, column_sums = z.sum(axis=1) - mean * per_row, z.sum(axis=0) - mean * per_column
    mixed = rows @ (measured @ columns)
    squares = [[per_row @ rows**2, mixed], [mixed, per_column @ columns**2]]
    products = np.array([row_sums @ rows, column_sums @ columns])
    (row_slope, column_slope), *_ = np.linalg.lstsq(np.array(squares), products, rcond=None)
    z -= mean + (row_slope * rows)[:, None] + column_slope * columns
    return z, measured


def _texture(residuals: npt.NDArray[np.float64]) -> Texture:
    if not residuals.size:
        return Texture(float('nan'), float('nan'), float('nan'))
    return Texture(
        sa=float(np.mean(np.abs(residuals))),
        sq=float(np.sqrt(np.mean(residuals**2))),
        sz=float(np.ptp(residuals)),
    )


def _developed_ratio(z: npt.NDArray[np.float64], pitch: Pitch) -> float:
    dx, dy = pitch
    along_x, along_y = np.diff(z, axis=1) / dx, np.diff(z, axis=0) / dy
    top, bottom, left, right = along_x[:-1], along_x[1:], along_y[:, :-1], along_y[:, 1:]
    corners = ((top, left), (top, right), (bottom, left), (bottom, right))
    # Two triangles at opposite corners fill the square; each of the four covers half of it.
    area = np.mean([np.sqrt(1 + across**2 + down**2) for across, down in corners], axis=0)
    known = np.isfinite(area)
    return float(np.mean(area[known]) - 1) if known.any() else float('nan')
