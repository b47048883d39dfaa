# SPDX-License-Identifier: Apache-2.0
"""The relief: a surface of the significant differences alone, flat wherever the cloud is smooth.

Its differences along rows and columns are, by least squares, the normalised differences beyond a threshold, and
0 elsewhere. That is a Poisson equation with free borders, as in gradient-domain image editing (R. Fattal, D.
Lischinski, M. Werman, Gradient domain high dynamic range compression, 2002,
https://doi.org/10.1145/566654.566573). Multigrid solves it, from the coarsest grid down. Slope and form are gone
from it, so that communities can be sought in it by height.
"""

import numpy as np
import numpy.typing as npt

from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .differences import MISSING, STEPS_PER_SPREAD, Differences

SIGNIFICANT = 2.5
"""Differences beyond this many spreads are significant."""

_SWEEPS = 4
_DAMPING = np.float32(0.8 / 4)
_COARSEST = 4

Relief = npt.NDArray[np.float32]
"""(H, W) float32, in spreads."""


def relief_of(differences: Differences) -> Relief:
    """Compute the surface of the significant differences.

    Args:
        differences: (4, H, W) int8, as `normalised_differences` gives them.

    Returns:
        (H, W) float32 in spreads; its level is arbitrary.
    """
    _, height, width = differences.shape
    wanted = np.empty((height, width), np.float32)
    threshold = round(SIGNIFICANT * STEPS_PER_SPREAD)
    in_bands(lambda rows: _divergence(differences, threshold, rows.start, rows.stop, wanted), height, width)
    surface = _solved(wanted)
    # A second descent corrects what the first left over.
    left = np.empty_like(wanted)
    in_bands(lambda rows: _residual(surface, wanted, rows.start, rows.stop, left), height, width)
    correction = _solved(left)
    np.add(surface, correction, out=surface)
    return surface


def _solved(wanted: Relief) -> Relief:
    """Approximate solution of (sum of the differences to the four neighbours) = wanted, coarsest grid first."""
    grids = [wanted]
    while min(grids[-1].shape) > _COARSEST:
        grids.append(_summed(grids[-1]))
    surface = np.zeros_like(grids[-1])
    for grid in reversed(grids):
        if surface.shape != grid.shape:
            surface = _finer(surface, grid.shape)
        other = np.empty_like(surface)
        for _ in range(_SWEEPS):
            _sweep(surface, grid, other)
            surface, other = other, surface
    return surface


def _finer(coarse: Relief, shape: tuple[int, ...]) -> Relief:
    fine = np.empty(shape, np.float32)
    in_bands(lambda rows: _refine(coarse, rows.start, rows.stop, fine), *shape)
    return fine


def _sweep(surface: Relief, wanted: Relief, result: Relief) -> None:
    in_bands(lambda rows: _smooth(surface, wanted, rows.start, rows.stop, result), *wanted.shape)


@kernel
def _divergence(differences: Differences, threshold: int, first: int, end: int, wanted: Relief) -> None:
    """Write the sum of the significant differences from each point to its four neighbours."""
    width = differences.shape[2]
    across, down = differences[0], differences[1]
    for row in range(first, end):
        for column in range(width):
            total = _significant(across[row, column], threshold) + _significant(down[row, column], threshold)
            if column > 0:
                total -= _significant(across[row, column - 1], threshold)
            if row > 0:
                total -= _significant(down[row - 1, column], threshold)
            wanted[row, column] = np.float32(total) / np.float32(STEPS_PER_SPREAD)


@kernel
def _significant(difference: np.int8, threshold: int) -> np.int32:
    """The difference, or 0 where it is missing or not significant."""
    wide = np.int32(difference)
    return wide if abs(wide) > threshold and wide != MISSING else np.int32(0)


@kernel
def _laplacian(surface: Relief, row: int, column: int) -> np.float32:
    """Sum of the differences from a point to its four neighbours; 0 across the border."""
    height, width = surface.shape
    here = surface[row, column]
    return np.float32(
        (surface[max(row - 1, 0), column] - here)
        + (surface[min(row + 1, height - 1), column] - here)
        + (surface[row, max(column - 1, 0)] - here)
        + (surface[row, min(column + 1, width - 1)] - here)
    )


@kernel
def _smooth(surface: Relief, wanted: Relief, first: int, end: int, result: Relief) -> None:
    """One damped Jacobi sweep."""
    height, width = surface.shape
    for row in range(first, end):
        above, below, middle = surface[max(row - 1, 0)], surface[min(row + 1, height - 1)], surface[row]
        for column in range(1, width - 1):
            here = middle[column]
            around = above[column] + below[column] + middle[column - 1] + middle[column + 1]
            result[row, column] = here + _DAMPING * (around - np.float32(4) * here - wanted[row, column])
        for column in (0, width - 1):
            result[row, column] = surface[row, column] + _DAMPING * (
                _laplacian(surface, row, column) - wanted[row, column]
            )


@kernel
def _residual(surface: Relief, wanted: Relief, first: int, end: int, left: Relief) -> None:
    """Write what the surface leaves over of the wanted differences."""
    height, width = surface.shape
    for row in range(first, end):
        above, below, middle = surface[max(row - 1, 0)], surface[min(row + 1, height - 1)], surface[row]
        for column in range(1, width - 1):
            here = middle[column]
            left[row, column] = wanted[row, column] - (
                (above[column] - here)
                + (below[column] - here)
                + (middle[column - 1] - here)
                + (middle[column + 1] - here)
            )
        for column in (0, width - 1):
            left[row, column] = wanted[row, column] - _laplacian(surface, row, column)


@kernel
def _summed(grid: Relief) -> Relief:
    """Half the rows and columns, each point the sum of its four."""
    height, width = grid.shape
    coarse = np.zeros(((height + 1) // 2, (width + 1) // 2), np.float32)
    for row in range(height):
        for column in range(width):
            coarse[row // 2, column // 2] += grid[row, column]
    return coarse


@kernel
def _refine(coarse: Relief, first: int, end: int, fine: Relief) -> None:
    """Write some rows of twice the rows and columns, bilinear between the centres."""
    rows, columns = coarse.shape
    width = fine.shape[1]
    near, far = np.float32(0.75), np.float32(0.25)
    start, stop = max(first // 2 - 1, 0), min((end - 1) // 2 + 2, rows)
    wide = np.empty((stop - start, width), np.float32)
    for row in range(start, stop):
        line = coarse[row]
        for column in range(width):
            beside = min(max(column // 2 + (1 if column % 2 else -1), 0), columns - 1)
            wide[row - start, column] = near * line[column // 2] + far * line[beside]
    for row in range(first, end):
        own = wide[row // 2 - start]
        other = wide[min(max(row // 2 + (1 if row % 2 else -1), 0), rows - 1) - start]
        for column in range(width):
            fine[row, column] = near * own[column] + far * other[column]
