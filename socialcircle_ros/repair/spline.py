"""Heights in a hole as the paper finds them: cubic B-splines along rows and columns (section 4.2)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.kernels.compiled import kernel

from .holes import MEASURED, PADDING


def spline_heights(z: NDArray[Any], unknowns: NDArray[np.int32], rims: NDArray[np.int32]) -> NDArray[np.float64]:
    """Interpolate along rows and columns, and mix the two by 1/gap².

    A cubic B-spline through all measured points of a line is its interpolating cubic spline, here with
    natural ends. It is evaluated between two rims of a hole only, never beyond: it runs wild there.

    Args:
        z: (H, W) heights, float32 or float64.
        unknowns: padded map of the unknowns.
        rims: (N, 4) distances to the rims.

    Returns:
        Heights (N,) of the unknowns in the unit of z, NaN where a number stands for no unknown.
    """
    unknowns = unknowns[PADDING:-PADDING, PADDING:-PADDING]
    total = np.zeros(len(rims))
    weights = np.zeros(len(rims))
    _add_lines(z, unknowns, rims[:, :2], total, weights)
    _add_lines(z.T, unknowns.T, rims[:, 2:], total, weights)
    heights = np.full(len(rims), np.nan)
    np.divide(total, weights, out=heights, where=weights > 0)
    return heights


@kernel
def _add_lines(
    z: NDArray[Any],
    unknowns: NDArray[np.int32],
    rims: NDArray[np.int32],
    total: NDArray[np.float64],
    weights: NDArray[np.float64],
) -> None:
    """Add the spline's weighted heights of every row to `total`, and their weights to `weights`."""
    height, width = unknowns.shape
    place = np.empty(width, np.int64)
    value = np.empty(width, np.float64)
    curvature = np.empty(width, np.float64)
    ratio = np.empty(width, np.float64)
    for row in range(height):
        count = 0
        wanted = False
        for column in range(width):
            if unknowns[row, column] == MEASURED:
                place[count] = column
                value[count] = z[row, column]
                count += 1
            elif unknowns[row, column] >= 0:
                wanted = True
        if not wanted or count < 2:
            continue
        # Second derivatives at the knots, 0 at both ends: a tridiagonal system, solved from left to right.
        curvature[0] = ratio[0] = 0.0
        for knot in range(1, count - 1):
            before, after = place[knot] - place[knot - 1], place[knot + 1] - place[knot]
            bend = (value[knot + 1] - value[knot]) / after - (value[knot] - value[knot - 1]) / before
            pivot = 2.0 * (before + after) - before * ratio[knot - 1]
            ratio[knot] = after / pivot
            curvature[knot] = (6.0 * bend - before * curvature[knot - 1]) / pivot
        curvature[count - 1] = 0.0
        for knot in range(count - 2, 0, -1):
            curvature[knot] -= ratio[knot] * curvature[knot + 1]
        knot = 0
        for column in range(place[0], place[count - 1]):
            if place[knot + 1] <= column:
                knot += 1
            unknown = unknowns[row, column]
            if unknown < 0 or rims[unknown, 0] == 0 or rims[unknown, 1] == 0:
                continue
            gap = place[knot + 1] - place[knot]
            after = (column - place[knot]) / gap
            before = 1.0 - after
            bend = (before**3 - before) * curvature[knot] + (after**3 - after) * curvature[knot + 1]
            weight = 1.0 / (gap * gap)
            total[unknown] += weight * (before * value[knot] + after * value[knot + 1] + bend * gap * gap / 6.0)
            weights[unknown] += weight
