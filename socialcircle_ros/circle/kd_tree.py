"""The leaves of a k-d tree over the points of the vote region."""

import math
from typing import Any

import numpy as np

from socialcircle_ros.kernels.compiled import kernel

LEAF = 32  # most points of a leaf of the k-d tree


@kernel
def plant(x: Any, y: Any, z: Any, order: Any, starts: Any, boxes: Any) -> int:
    """Bring the `order` of the points, (n,), into that of a k-d tree; write where its leaves start; how many.

    A box is cut at the middle of its longest side, so that far points are soon alone, until it has no more than
    `LEAF` points. `boxes`, (n + 1, 2), is for work: those still to be cut.
    """
    boxes[0, 0], boxes[0, 1] = 0, len(x)
    waiting, leaves = 1, 0
    while waiting:
        waiting -= 1
        first, last = boxes[waiting, 0], boxes[waiting, 1]
        if last - first <= LEAF:
            starts[leaves] = first
            leaves += 1
            continue
        side, line, middle = -1.0, x, 0.0
        for axis in range(3):
            values = x if axis == 0 else y if axis == 1 else z
            low, high = math.inf, -math.inf
            for i in range(first, last):
                low, high = min(low, values[order[i]]), max(high, values[order[i]])
            if high / 2 - low / 2 > side:
                side, line, middle = high / 2 - low / 2, values, high / 2 + low / 2
        cut = first
        for i in range(first, last):
            if line[order[i]] < middle:
                order[i], order[cut] = order[cut], order[i]
                cut += 1
        if not first < cut < last:  # all at one place
            cut = (first + last) // 2
        boxes[waiting, 0], boxes[waiting, 1] = cut, last
        boxes[waiting + 1, 0], boxes[waiting + 1, 1] = first, cut
        waiting += 2
    starts[leaves] = len(x)
    return leaves


@kernel
def fill_leaves(
    x: Any,
    y: Any,
    z: Any,
    order: Any,
    starts: Any,
    sizes: Any,
    middle: Any,
    extent: float,
    points: Any,
    exact: Any,
    boxes: Any,
) -> None:
    """Write each leaf's points to `points`, (3, 32 L), from `middle` in units of `extent`, and `exact`, (32 L, 3).

    `boxes`, (6, L), gets the least and the greatest x, y and z of the leaf's points as `points` has them.
    """
    for axis in range(3):
        values = x if axis == 0 else y if axis == 1 else z
        for leaf in range(len(starts)):
            low, high = np.float32(np.inf), np.float32(-np.inf)
            for i in range(sizes[leaf]):
                value, place = values[order[starts[leaf] + i]], leaf * LEAF + i
                unit = np.float32((value - middle[axis]) / extent)
                points[axis, place], exact[place, axis] = unit, value
                low, high = min(low, unit), max(high, unit)
            boxes[axis, leaf], boxes[3 + axis, leaf] = low, high
