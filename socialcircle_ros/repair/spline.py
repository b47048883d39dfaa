# SPDX-License-Identifier: Apache-2.0
"""Heights in a hole by the method of the paper (section 4.2): cubic B-splines along rows and columns."""

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.cloud import Floats
from socialcircle_ros.kernels.compiled import kernel

from .holes import MEASURED, PADDING


def spline_heights(
    z: Floats, unknowns: NDArray[np.int32], rims: NDArray[np.int32], ratio: float = 1.0
) -> NDArray[np.float64]:
    """Interpolate along rows and along columns, and average the two with the weights 1/gap².

    A gap is a length: in a column its points count `ratio` times.

    The cubic B-spline through all measured points of a line is the interpolating cubic spline of that line, here
    with natural ends. It is evaluated only between two rims of a hole; outside it oscillates strongly. Beside a
    step it can do so inside, too, the more the wider the gap: the method of the paper has no bounds.

    Args:
        z: (H, W) heights.
        unknowns: padded map of the unknowns, from `number_points`.
        rims: (N, 4) distances to the rims, from `find_rims`.
        ratio: distance of the rows over that of the columns.

    Returns:
        Heights (N,) in the unit of z, NaN for a point that is not an unknown.
    """
    unknowns = unknowns[PADDING:-PADDING, PADDING:-PADDING]
    total = np.zeros(len(rims))
    weights = np.zeros(len(rims))
    _add_lines(z, unknowns, rims[:, :2], 1.0, total, weights)
    _add_lines(z.T, unknowns.T, rims[:, 2:], ratio, total, weights)
    heights = np.full(len(rims), np.nan)
    np.divide(total, weights, out=heights, where=weights > 0)
    return heights


@kernel
def _add_lines(
    z: Floats,
    unknowns: NDArray[np.int32],
    rims: NDArray[np.int32],
    pitch: float,
    total: NDArray[np.float64],
    weights: NDArray[np.float64],
) -> None:
    """Add the weighted heights of the spline in each row to `total` (N,), and the weights to `weights` (N,)."""
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
        # Second derivatives at the knots, 0 at both ends: a tridiagonal system, solved by elimination.
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
            weight = 1.0 / ((pitch * gap) * (pitch * gap))
            total[unknown] += weight * (before * value[knot] + after * value[knot + 1] + bend * gap * gap / 6.0)
            weights[unknown] += weight
