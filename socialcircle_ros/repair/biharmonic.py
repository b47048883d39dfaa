# SPDX-License-Identifier: Apache-2.0
"""Heights in a hole as the smoothest surface through the points next to it, with steps kept sharp.

The smoothest surface is that of least thin-plate energy, which is 0 for a plane. Source: J. Duchon, Splines
minimizing rotation-invariant semi-norms in Sobolev spaces, 1977, DOI 10.1007/BFb0086566.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.cloud import Floats
from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.kernels.sampling import sampled_rows

from .bounds import AROUND, MARGIN, span_at_rim
from .holes import MEASURED, PADDING, UNUSABLE, Holes
from .profile import Profile, find_profile, height_on
from .second_differences import (
    SAMPLED_POINTS,
    DifferenceTables,
    measured_heights,
    sum_differences,
    usual_squared_differences,
)

_LEAST = 1000
"""Points of holes below which a thread costs more than it saves."""

# The thin-plate energy ∬ z_xx² + 2 z_xy² + z_yy² is a sum of squared differences on the grid. There is one line
# for each kind of difference, with (row, column, coefficient) of its points. √2 stands for the 2 of z_xy². Where
# the pitches differ, `_weighted` gives each kind its weight.
_ROOT = float(np.sqrt(2.0))
_DIFFERENCES = (
    ((0, 0, 1.0), (0, 1, -2.0), (0, 2, 1.0)),
    ((0, 0, 1.0), (1, 0, -2.0), (2, 0, 1.0)),
    ((0, 0, _ROOT), (0, 1, -_ROOT), (1, 0, -_ROOT), (1, 1, _ROOT)),
)


def _views() -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """List each difference relative to each of its points: its share of a row of the normal matrix.

    Returns:
        Indices (10, 4) of the points of the difference in `AROUND`, and products of coefficients (10, 4). A
        difference of three points is completed by the point itself with a 0.
    """
    number = {(int(row), int(column)): item for item, (row, column) in enumerate(AROUND)}
    items = np.full((10, 4), number[0, 0])
    products = np.zeros((10, 4))
    views = [(own, difference) for difference in _DIFFERENCES for own in difference]
    for view, ((own_row, own_column, own_factor), difference) in enumerate(views):
        for place, (row, column, factor) in enumerate(difference):
            items[view, place] = number[row - own_row, column - own_column]
            products[view, place] = own_factor * factor
    return items, products


_ITEMS, _PRODUCTS = _views()


class _Energy(NamedTuple):
    """The thin-plate energy on a grid of some pitches."""

    products: NDArray[np.float64]
    """(10, 4), see `_views`."""

    stencil: NDArray[np.float64]
    """(13,): the row of the normal matrix of a point if its 12 neighbours all have heights."""


def _weighted(ratio: float) -> _Energy:
    """The energy times dx · dy, for dy/dx = `ratio`.

    z_xx² is a squared difference over dx⁴, z_yy² one over dy⁴ and z_xy² one over dx² · dy²: times dx² · dy², which
    changes no solution, the weights are (dy/dx)², (dx/dy)² and 1.
    """
    weights = (ratio**2, ratio**-2, 1.0)
    of_view = [weight for weight, points in zip(weights, _DIFFERENCES, strict=True) for _ in points]
    products = _PRODUCTS * np.array(of_view)[:, np.newaxis]
    stencil = np.zeros(len(AROUND))
    np.add.at(stencil, _ITEMS, products)
    return _Energy(products, stencil)


def biharmonic_heights(
    z: Floats, unknowns: NDArray[np.int32], holes: Holes, ratio: float = 1.0
) -> NDArray[np.float64]:
    """Find the heights of least thin-plate energy, one hole at a time.

    A difference that needs a point that is neither measured nor in the hole is left out of the energy. The normal
    equations are banded, in row order, and are solved by Cholesky decomposition. They are positive definite,
    because each unknown is between two measured points in its row or its column.

    A step or a groove through the hole would become a ramp with ringing. The equations are linear: therefore the
    profile from `find_profile` is subtracted from the heights before, and added to the solution. Its directions
    and distances count points, whatever the pitches: a straight step is straight in points, too.

    Heights stay within the span of those at the rim of their hole, widened by `MARGIN`.

    Args:
        z: (H, W) heights.
        unknowns: padded map of the unknowns, from `number_points`.
        holes: (N, 2) points, in M holes.
        ratio: distance of the rows over that of the columns.

    Returns:
        Heights (N,) in the unit of z, NaN for a point that is not an unknown.
    """
    heights = np.full(len(holes.points), np.nan)
    count = len(holes.starts) - 1
    if count == 0:
        return heights
    measured = measured_heights(z, unknowns)
    rows = sampled_rows(z.shape[0], z.shape[1], SAMPLED_POINTS)
    tables = sum_differences(measured, usual_squared_differences(measured, rows, ratio == 1.0))
    energy = _weighted(ratio)

    def solve(some: slice) -> None:
        part = Holes(holes.points, holes.starts[some.start : some.stop + 1])
        _solve_holes(measured, tables, energy, unknowns, part, heights)

    in_bands(solve, count, len(holes.points) // count + 1, _LEAST)
    return heights


@kernel
def _solve_holes(
    measured: Floats,
    tables: DifferenceTables,
    energy: _Energy,
    unknowns: NDArray[np.int32],
    holes: Holes,
    heights: NDArray[np.float64],
) -> None:
    """Write the heights of some holes; each hole is solved independently of the others."""
    points, starts = holes
    bands = np.empty(len(starts) - 1, np.int64)
    longest, most = 0, 0  # of the largest hole and the largest matrix, so that memory is allocated once
    for hole in range(len(bands)):
        first, last = starts[hole], starts[hole + 1]
        bands[hole] = _bandwidth(unknowns, points, first, last)
        if bands[hole] >= 0:
            longest = max(longest, last - first)
            most = max(most, (last - first) * (bands[hole] + 1))
    matrix_memory = np.empty(most)
    surface_memory = np.empty(longest)
    for hole in range(len(bands)):
        first, last = starts[hole], starts[hole + 1]
        band, size = bands[hole], last - first
        if band < 0:
            continue
        lowest, highest = span_at_rim(measured, unknowns, points, first, last)
        margin = MARGIN * (highest - lowest)
        matrix = matrix_memory[: size * (band + 1)].reshape(size, band + 1)
        surface = surface_memory[:size]
        profile = find_profile(measured, tables, points, first, last)
        _assemble(measured, profile, energy, unknowns, points, first, matrix, surface)
        _factorize(matrix)
        _solve(matrix, surface)
        for own in range(size):
            row, column = points[first + own]
            if unknowns[row + PADDING, column + PADDING] < 0:
                continue
            height = surface[own] + height_on(profile, row, column)
            heights[first + own] = min(max(height, lowest - margin), highest + margin)


@kernel
def _bandwidth(unknowns: NDArray[np.int32], points: NDArray[np.int32], first: int, last: int) -> int:
    """Find the bandwidth of the normal matrix of the hole from `first` to before `last` in `points`.

    Returns:
        The largest distance, in the list of points, of two unknowns that share a difference; -1 without unknowns.
    """
    band = -1
    for point in range(first, last):
        row, column = points[point, 0] + PADDING, points[point, 1] + PADDING
        if unknowns[row, column] < 0:
            continue
        for item in range(len(AROUND) // 2 + 1):  # the point itself and those before it
            other = unknowns[row + AROUND[item, 0], column + AROUND[item, 1]]
            if other >= first:
                band = max(band, point - other)
    return band


@kernel
def _assemble(
    measured: Floats,
    profile: Profile,
    energy: _Energy,
    unknowns: NDArray[np.int32],
    points: NDArray[np.int32],
    first: int,
    matrix: NDArray[np.float64],
    right: NDArray[np.float64],
) -> None:
    """Write the normal equations of the thin-plate energy of the heights less their profile.

    Args:
        measured: padded heights.
        profile: through the hole.
        energy: of the grid.
        unknowns: padded map of the unknowns.
        points: (N, 2), rows and columns of the points of all holes.
        first: where the n points of the hole start.
        matrix: (n, band + 1), overwritten by the lower band, with the diagonal in the last column.
        right: (n,), overwritten by the right-hand side.
    """
    size, band = len(matrix), matrix.shape[1] - 1
    others = np.empty(len(AROUND), np.int64)
    factors = np.empty(len(AROUND))
    matrix[:] = 0.0
    right[:] = 0.0
    for own in range(size):
        row, column = points[first + own]
        if unknowns[row + PADDING, column + PADDING] < 0:
            matrix[own, band] = 1.0
            continue
        all_usable = True
        for item in range(len(AROUND)):
            other = unknowns[row + PADDING + AROUND[item, 0], column + PADDING + AROUND[item, 1]]
            is_own_hole = first <= other < first + size
            others[item] = other - first if is_own_hole else MEASURED if other == MEASURED else UNUSABLE
            all_usable &= others[item] != UNUSABLE
            factors[item] = energy.stencil[item]
        if not all_usable:
            _drop_unusable(energy.products, others, factors)
        for item in range(len(AROUND)):
            if others[item] == MEASURED:
                r, c = row + AROUND[item, 0], column + AROUND[item, 1]
                right[own] -= factors[item] * (measured[r + PADDING, c + PADDING] - height_on(profile, r, c))
            elif 0 <= others[item] <= own:
                matrix[own, others[item] - own + band] += factors[item]


@kernel
def _drop_unusable(products: NDArray[np.float64], others: NDArray[np.int64], factors: NDArray[np.float64]) -> None:
    """Write the row of the normal matrix of a point, without the differences that need an unusable point.

    Args:
        products: (10, 4), of the energy.
        others: (13,), the points in `AROUND`: number in the hole, MEASURED or UNUSABLE.
        factors: (13,), overwritten by their coefficients.
    """
    factors[:] = 0.0
    for view in range(len(_ITEMS)):
        complete = True
        for place in range(4):
            complete &= others[_ITEMS[view, place]] != UNUSABLE
        if complete:
            for place in range(4):
                factors[_ITEMS[view, place]] += products[view, place]


@kernel
def _factorize(matrix: NDArray[np.float64]) -> None:
    """Replace a banded matrix (n, band + 1) by its Cholesky factor.

    Each column is subtracted from the rows below it. The innermost loop then runs along memory and adds to
    different elements, so that the compiler vectorises it without changing the order of a sum.
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
    """Replace the right-hand side (n,) by the solution, from the Cholesky factor."""
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
