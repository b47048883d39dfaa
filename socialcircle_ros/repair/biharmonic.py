"""Heights in a hole as the smoothest surface through the points round it, with steps kept sharp."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .holes import MEASURED, PADDING, UNUSABLE
from .profile import find_profile, height_on, measured_heights, sum_bends, usual_bend

_LEAST = 1000
"""Points to be filled that are worth a thread."""
_MARGIN = 0.5
"""Filled heights stay within the span of those round the hole, widened by this part of it on both sides."""

# The thin-plate energy ∬ z_xx² + 2 z_xy² + z_yy² as a sum of squared differences on the grid. One line for
# each kind of difference: row, column, coefficient of its points. √2 is for the 2 of the mixed derivative.
_ROOT = float(np.sqrt(2.0))
_DIFFERENCES = (
    ((0, 0, 1.0), (0, 1, -2.0), (0, 2, 1.0)),
    ((0, 0, 1.0), (1, 0, -2.0), (2, 0, 1.0)),
    ((0, 0, _ROOT), (0, 1, -_ROOT), (1, 0, -_ROOT), (1, 1, _ROOT)),
)


_AROUND = np.array([(r, c) for r in range(-2, 3) for c in range(-2, 3) if abs(r) + abs(c) <= 2])
"""The 13 points that a difference can join with a point, itself among them, in row order."""


def _views() -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Every difference as each of its points sees it, which is one line of the normal equations.

    Returns:
        Numbers (10, 4) of the points in `_AROUND`, and products of coefficients (10, 4); three points are
        filled up with the point itself and a 0.
    """
    number = {(int(row), int(column)): item for item, (row, column) in enumerate(_AROUND)}
    items = np.full((10, 4), number[0, 0])
    products = np.zeros((10, 4))
    views = [(own, difference) for difference in _DIFFERENCES for own in difference]
    for view, ((own_row, own_column, own_factor), difference) in enumerate(views):
        for place, (row, column, factor) in enumerate(difference):
            items[view, place] = number[row - own_row, column - own_column]
            products[view, place] = own_factor * factor
    return items, products


_ITEMS, _PRODUCTS = _views()


def _stencil() -> NDArray[np.float64]:
    """The line of a point whose 12 neighbours all have a height."""
    factors = np.zeros(len(_AROUND))
    np.add.at(factors, _ITEMS, _PRODUCTS)
    return factors


_STENCIL = _stencil()


