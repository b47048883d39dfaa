"""Heights in a hole as the smoothest surface through the points round it, with steps kept sharp."""

from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.compiled import kernel

from .holes import MEASURED, PADDING, UNUSABLE, Index, Reals

_STEP = 1.5
"""A step is a gap in the heights round a hole of more than this times the span of either level."""

_BEND = 0.5
"""Where a step meets the rim of a hole, the smoothest surface is left with a difference of more than this
part of the step: 0.8 to 1.4 for a sharp step in discs of 1 to 9841 points, 0 for a plane."""

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


def _views() -> tuple[npt.NDArray[np.int64], Reals]:
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

_DIRECTIONS = np.array([(0, 1), (1, 0), (1, 1), (1, -1), (1, 2), (2, 1), (1, -2), (2, -1)])
"""Lines across a hole that are asked on which side of a step a point lies."""


@kernel
def biharmonic_heights(z: npt.NDArray[Any], unknowns: Index, points: Index, starts: Index) -> Reals:
    """Solve every hole by itself: the heights of least thin-plate energy, which is 0 for a plane.

    Differences that would need a point that is neither measured nor in the hole are left out of the
    energy. The normal equations, banded in row order, are solved by Cholesky's method; they are definite,
    since each unknown lies in a row or column of unknowns between two measured points.

    Where the heights round a hole fall into two levels, far from each other for the span of each, and the
    smoothest surface between them has to bend sharply, a step runs through the
    hole, and that surface would be a ramp with ringing. By linearity it is the sum of the
    surface without the step and step · u, u being the smoothest surface through 0 on the lower level and 1 on
    the upper. u is replaced by what lines across the hole say: a straight step is never crossed by a line
    whose two ends lie on one level, so that such a line tells the level of its points (the nearer ends count
    more, by 1/length²). Points without such a line keep u.

    Args:
        z: (H, W) heights, float32 or float64.
        unknowns: padded map of the unknowns, numbered as the points are.
        points: (N, 2) rows and columns, hole after hole.
        starts: (M + 1) where each hole starts.

    Returns:
        Heights (N,) in the unit of z, NaN for a point that is no unknown.
    """
    heights = np.full(len(points), np.nan)
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
    smooth_memory = np.empty(longest)
    ring_memory = np.empty(longest * len(_AROUND))
    for hole in range(len(bands)):
        first, last = starts[hole], starts[hole + 1]
        band, size = bands[hole], last - first
        if band < 0:
            continue
        ring = _ring(z, unknowns, points, first, last, ring_memory)
        lowest, highest = ring.min(), ring.max()
        split, step = _find_step(ring, lowest, highest)
        matrix = matrix_memory[: size * (band + 1)].reshape(size, band + 1)
        surface, smooth = surface_memory[:size], smooth_memory[:size]
        if step > 0:
            _assemble(z, split, unknowns, points, first, matrix, smooth)
        _assemble(z, np.nan, unknowns, points, first, matrix, surface)
        _factorize(matrix)
        _solve(matrix, surface)
        if step > 0 and _bend(z, unknowns, points, first, surface) < _BEND * step:
            step = 0.0
        if step > 0:
            _solve(matrix, smooth)
        margin = _MARGIN * (highest - lowest)
        for own in range(size):
            row, column = points[first + own]
            if unknowns[row + PADDING, column + PADDING] < 0:
                continue
            height = surface[own]
            if step > 0:
                level = _level(z, split, unknowns, row, column, first, last)
                height += step * (level - smooth[own]) if level >= 0 else 0.0
            heights[first + own] = min(max(height, lowest - margin), highest + margin)
    return heights


@kernel
def _bandwidth(unknowns: Index, points: Index, first: Any, last: Any) -> int:
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
def _ring(z: npt.NDArray[Any], unknowns: Index, points: Index, first: Any, last: Any, memory: Reals) -> Reals:
    """Heights of the measured points that a difference can join with the hole."""
    count = 0
    for point in range(first, last):
        row, column = points[point]
        if unknowns[row + PADDING, column + PADDING] < 0:
            continue
        for item in range(len(_AROUND)):
            r, c = row + _AROUND[item, 0], column + _AROUND[item, 1]
            if unknowns[r + PADDING, c + PADDING] == MEASURED:
                memory[count] = z[r, c]
                count += 1
    return memory[:count]


@kernel
def _find_step(ring: Reals, lowest: float, highest: float) -> tuple[float, float]:
    """Height between the two levels of a step, and the step from mean to mean; 0 where there is none.

    Where a gap is wider than the span of either level, the middle of all heights lies in it.
    """
    middle = (lowest + highest) / 2
    lower_top, upper_bottom = lowest, highest
    lower_sum, upper_sum = 0.0, 0.0
    lower_count = 0
    for height in ring:
        if height > middle:
            upper_bottom = min(upper_bottom, height)
            upper_sum += height
        else:
            lower_top = max(lower_top, height)
            lower_sum += height
            lower_count += 1
    if upper_bottom - lower_top > _STEP * max(lower_top - lowest, highest - upper_bottom):
        return middle, upper_sum / (len(ring) - lower_count) - lower_sum / lower_count
    return middle, 0.0


