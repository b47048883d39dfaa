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


def levelled_heights(xyz: Cloud, kept: Mask) -> npt.NDArray[np.float64]:
    """Heights relative to the plane that `texture` subtracts, also of points that do not count.

    Args:
        xyz: (H, W, 3) float32 or float64 cloud.
        kept: (H, W) bool, the points to which the plane is fitted, if they are measured.

    Returns:
        (H, W), NaN where a point is not measured; the heights as they are where fewer than three points count.
    """
    measured = np.isfinite(xyz).all(axis=2)
    heights = np.where(measured, xyz[..., 2], np.nan).astype(np.float64, copy=False)
    counted = measured & kept
    if np.count_nonzero(counted) < 3:
        return heights
    plane, x, y, _ = _fitted(xyz, np.where(counted, heights, 0.0), counted)
    return heights - plane.at(x, y)


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
    plane, x, y, places = _fitted(xyz, z, counted)
    z -= plane.at(x, y)
    return _Levelled(z, counted, places)


@dataclass(frozen=True)
class _Plane:
    """A plane over two coordinates; it goes through the middle of the points that it was fitted to."""

    middle: tuple[float, float, float]
    x_slope: float
    y_slope: float

    def at(self, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Its heights."""
        middle_x, middle_y, middle_z = self.middle
        return middle_z + self.y_slope * (y - middle_y) + self.x_slope * (x - middle_x)


def _fitted(
    xyz: Cloud | None, z: npt.NDArray[np.float64], counted: Mask
) -> tuple[_Plane, npt.NDArray[np.float64], npt.NDArray[np.float64], Callable[[], _Coordinates] | None]:
    """The least squares plane of a cloud, or of a height map without a cloud.

    Args:
        xyz: (H, W, 3); None: a height map.
        z: (H, W) the heights, 0 where a point does not count.
        counted: (H, W) the points that count, at least three.

    Returns:
        The plane; the coordinates over which it is one, which broadcast to (H, W); and what gives x and y, as
        `_Levelled` has it.
    """
    grid = None if xyz is None else nearest_grid(xyz, counted)
    if xyz is None or grid is None or grid.holds(xyz, counted):
        rows, columns = (np.arange(count, dtype=np.float64) for count in counted.shape)
        places = None if grid is None else partial(grid.coordinates, counted.shape)
        return _plane_over_numbers(z, counted), columns, rows[:, np.newaxis], places
    x, y = _own_places(xyz, counted)
    return _plane_over_places(z, counted, x, y), x, y, lambda: (x, y)


def _own_places(xyz: Cloud, counted: Mask) -> _Coordinates:
    """Give x and y relative to the first point that counts, (H, W) each; 0 where they are not finite."""
    first = np.unravel_index(int(counted.argmax()), counted.shape)
    places = []
    for axis in (0, 1):
        values = np.subtract(xyz[..., axis], xyz[..., axis][first], dtype=np.float64)
        values[~np.isfinite(values)] = 0.0
        places.append(values)
    return places[0], places[1]


def _plane_over_numbers(z: npt.NDArray[np.float64], counted: Mask) -> _Plane:
    """Fit the plane over the numbers of columns and rows to heights that are 0 where none counts.

    Sums over rows and columns give the normal equations of the plane in less than half the time of a list of
    points. Coordinates and heights are centred, so that the equations stay well conditioned on large maps.
    """
    per_row, per_column = counted.sum(axis=1), counted.sum(axis=0)
    count = per_row.sum()
    middle_row, middle_column = (float(n @ np.arange(len(n)) / count) for n in (per_row, per_column))
    rows, columns = np.arange(len(per_row)) - middle_row, np.arange(len(per_column)) - middle_column
    mean = float(z.sum() / count)
    row_sums, column_sums = z.sum(axis=1) - mean * per_row, z.sum(axis=0) - mean * per_column
    mixed = rows @ (counted @ columns)
    squares = [[per_row @ rows**2, mixed], [mixed, per_column @ columns**2]]
    products = np.array([row_sums @ rows, column_sums @ columns])
    (row_slope, column_slope), *_ = np.linalg.lstsq(np.array(squares), products, rcond=None)
    return _Plane((middle_column, middle_row, mean), float(column_slope), float(row_slope))


def _plane_over_places(
    z: npt.NDArray[np.float64], counted: Mask, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]
) -> _Plane:
    """Fit the plane over x and y to heights that are 0 where none counts."""
    count = np.count_nonzero(counted)
    mean = float(z.sum() / count)
    flat_x, flat_y, heights = (np.where(counted, each, 0.0).ravel() for each in (x, y, z - mean))
    mean_x, mean_y = float(flat_x.sum() / count), float(flat_y.sum() / count)
    mixed = flat_x @ flat_y - count * mean_x * mean_y
    squares = [
        [flat_x @ flat_x - count * mean_x**2, mixed],
        [mixed, flat_y @ flat_y - count * mean_y**2],
    ]
    products = np.array([flat_x @ heights, flat_y @ heights])
    (x_slope, y_slope), *_ = np.linalg.lstsq(np.array(squares), products, rcond=_ON_A_LINE)
    return _Plane((mean_x, mean_y, mean), float(x_slope), float(y_slope))


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