def biharmonic_heights(
    z: NDArray[Any], unknowns: NDArray[np.int32], points: NDArray[np.int32], starts: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Solve every hole by itself: the heights of least thin-plate energy, which is 0 for a plane.

    Differences that would need a point that is neither measured nor in the hole are left out of the
    energy. The normal equations, banded in row order, are solved by Cholesky's method; they are definite,
    since each unknown lies in a row or column of unknowns between two measured points.

    A step or a groove through the hole would become a ramp with ringing. By linearity the profile that
    `find_profile` knows is taken from the heights before, and added to the solution.

    Args:
        z: (H, W) heights, float32 or float64.
        unknowns: padded map of the unknowns, numbered as the points are.
        points: (N, 2) rows and columns, hole after hole.
        starts: (M + 1) where each hole starts.

    Returns:
        Heights (N,) in the unit of z, NaN for a point that is no unknown.
    """
    heights = np.full(len(points), np.nan)
    holes = len(starts) - 1
    if holes == 0:
        return heights
    measured = measured_heights(z, unknowns)
    bends = sum_bends(measured, usual_bend(measured))

    def solve(some: slice) -> None:
        _solve_holes(measured, bends, unknowns, points, starts[some.start : some.stop + 1], heights)

    in_bands(solve, holes, len(points) // holes + 1, _LEAST)
    return heights


@kernel
def _solve_holes(
    measured: NDArray[Any],
    bends: tuple[NDArray[np.float64], NDArray[np.float64]],
    unknowns: NDArray[np.int32],
    points: NDArray[np.int32],
    starts: NDArray[np.int32],
    heights: NDArray[np.float64],
) -> None:
    """Fill in the heights of some holes; what they become depends on no other hole."""
    bands = np.empty(len(starts) - 1, np.int64)
    longest, most = 0, 0  # the largest hole and the largest matrix; memory is taken once
    for hole in range(len(bands)):
        first, last = starts[hole], starts[hole + 1]
        bands[hole] = _bandwidth(unknowns, points, first, last)
        if bands[hole] >= 0:
            longest = max(longest, last - first)
            most = max(most, (last - first) * (bands[hole] + 1))
    matrix_memory = np.empty(most)
    surface_memory = np.empty(longest)
    ring_memory = np.empty(longest * len(_AROUND))
    for hole in range(len(bands)):
        first, last = starts[hole], starts[hole + 1]
        band, size = bands[hole], last - first
        if band < 0:
            continue
        ring = _ring(measured, unknowns, points, first, last, ring_memory)
        lowest, highest = ring.min(), ring.max()
        margin = _MARGIN * (highest - lowest)
        matrix = matrix_memory[: size * (band + 1)].reshape(size, band + 1)
        surface = surface_memory[:size]
        profile = find_profile(measured, bends, points, first, last)
        _assemble(measured, profile, unknowns, points, first, matrix, surface)
        _factorize(matrix)
        _solve(matrix, surface)
        for own in range(size):
            row, column = points[first + own]
            if unknowns[row + PADDING, column + PADDING] < 0:
                continue
            height = surface[own] + height_on(profile, row, column)
            heights[first + own] = min(max(height, lowest - margin), highest + margin)


@kernel
def _bandwidth(unknowns: NDArray[np.int32], points: NDArray[np.int32], first: Any, last: Any) -> int:
    """Greatest distance in the list of two unknowns that a difference joins; -1 without unknowns."""
    band = -1
    for point in range(first, last):
        row, column = points[point, 0] + PADDING, points[point, 1] + PADDING
        if unknowns[row, column] < 0:
            continue
        for item in range(len(_AROUND) // 2 + 1):  # the point itself and those before it
            other = unknowns[row + _AROUND[item, 0], column + _AROUND[item, 1]]
            if other >= first:
                band = max(band, point - other)
    return band


@kernel
def _ring(
    measured: NDArray[Any],
    unknowns: NDArray[np.int32],
    points: NDArray[np.int32],
    first: Any,
    last: Any,
    memory: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Heights of the measured points that a difference can join with the hole."""
    count = 0
    for point in range(first, last):
        row, column = points[point]
        if unknowns[row + PADDING, column + PADDING] < 0:
            continue
        for item in range(len(_AROUND)):
            height = measured[row + PADDING + _AROUND[item, 0], column + PADDING + _AROUND[item, 1]]
            if not np.isnan(height):
                memory[count] = height
                count += 1
    return memory[:count]


@kernel
def _assemble(
    measured: NDArray[Any],
    profile: tuple[float, float, float, NDArray[np.float64]],
    unknowns: NDArray[np.int32],
    points: NDArray[np.int32],
    first: Any,
    matrix: NDArray[np.float64],
    right: NDArray[np.float64],
) -> None:
    """Normal equations of the thin-plate energy of the heights less their profile.

    `matrix` (n, band + 1) holds the lower band, the diagonal in its last column, and `right` (n) the
    right-hand side.
    """
    size, band = len(matrix), matrix.shape[1] - 1
    others = np.empty(len(_AROUND), np.int64)
    factors = np.empty(len(_AROUND))
    matrix[:] = 0.0
    right[:] = 0.0
    for own in range(size):
        row, column = points[first + own]
        if unknowns[row + PADDING, column + PADDING] < 0:
            matrix[own, band] = 1.0
            continue
        all_usable = True
        for item in range(len(_AROUND)):
            other = unknowns[row + PADDING + _AROUND[item, 0], column + PADDING + _AROUND[item, 1]]
            is_own_hole = first <= other < first + size
            others[item] = other - first if is_own_hole else MEASURED if other == MEASURED else UNUSABLE
            all_usable &= others[item] != UNUSABLE
            factors[item] = _STENCIL[item]
        if not all_usable:
            _leave_out(others, factors)
        for item in range(len(_AROUND)):
            if others[item] == MEASURED:
                r, c = row + _AROUND[item, 0], column + _AROUND[item, 1]
                right[own] -= factors[item] * (measured[r + PADDING, c + PADDING] - height_on(profile, r, c))
            elif 0 <= others[item] <= own:
                matrix[own, others[item] - own + band] += factors[item]


@kernel
def _leave_out(others: NDArray[np.int64], factors: NDArray[np.float64]) -> None:
    """The line of a point without the differences that would need an unusable point."""
    factors[:] = 0.0
    for view in range(len(_ITEMS)):
        complete = True
        for place in range(4):
            complete &= others[_ITEMS[view, place]] != UNUSABLE
        if complete:
            for place in range(4):
                factors[_ITEMS[view, place]] += _PRODUCTS[view, place]


@kernel
def _factorize(matrix: NDArray[np.float64]) -> None:
    """Cholesky's factor of a banded matrix, in place.

    Column by column, each taken from the rows below it, so that the innermost loop runs along memory and
    adds to different places: the compiler may then use vectors without changing the order of a sum.
    """
    size, band = len(matrix), matrix.shape[1] - 1
    below = np.empty(band + 1)
    for column in range(size):
        diagonal = np.sqrt(matrix[column, band])
        matrix[column, band] = diagonal
        end = min(size, column + band + 1)
        for row in range(column + 1, end):
            matrix[row, column - row + band] /= diagonal
            factor = matrix[row, column - row + band]
            below[row - column - 1] = factor
            if factor != 0.0:
                length = row - column
                target = matrix[row, band + 1 - length :]
                for k in range(length):
                    target[k] -= factor * below[k]


@kernel
def _solve(factor: NDArray[np.float64], right: NDArray[np.float64]) -> None:
    """Solve with Cholesky's factor, in place."""
    size, band = len(factor), factor.shape[1] - 1
    for row in range(size):
        total = right[row]
        for k in range(max(0, row - band), row):
            total -= factor[row, k - row + band] * right[k]
        right[row] = total / factor[row, band]
    for row in range(size - 1, -1, -1):
        right[row] /= factor[row, band]
        for k in range(max(0, row - band), row):
            right[k] -= factor[row, k - row + band] * right[row]
