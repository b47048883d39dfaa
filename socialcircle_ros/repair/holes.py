# SPDX-License-Identifier: Apache-2.0
"""Which points of a cloud may be filled: the holes, their size, their sides, and the heights next to them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.cloud import Floats, Mask
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.kernels.union_find import root_of

MEASURED, UNUSABLE = -1, -2
"""Values in a map of unknowns: a measured height; no height. A value from 0 on is the number of an unknown."""

PADDING = 2
"""Rows and columns of UNUSABLE on each side of a map of unknowns."""


class Holes(NamedTuple):
    """The holes in a cloud: groups of points that touch along a side."""

    points: NDArray[np.int32]
    """(N, 2): row and column of each point, hole after hole, each hole in row order."""

    starts: NDArray[np.int32]
    """(M + 1,): where each hole starts in `points`; the last value is N."""


@kernel
def find_holes(mask: Mask) -> Holes:
    """Group the points of a mask that touch along a side.

    Args:
        mask: (H, W) bool.

    Returns:
        The holes, in the order of their first points.
    """
    height, width = mask.shape
    label = np.empty((height, width), np.int32)
    parent = np.empty(mask.sum(), np.int32)
    count = 0
    for row in range(height):
        for column in range(width):
            if not mask[row, column]:
                continue
            above = row > 0 and mask[row - 1, column]
            before = column > 0 and mask[row, column - 1]
            if above and before:
                first, second = root_of(parent, label[row - 1, column]), root_of(parent, label[row, column - 1])
                # The lower root stays, so that holes are numbered in the order of their first points.
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
            if mask[row, column]:
                label[row, column] = number[label[row, column]]
                starts[label[row, column] + 1] += 1
    for hole in range(roots):
        starts[hole + 1] += starts[hole]
    points = np.empty((starts[-1], 2), np.int32)
    place = starts.copy()
    for row in range(height):
        for column in range(width):
            if mask[row, column]:
                points[place[label[row, column]]] = row, column
                place[label[row, column]] += 1
    return Holes(points, starts)


@kernel
def find_rims(holes: Holes, mask: Mask, measured: Mask, largest: int) -> NDArray[np.int32]:
    """Find the distance from each point of a hole to the measured points at its rim.

    Args:
        holes: from `find_holes`.
        mask: (H, W) of the holes.
        measured: (H, W) of the measured points outside the holes.
        largest: number of points of the largest hole that is filled.

    Returns:
        Distances (N, 4) in points: left, right, above, below. A distance is 0 if the hole ends at the border of
        the cloud or at a point that is not measured, or if the hole is too large.
    """
    points, starts = holes
    height, width = mask.shape
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
                while 0 <= row < height and 0 <= column < width and mask[row, column]:
                    row += step_row
                    column += step_column
                    distance += 1
                if 0 <= row < height and 0 <= column < width and measured[row, column]:
                    rims[point, side] = distance
    return rims


@kernel
def choose_points(
    holes: Holes, rims: NDArray[np.int32], measured: Mask, z: Floats, sides: int, heights_agree: float
) -> tuple[Mask, Mask]:
    """Choose the points to fill, and the points that need a height for that.

    Args:
        holes: from `find_holes`.
        rims: (N, 4), from `find_rims`.
        measured: (H, W) of the measured points outside the holes.
        z: (H, W) heights.
        sides: least number of sides on which a point must have a rim.
        heights_agree: largest difference of the heights next to a hole, in the unit of z; 0: any.

    Returns:
        Masks (N,) of the inner and the chosen points. Inner points are between two opposite rims. If a point is
        inner, all other points between the same rims are inner too, so that their heights are determined. Chosen
        points are inner, and within the limits of `sides` and `heights_agree`.
    """
    points, starts = holes
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
    """Make the map of the unknowns.

    PADDING rows and columns of UNUSABLE surround the map, so that the neighbours of each point exist.

    Args:
        points: (N, 2) of the holes.
        inner: (N,), the points with an unknown height.
        measured: (H, W) of the measured points outside the holes.

    Returns:
        (H + 2 · PADDING, W + 2 · PADDING): the number of an inner point in `points`, MEASURED or UNUSABLE.
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
