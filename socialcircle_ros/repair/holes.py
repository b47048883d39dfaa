"""Which points may be filled: holes, their sides, their size, the heights round them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.cloud import Mask
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.kernels.union_find import root_of

MEASURED, UNUSABLE = -1, -2
"""In a map of unknowns: a height to go by; a place without any. From 0 on it is the number of an unknown."""

PADDING = 2
"""Rows and columns round that map."""


@kernel
def find_holes(holes: Mask) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Group the points of holes that touch along a side.

    Args:
        holes: (H, W) bool.

    Returns:
        Rows and columns (N, 2) of all points, hole after hole, each hole in row order; and where each hole
        starts in that list (M + 1), the last item being N.
    """
    height, width = holes.shape
    label = np.empty((height, width), np.int32)
    parent = np.empty(holes.sum(), np.int32)
    count = 0
    for row in range(height):
        for column in range(width):
            if not holes[row, column]:
                continue
            above = row > 0 and holes[row - 1, column]
            before = column > 0 and holes[row, column - 1]
            if above and before:
                first, second = root_of(parent, label[row - 1, column]), root_of(parent, label[row, column - 1])
                # The older root stays, so that holes are numbered by their first point in row order.
                label[row, column] = min(first, second)
                parent[max(first, second)] = min(first, second)
            elif above:
                label[row, column] = label[row - 1, column]
            elif before:
                label[row, column] = label[row, column - 1]
            else:
                label[row, column] = parent[count] = count
                count += 1
    number = np.empty(count, np.int32)
    roots = 0
    for item in range(count):
        if parent[item] == item:
            number[item] = roots
            roots += 1
        else:
            number[item] = number[root_of(parent, item)]
    starts = np.zeros(roots + 1, np.int32)
    for row in range(height):
        for column in range(width):
            if holes[row, column]:
                label[row, column] = number[label[row, column]]
                starts[label[row, column] + 1] += 1
    for hole in range(roots):
        starts[hole + 1] += starts[hole]
    points = np.empty((starts[-1], 2), np.int32)
    place = starts.copy()
    for row in range(height):
        for column in range(width):
            if holes[row, column]:
                points[place[label[row, column]]] = row, column
                place[label[row, column]] += 1
    return points, starts


@kernel
def find_rims(
    points: NDArray[np.int32], starts: NDArray[np.int32], holes: Mask, measured: Mask, largest: int
) -> NDArray[np.int32]:
    """Distances (N, 4) from each point to the rim of its hole: left, right, above, below.

    0 stands for a side on which the hole ends at the border of the cloud or at a point that is not measured,
    and for every side of a hole that is too large.
    """
    height, width = holes.shape
    rims = np.zeros((len(points), 4), np.int32)
    for hole in range(len(starts) - 1):
        if starts[hole + 1] - starts[hole] > largest:
            continue
        for point in range(starts[hole], starts[hole + 1]):
            for side in range(4):
                step_row = (0, 0, -1, 1)[side]
                step_column = (-1, 1, 0, 0)[side]
                row, column = points[point]
                distance = 0
                while 0 <= row < height and 0 <= column < width and holes[row, column]:
                    row += step_row
                    column += step_column
                    distance += 1
                if 0 <= row < height and 0 <= column < width and measured[row, column]:
                    rims[point, side] = distance
    return rims


@kernel
def choose_points(
    points: NDArray[np.int32],
    starts: NDArray[np.int32],
    rims: NDArray[np.int32],
    measured: Mask,
    z: NDArray[Any],
    sides: int,
    heights_agree: float,
) -> tuple[Mask, Mask]:
    """Which points are within the limits, and which of the others help to find their heights.

    Returns:
        Masks (N,). `inner` points lie between two opposite rims; with a point all others between the same
        rims are inner, so that their heights are determined. `chosen` points are inner, have the rim on
        at least `sides` sides, and the heights that touch their hole agree.
    """
    height, width = measured.shape
    inner = np.zeros(len(points), np.bool_)
    chosen = np.zeros(len(points), np.bool_)
    for hole in range(len(starts) - 1):
        lowest, highest = np.inf, -np.inf
        for point in range(starts[hole], starts[hole + 1]):
            left, right, above, below = rims[point]
            inner[point] = (left > 0 and right > 0) or (above > 0 and below > 0)
            chosen[point] = inner[point] and (left > 0) + (right > 0) + (above > 0) + (below > 0) >= sides
            if heights_agree > 0 and inner[point]:
                row, column = points[point]
                for r in range(max(row - 1, 0), min(row + 2, height)):
                    for c in range(max(column - 1, 0), min(column + 2, width)):
                        if measured[r, c]:
                            lowest, highest = min(lowest, z[r, c]), max(highest, z[r, c])
        if heights_agree > 0 and highest - lowest > heights_agree:
            chosen[starts[hole] : starts[hole + 1]] = False
    return inner, chosen


@kernel
def number_points(points: NDArray[np.int32], inner: Mask, measured: Mask) -> NDArray[np.int32]:
    """Map of the unknowns: the number of an inner point in the list, MEASURED or UNUSABLE.

    Round the (H, W) points of the cloud lie PADDING rows and columns of UNUSABLE, so that nobody who looks at
    the neighbours of a point has to ask where the cloud ends.
    """
    height, width = measured.shape
    unknowns = np.full((height + 2 * PADDING, width + 2 * PADDING), UNUSABLE, np.int32)
    for row in range(height):
        for column in range(width):
            if measured[row, column]:
                unknowns[row + PADDING, column + PADDING] = MEASURED
    for point in range(len(points)):
        if inner[point]:
            unknowns[points[point, 0] + PADDING, points[point, 1] + PADDING] = point
    return unknowns