@kernel
def _assemble(
    z: npt.NDArray[Any], split: float, unknowns: Index, points: Index, first: Any, matrix: Reals, right: Reals
) -> None:
    """Normal equations of the thin-plate energy of the heights or, where `split` is no NaN, of the levels.

    `matrix` (n, band + 1) holds the lower band, the diagonal in its last column, and `right` (n) the
    right-hand side. The level of a point is 1 above `split`, else 0.
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
        for item in range(len(_AROUND)):
            other = unknowns[row + PADDING + _AROUND[item, 0], column + PADDING + _AROUND[item, 1]]
            is_own_hole = first <= other < first + size
            others[item] = other - first if is_own_hole else MEASURED if other == MEASURED else UNUSABLE
            factors[item] = 0.0
        for view in range(len(_ITEMS)):
            complete = True
            for place in range(4):
                complete &= others[_ITEMS[view, place]] != UNUSABLE
            if complete:
                for place in range(4):
                    factors[_ITEMS[view, place]] += _PRODUCTS[view, place]
        for item in range(len(_AROUND)):
            if others[item] == MEASURED:
                height = z[row + _AROUND[item, 0], column + _AROUND[item, 1]]
                value = np.float64(height) if np.isnan(split) else np.float64(height > split)
                right[own] -= factors[item] * value
            elif 0 <= others[item] <= own:
                matrix[own, others[item] - own + band] += factors[item]


@kernel
def _bend(z: npt.NDArray[Any], unknowns: Index, points: Index, first: Any, surface: Reals) -> float:
    """The greatest difference, as its points see it, that is left in the smoothest surface."""
    greatest = 0.0
    last = first + len(surface)
    for own in range(len(surface)):
        row, column = points[first + own]
        if unknowns[row + PADDING, column + PADDING] < 0:
            continue
        for view in range(len(_ITEMS)):
            total = 0.0
            for place in range(4):
                item = _ITEMS[view, place]
                r, c = row + _AROUND[item, 0], column + _AROUND[item, 1]
                other = unknowns[r + PADDING, c + PADDING]
                if other == MEASURED:
                    total += _PRODUCTS[view, place] * z[r, c]
                elif first <= other < last:
                    total += _PRODUCTS[view, place] * surface[other - first]
                else:
                    total = np.nan
            greatest = max(greatest, abs(total)) if not np.isnan(total) else greatest
    return greatest


@kernel
def _factorize(matrix: Reals) -> None:
    """Cholesky's factor of a banded matrix, in place."""
    size, band = len(matrix), matrix.shape[1] - 1
    for row in range(size):
        start = max(0, row - band)
        for column in range(start, row + 1):
            total = matrix[row, column - row + band]
            for k in range(max(start, column - band), column):
                total -= matrix[row, k - row + band] * matrix[column, k - column + band]
            if column < row:
                matrix[row, column - row + band] = total / matrix[column, band]
            else:
                matrix[row, band] = np.sqrt(total)


@kernel
def _solve(factor: Reals, right: Reals) -> None:
    """Solve with Cholesky's factor, in place."""
    size, band = len(factor), factor.shape[1] - 1
    for row in range(size):
        total = right[row]
        for k in range(max(0, row - band), row):
            total -= factor[row, k - row + band] * right[k]
        right[row] = total / factor[row, band]
    for row in range(size - 1, -1, -1):
        total = right[row]
        for k in range(row + 1, min(size, row + band + 1)):
            total -= factor[k, row - k + band] * right[k]
        right[row] = total / factor[row, band]


@kernel
def _level(
    z: npt.NDArray[Any], split: float, unknowns: Index, row: Any, column: Any, first: Any, last: Any
) -> float:
    """The level of a point beside a step, 0 to 1, from the lines across the hole; -1 where none tells."""
    total, weights = 0.0, 0.0
    for direction in range(len(_DIRECTIONS)):
        step_row, step_column = _DIRECTIONS[direction]
        ends, levels, length = 0, 0, 0
        for sign in (-1, 1):
            r, c = row, column
            while first <= unknowns[r + PADDING, c + PADDING] < last:
                r += sign * step_row
                c += sign * step_column
                length += 1
            if unknowns[r + PADDING, c + PADDING] == MEASURED:
                ends += 1
                levels += z[r, c] > split
        if ends == 2 and levels != 1:
            weight = 1.0 / (length * length * (step_row * step_row + step_column * step_column))
            weights += weight
            total += weight if levels == 2 else 0.0
    return total / weights if weights > 0 else -1.0
