# SPDX-License-Identifier: Apache-2.0
"""The leaves of a k-d tree over the voters, in the memory layout that `medians` reads.

Only the leaves are kept. The median search goes through all of them for each point, which vector instructions do
faster than a descent from the root.
"""

import math
from typing import NamedTuple

import numpy as np

from socialcircle_ros.kernels.compiled import kernel

from .arrays import Floats32, Floats64, Integers

Points = Floats64
"""(3, n): the coordinates x, y and z of n points."""

LEAF_SIZE = 32
"""Most points of a leaf."""


class Leaves(NamedTuple):
    """n points in L leaves. Leaf l has the slots 32 l to 32 l + 31, and its points fill the first of them."""

    order: Integers
    """(n,) the indices of the points, leaf after leaf."""
    starts: Integers
    """(L,) where in `order` each leaf begins."""
    sizes: Integers
    """(L,) how many points each leaf has."""
    exact: Floats64
    """(32 L, 3) coordinates of the point in each slot; point by point, because single points are read."""
    scaled: Floats32
    """(3, 32 L) the same, from the centre of the points and in units of `extent`; NaN in empty slots."""
    boxes: Floats32
    """(6, L) the least x, y and z and the greatest x, y and z in `scaled` of each leaf."""
    extent: float
    """Half of the longest side of the points' bounding box. Infinite where it is not between 1e-100 and 1e100,
    since squared float64 distances lose digits there: `scaled` then holds no information."""


def build_leaves(points: Points) -> Leaves:
    """Group points into the leaves of a k-d tree.

    A box of more than 32 points is cut at the middle of its longest side. The usual cut at the median point would
    leave outliers in the boxes of the surface, and make these boxes large.

    J. L. Bentley, "Multidimensional binary search trees used for associative searching", Communications of the ACM
    18 (9), 1975, https://doi.org/10.1145/361002.361007.

    Args:
        points: (3, n), with n above 0.

    Returns:
        The leaves.
    """
    n = points.shape[1]
    lows, highs = points.min(axis=1) / 2, points.max(axis=1) / 2  # halved before they are added: no overflow
    extent = float((highs - lows).max())
    if not 1e-100 < extent < 1e100:
        extent = math.inf
    order, edges = np.arange(n), np.empty(n + 1, np.int64)
    count = _cut(points, order, edges, np.empty((n + 1, 2), np.int64))
    leaves = Leaves(
        order=order,
        starts=edges[:count],
        sizes=np.diff(edges[: count + 1]),
        exact=np.zeros((count * LEAF_SIZE, 3)),
        scaled=np.full((3, count * LEAF_SIZE), np.nan, np.float32),
        boxes=np.empty((6, count), np.float32),
        extent=extent,
    )
    _fill(points, lows + highs, leaves)
    return leaves


@kernel
def _cut(points: Points, order: Integers, edges: Integers, waiting: Integers) -> int:
    """Sort `order`, (n,), by leaves, and write where each leaf begins and where the last one ends to `edges`.

    Args:
        points: (3, n).
        order: (n,) 0 to n - 1; is reordered.
        edges: (n + 1,) is written.
        waiting: (n + 1, 2) working memory: first and last of the boxes that are not yet cut.

    Returns:
        The number of leaves.
    """
    waiting[0, 0], waiting[0, 1] = 0, len(order)
    boxes, leaves = 1, 0
    while boxes:
        boxes -= 1
        first, last = waiting[boxes, 0], waiting[boxes, 1]
        if last - first <= LEAF_SIZE:
            edges[leaves] = first
            leaves += 1
            continue
        longest, line, middle = -1.0, points[0], 0.0
        for axis in range(3):
            values = points[axis]
            low, high = math.inf, -math.inf
            for i in range(first, last):
                low, high = min(low, values[order[i]]), max(high, values[order[i]])
            if high / 2 - low / 2 > longest:
                longest, line, middle = high / 2 - low / 2, values, high / 2 + low / 2
        cut = first
        for i in range(first, last):
            if line[order[i]] < middle:
                order[i], order[cut] = order[cut], order[i]
                cut += 1
        if not first < cut < last:  # all points have the same coordinates
            cut = (first + last) // 2
        waiting[boxes, 0], waiting[boxes, 1] = cut, last
        waiting[boxes + 1, 0], waiting[boxes + 1, 1] = first, cut
        boxes += 2
    edges[leaves] = len(order)
    return leaves


@kernel
def _fill(points: Points, centre: Floats64, leaves: Leaves) -> None:
    """Write `exact`, `scaled` and `boxes` of the leaves."""
    order, starts, sizes = leaves.order, leaves.starts, leaves.sizes
    exact, scaled, boxes, extent = leaves.exact, leaves.scaled, leaves.boxes, leaves.extent
    for axis in range(3):
        values = points[axis]
        for leaf in range(len(starts)):
            low, high = np.float32(np.inf), np.float32(-np.inf)
            for i in range(sizes[leaf]):
                value, slot = values[order[starts[leaf] + i]], leaf * LEAF_SIZE + i
                unit = np.float32((value - centre[axis]) / extent)
                scaled[axis, slot], exact[slot, axis] = unit, value
                low, high = min(low, unit), max(high, unit)
            boxes[axis, leaf], boxes[3 + axis, leaf] = low, high
