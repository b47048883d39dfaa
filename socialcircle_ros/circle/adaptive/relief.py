"""A surface of the significant differences alone: flat where the cloud is smooth, with a step where it is not.

It is the least-squares surface whose differences are those beyond a threshold, and 0 elsewhere: a Poisson
equation with free borders (as in gradient-domain image editing, Fattal et al. 2002), solved by multigrid from the
coarsest grid down. Communities are looked for in it, as slopes and form are gone.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .differences import NONE, UNIT, Differences

SIGNIFICANT = 2.5
"""Differences beyond so many spreads are surprising."""

_SWEEPS = 4
_DAMPING = np.float32(0.8 / 4)
_COARSEST = 4

Relief = npt.NDArray[np.float32]


def relief_of(differences: Differences) -> Relief:
    """The surface of the surprising differences, in spreads.

    Args:
        differences: (4, H, W) int8, as `normalised_differences` gives them.

    Returns:
        (H, W) float32; its level is arbitrary, and 0 at best by chance.
    """
    _, height, width = differences.shape
    wanted = np.empty((height, width), np.float32)

    def fill(rows: slice) -> None:
        _divergence(differences, round(SIGNIFICANT * UNIT), rows.start, rows.stop, wanted)

    in_bands(fill, height, width)
    surface = _solved(wanted)
    # Once more for what the first descent left over.
    left = np.empty_like(wanted)
    in_bands(lambda rows: _residual(surface, wanted, rows.start, rows.stop, left), height, width)
    correction = _solved(left)
    np.add(surface, correction, out=surface)
    return surface


def _solved(wanted: Relief) -> Relief:
    """Approximate solution of (sum of the differences to the neighbours) = wanted, coarsest grid first."""
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


def _finer(coarse: Relief, shape: tuple[int, int]) -> Relief:
    fine = np.empty(shape, np.float32)
    in_bands(lambda rows: _refined(coarse, rows.start, rows.stop, fine), *shape)
    return fine


def _sweep(surface: Relief, wanted: Relief, result: Relief) -> None:
    in_bands(lambda rows: _smooth(surface, wanted, rows.start, rows.stop, result), *wanted.shape)


@kernel
def _divergence(differences: Any, threshold: int, first: int, end: int, wanted: Any) -> None:
    width = differences.shape[2]
    for row in range(first, end):
        for column in range(width):
            total = _significant(differences[0, row, column], threshold) + _significant(
                differences[1, row, column], threshold
            )
            if column > 0:
                total -= _significant(differences[0, row, column - 1], threshold)
            if row > 0:
                total -= _significant(differences[1, row - 1, column], threshold)
            wanted[row, column] = np.float32(total) / np.float32(UNIT)


@kernel
def _significant(difference: Any, threshold: int) -> Any:
    wide = np.int32(difference)
    return wide if abs(wide) > threshold and wide != NONE else np.int32(0)


@kernel
def _difference(surface: Any, row: int, column: int) -> Any:
    """Sum of the differences from a point to its four neighbours; none across the border."""
    height, width = surface.shape
    here = surface[row, column]
    return (
        (surface[max(row - 1, 0), column] - here)
        + (surface[min(row + 1, height - 1), column] - here)
        + (surface[row, max(column - 1, 0)] - here)
        + (surface[row, min(column + 1, width - 1)] - here)
    )


@kernel
def _smooth(surface: Any, wanted: Any, first: int, end: int, result: Any) -> None:
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
                _difference(surface, row, column) - wanted[row, column]
            )


@kernel
def _residual(surface: Any, wanted: Any, first: int, end: int, left: Any) -> None:
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
            left[row, column] = wanted[row, column] - _difference(surface, row, column)


@kernel
def _summed(grid: Any) -> Any:
    """Half the rows and columns, each the sum of its four."""
    height, width = grid.shape
    coarse = np.zeros(((height + 1) // 2, (width + 1) // 2), np.float32)
    for row in range(height):
        for column in range(width):
            coarse[row // 2, column // 2] += grid[row, column]
    return coarse


@kernel
def _refined(coarse: Any, first: int, end: int, fine: Any) -> None:
    """Twice the rows and columns, bilinear between the centres."""
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
