# SPDX-License-Identifier: Apache-2.0
"""Areal surface texture parameters (ISO 25178-2) of a height map."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import cast

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Cloud, HeightMap, Mask, mask_of_points, nearest_grid, unmasked

_Coordinates = tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]

_ON_A_LINE = 1e-12  # share of the variance of x and y along a line that is rounding across it


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


def texture(points: Cloud | HeightMap, kept: Mask | None = None) -> Texture:
    """Compute Sa, Sq and Sz of a cloud or a height map.

    The plane that is subtracted is the one over x and y of the points. Row and column numbers stand for x and y on
    a regular grid, turned or not, where they give the same plane; in a height map; and where x and y do not tell
    rows and columns apart, as where all x are equal.

    Args:
        points: (H, W, 3) float32 or float64 cloud; or heights (H, W) on a regular grid. NaN, and what a masked
            array masks, is not measured and is left out.
        kept: (H, W) bool, the points that count, if they are measured; None: all.

    Returns:
        The texture; all values are NaN where fewer than three points count.

    Raises:
        CloudError: `kept` is no bool mask of the shape of the cloud.
    """
    levelled = _levelled(points, kept)
    return _texture(levelled.heights[levelled.counted])


def areal_texture(points: Cloud | HeightMap, kept: Mask | None = None) -> ArealTexture:
    """Compute Sa, Sq, Sz, Ssk, Sku and Sdr of a cloud or a height map (ISO 25178-2).

    Sdr is the area of the triangles between neighbouring points over the area below them; each square of four
    points that count is split along both of its diagonals, and counts with the mean of the two areas. The corners
    of the triangles have the x and y of the points, on a regular grid without their rounding.

    Args:
        points: as for `texture`.
        kept: as for `texture`.

    Returns:
        The texture. All values are NaN where fewer than three points count, Ssk and Sku on a plane, and Sdr of a
        height map, where x and y do not tell rows and columns apart, or without four points in a square.

    Raises:
        CloudError: as by `texture`.
    """
    levelled = _levelled(points, kept)
    residuals = levelled.heights[levelled.counted]
    basic = _texture(residuals)
    # Normalised first, because the fourth power of very small or large heights leaves the range of numbers.
    normal = residuals / basic.sq if basic.sq > 0 else np.array([np.nan])
    return ArealTexture(
        basic.sa,
        basic.sq,
        basic.sz,
        ssk=float(np.mean(normal**3)),
        sku=float(np.mean(normal**4)),
        sdr=_developed_ratio(levelled),
    )


@dataclass(frozen=True, eq=False)
class _Levelled:
    """Heights without their least squares plane."""

    heights: npt.NDArray[np.float64]
    """(H, W), of any value where a point does not count."""

    counted: Mask
    """(H, W) the points that count."""

    places: Callable[[], _Coordinates] | None = None
    """Gives x and y, (H, W) each, of any value where a point does not count; None: not known."""


def _levelled(points: Cloud | HeightMap, kept: Mask | None) -> _Levelled:
    plain = cast('Cloud', unmasked(points))
    xyz = plain if plain.ndim == 3 else None
    heights = plain if xyz is None else xyz[..., 2]
    counted: Mask = np.isfinite(heights)
    if kept is not None:
        counted &= mask_of_points('kept', kept, counted.shape)
    if xyz is not None:
        counted &= np.isfinite(xyz[..., 0])
        counted &= np.isfinite(xyz[..., 1])
    z = np.where(counted, heights, 0.0).astype(np.float64, copy=False)
    if np.count_nonzero(counted) < 3:
        return _Levelled(z, np.zeros_like(counted))
    grid = None if xyz is None else nearest_grid(xyz, counted)
    if xyz is None or grid is None:
        _level_by_numbers(z, counted)
        return _Levelled(z, counted)
    if grid.holds(xyz, counted):
        _level_by_numbers(z, counted)
        return _Levelled(z, counted, partial(grid.coordinates, counted.shape))
    places = _own_places(xyz, counted)
    _level_by_places(z, counted, *places)
    return _Levelled(z, counted, lambda: places)


def _own_places(xyz: Cloud, counted: Mask) -> _Coordinates:
    """Give x and y relative to the first point that counts, (H, W) each; 0 where none counts."""
    first = np.unravel_index(int(counted.argmax()), counted.shape)
    places = []
    for axis in (0, 1):
        values = np.subtract(xyz[..., axis], xyz[..., axis][first], dtype=np.float64)
        values[~counted] = 0.0
        places.append(values)
    return places[0], places[1]


def _level_by_numbers(z: npt.NDArray[np.float64], counted: Mask) -> None:
    """Subtract the plane over row and column numbers from the heights in place; they are 0 where none counts.

    Sums over rows and columns give the normal equations of the plane in less than half the time of a list of
    points. Coordinates and heights are centred, so that the equations stay well conditioned on large maps.
    """
    per_row, per_column = counted.sum(axis=1), counted.sum(axis=0)
    count = per_row.sum()
    rows, columns = (np.arange(len(n)) - n @ np.arange(len(n)) / count for n in (per_row, per_column))
    mean = z.sum() / count
    row_sums, column_sums = z.sum(axis=1) - mean * per_row, z.sum(axis=0) - mean * per_column
    mixed = rows @ (counted @ columns)
    squares = [[per_row @ rows**2, mixed], [mixed, per_column @ columns**2]]
    products = np.array([row_sums @ rows, column_sums @ columns])
    (row_slope, column_slope), *_ = np.linalg.lstsq(np.array(squares), products, rcond=None)
    z -= mean + (row_slope * rows)[:, None] + column_slope * columns


def _level_by_places(
    z: npt.NDArray[np.float64], counted: Mask, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]
) -> None:
    """Subtract the plane over x and y from the heights in place; all are 0 where none counts."""
    count = np.count_nonzero(counted)
    z -= z.sum() / count * counted
    flat_x, flat_y, heights = x.ravel(), y.ravel(), z.ravel()
    mean_x, mean_y = flat_x.sum() / count, flat_y.sum() / count
    mixed = flat_x @ flat_y - count * mean_x * mean_y
    squares = [
        [flat_x @ flat_x - count * mean_x**2, mixed],
        [mixed, flat_y @ flat_y - count * mean_y**2],
    ]
    products = np.array([flat_x @ heights, flat_y @ heights])
    (x_slope, y_slope), *_ = np.linalg.lstsq(np.array(squares), products, rcond=_ON_A_LINE)
    z -= x_slope * x
    z -= y_slope * y
    z += x_slope * mean_x + y_slope * mean_y


def _texture(residuals: npt.NDArray[np.float64]) -> Texture:
    if not residuals.size:
        return Texture(float('nan'), float('nan'), float('nan'))
    return Texture(
        sa=float(np.mean(np.abs(residuals))),
        sq=float(np.sqrt(np.mean(residuals**2))),
        sz=float(np.ptp(residuals)),
    )


def _developed_ratio(levelled: _Levelled) -> float:
    if levelled.places is None:
        return float('nan')
    corners = [np.where(levelled.counted, values, np.nan) for values in (*levelled.places(), levelled.heights)]
    along, down = ([np.diff(values, axis=axis) for values in corners] for axis in (1, 0))
    tops, bottoms = [each[:-1] for each in along], [each[1:] for each in along]
    lefts, rights = [each[:, :-1] for each in down], [each[:, 1:] for each in down]
    # Two triangles at opposite corners fill the square; each of the four covers half of it.
    areas, below = 0.0, 0.0
    known = np.isfinite(sum(each[2] for each in (tops, bottoms, lefts, rights)))
    for across in (tops, bottoms):
        for beside in (lefts, rights):
            (x, y, z), (u, v, w) = ([each[known] for each in edge] for edge in (across, beside))
            flat = x * v - y * u
            areas += float(np.sum(np.sqrt(flat**2 + (y * w - z * v) ** 2 + (z * u - x * w) ** 2)))
            below += float(np.sum(np.abs(flat)))
    return areas / below - 1 if below > 0 else float('nan')
