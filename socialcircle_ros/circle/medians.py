# SPDX-License-Identifier: Apache-2.0
"""The exact medians of the distances between the voters (section 3.2.1, eq. 5).

mu_p is the median of the distances from p to all other voters. Sorting the distances of n points takes
O(n² log n) time. This module finds the same numbers, to the last bit, by counting how many points lie within a
sphere, in four steps for each point p:

1. Predict. Neighbours have similar medians: that of the point before, and a gradient that is learned on the way,
   predict mu_p. Two spheres round p, one below and one above the prediction, enclose a shell.
2. Count. Leaves of a k-d tree inside the inner sphere are counted as a whole. Leaves outside the outer sphere are
   skipped. Distances are computed only for the leaves that reach into the shell. If the median is not in the
   shell, the counts show it, and the shell is widened.
3. Narrow. A few passes over these distances reduce the shell to a few dozen candidates.
4. Decide. The candidates' distances are computed in float64, and the median is selected from them.

Squared distances have the same order as distances. Roots are taken only of the one or two middle values.

Steps 1 to 3 use float32 with half of the region's extent as the unit, which is twice as fast as float64. The
result is exact nevertheless:

- Boxes of leaves are compared by the same operations as points, and rounding is monotone. So the bounds of a box
  hold for the float32 distances of its points to the last bit, and step 2 counts without error.
- A float32 distance differs from the float64 distance by less than `_ERROR`. Rounded coordinates (at most 1) and
  their rounded differences (at most 2) contribute 5e-7; squares, sums and thresholds contribute 6e-7.
- The candidate that has the median's rank is accepted if it is more than `_ERROR` inside the shell: all points
  outside the shell are then on the same side of it in float64 as in float32.
- Otherwise the shell is widened by twice `_ERROR` on both sides, once. That is enough: the medians of the float32
  and of the float64 distances differ by less than `_ERROR`, and a point that is more than twice that away from
  the first is on the same side of the second.

The code uses twice these margins, so that the rounding of the bounds themselves does not matter.
"""

import math
from typing import NamedTuple

import numpy as np
from numba.cpython.unsafe.numbers import trailing_zeros

from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .arrays import Floats32, Floats64, Integers
from .kd_tree import LEAF_SIZE, Leaves, Points, build_leaves
from .selection import select

Box = tuple[np.float32, np.float32, np.float32, np.float32, np.float32, np.float32]
"""The least x, y and z, and the greatest x, y and z."""

_ERROR = 1.5e-6
"""Upper bound of the error of a float32 distance, for coordinates from -1 to 1."""

_FAR_STEP = 0.25
"""Of the radius: a longer step leads to a point off the surface, for which the prediction does not hold."""

_UNCERTAINTY = 0.15
"""Of a step: half the width of the shell round the predicted radius."""

_UNCERTAINTY_FAR = 0.8
"""The same after a step that is too long for a prediction."""

_CANDIDATES = 32
"""So few candidates are not narrowed further."""

_RANKS = 8
"""Half the width of a narrowed shell, in ranks."""

_WORD = 64
"""Bits of a word: so many comparisons are stored at once. Arrays have room for as many entries more."""

_LEAST_POINTS_PER_BAND = 400

_ZERO, _ONE = np.uint64(0), np.uint64(1)


class _MedianWork(NamedTuple):
    """Working memory of a thread, for points in L leaves."""

    near: Integers
    """(L + 64,) for all points of the leaf at hand: the leaves that may reach into a shell."""
    near_sizes: Integers
    """(L + 64,) how many points these have."""
    near_boxes: Floats32
    """(6, L + 64) their boxes."""
    examined: Integers
    """(L + 64,) for the point at hand: the leaves that may reach into its shell."""
    least: Floats32
    """(L + 64,) the least squared distance that the points of a leaf can have."""
    most: Floats32
    """(L + 64,) the greatest one."""
    squared: Floats32
    """(32 L + 64,) squared distances to the points of the examined leaves; NaN for empty slots."""
    candidates: Floats64
    """(n,) squared distances to the candidates."""


class _Shell(NamedTuple):
    """Bounds of squared distances, and what the counts say."""

    low: np.float32
    high: np.float32
    below: int
    """How many values are below `low`."""
    up_to: int
    """How many values are not above `high`."""


def median_distances(points: Points) -> Floats64:
    """Return mu_p (eq. 5) of each point p: the median of its distances to the other points.

    Args:
        points: (3, n).

    Returns:
        (n,); equal to the median of the sorted distances to the last bit. 0 for a single point.
    """
    n = points.shape[1]
    mu = np.zeros(n)
    if n < 2:
        return mu
    leaves = build_leaves(points)

    def find(band: slice) -> None:
        # The search of each thread begins with another prediction, but the medians are exact.
        first, last = np.searchsorted(leaves.starts, (band.start, band.stop))
        _find_medians(leaves, first, last, _allocate(leaves), mu)

    in_bands(find, n, 1, _LEAST_POINTS_PER_BAND)
    return mu


def _allocate(leaves: Leaves) -> _MedianWork:
    room = len(leaves.starts) + _WORD
    return _MedianWork(
        near=np.empty(room, np.int64),
        near_sizes=np.empty(room, np.int64),
        near_boxes=np.empty((6, room), np.float32),
        examined=np.empty(room, np.int64),
        least=np.empty(room, np.float32),
        most=np.empty(room, np.float32),
        squared=np.empty(len(leaves.starts) * LEAF_SIZE + _WORD, np.float32),
        candidates=np.empty(len(leaves.order)),
    )


@kernel
def _find_medians(leaves: Leaves, first: int, last: int, work: _MedianWork, mu: Floats64) -> None:
    """Write mu, (n,), of the points of the leaves from `first` to before `last`."""
    order, starts, sizes, exact, scaled, boxes, extent = leaves
    near, near_sizes, near_boxes, examined, least, most, squared, candidates = work
    n, error = len(order), _ERROR if extent < math.inf else math.inf
    upper_rank = (n - 1) // 2 + 1  # rank 0 is the distance of p from itself
    lower_rank = upper_rank - (n % 2)
    # The prediction starts from a point before: its place, its radius, and the gradient of the radius.
    radius, strayed = math.inf, False
    ox, oy, oz = scaled[0, first * LEAF_SIZE], scaled[1, first * LEAF_SIZE], scaled[2, first * LEAF_SIZE]
    gx, gy, gz = 0.0, 0.0, 0.0
    for leaf in range(first, last):
        box = boxes[0, leaf], boxes[1, leaf], boxes[2, leaf], boxes[3, leaf], boxes[4, leaf], boxes[5, leaf]
        half = math.sqrt((box[3] - box[0]) ** 2 + (box[4] - box[1]) ** 2 + (box[5] - box[2]) ** 2) / 2
        near_inner, near_outer, inside, near_count = math.inf, -math.inf, 0, 0
        for i in range(sizes[leaf]):
            slot = leaf * LEAF_SIZE + i
            px, py, pz = scaled[0, slot], scaled[1, slot], scaled[2, slot]
            # 1. Predict.
            dx, dy, dz = float(px - ox), float(py - oy), float(pz - oz)
            step = math.sqrt(dx * dx + dy * dy + dz * dz)
            far = not step < _FAR_STEP * radius
            guess = radius if far else radius + (gx * dx + gy * dy + gz * dz)
            reach = (_UNCERTAINTY_FAR if far else _UNCERTAINTY) * step + error
            # 2. Count, and widen the shell until the median is in it.
            while True:
                inner, outer = guess - reach, guess + reach
                if guess == math.inf:
                    inner = -math.inf
                if inner < near_inner or outer > near_outer:
                    near_inner, near_outer = inner - half, outer + half
                    low, high = _square(near_inner - 3 * error), _square(near_outer + 3 * error)
                    inside, near_count = _gather_near(leaves, box, low, high, work)
                _bound(near_boxes, near_count, (px, py, pz, px, py, pz), least, most)
                low, high = _square(inner - 3 * error), _square(outer + 3 * error)
                below, count = _choose(least, most, near_sizes, near_count, low, high, examined)
                below += inside
                for j in range(count):
                    examined[j] = near[examined[j]]
                    _distances(scaled, examined[j], px, py, pz, squared, j)
                values = squared[: count * LEAF_SIZE]
                shell = _counted(values, _square(inner), _square(outer))
                if below + shell.below <= lower_rank and upper_rank < below + shell.up_to:
                    break
                reach *= 3
                if not reach < 4 * radius:
                    guess = math.inf
            # 3. Narrow.
            shell = _narrowed(values, shell, lower_rank - below, upper_rank - below)
            # 4. Decide.
            for j in range(count * LEAF_SIZE, count * LEAF_SIZE + _WORD):  # the last word may reach beyond
                squared[j] = np.nan
            sure = False
            while True:
                found = candidates[: _collect(exact, slot, examined, squared, count, shell, candidates)]
                upper = math.sqrt(select(found, upper_rank - below - shell.below))
                lower = upper
                if lower_rank < upper_rank:
                    lower = math.sqrt(found[: upper_rank - below - shell.below].max())
                inner, outer = math.sqrt(shell.low) + 2 * error, math.sqrt(shell.high) - 2 * error
                if sure or (inner <= lower / extent and upper / extent <= outer):
                    break
                shell = _counted(values, _square(inner - 4 * error), _square(outer + 4 * error))
                sure = True
            mu[order[starts[leaf] + i]] = (lower + upper) / 2 if lower_rank < upper_rank else upper
            if strayed or not far:
                change = upper / extent - radius
                if not far and step > 0:
                    learned = 0.5 * (change - (gx * dx + gy * dy + gz * dz)) / (step * step)
                    gx, gy, gz = gx + learned * dx, gy + learned * dy, gz + learned * dz
                radius, ox, oy, oz = upper / extent, px, py, pz
            strayed = far


@kernel
def _gather_near(
    leaves: Leaves, box: Box, low: np.float32, high: np.float32, work: _MedianWork
) -> tuple[int, int]:
    """Write the leaves that may have squared distances from low to high, for any point in the box.

    Returns:
        The number of points in the leaves below, and the number of leaves written.
    """
    sizes, boxes = leaves.sizes, leaves.boxes
    near, near_sizes, near_boxes, least, most = work.near, work.near_sizes, work.near_boxes, work.least, work.most
    _bound(boxes, len(sizes), box, least, most)
    below, count = _choose(least, most, sizes, len(sizes), low, high, near)
    for j in range(count):
        near_sizes[j] = sizes[near[j]]
        for end in range(6):
            near_boxes[end, j] = boxes[end, near[j]]
    return below, count


@kernel
def _collect(
    exact: Floats64,
    slot: int,
    examined: Integers,
    squared: Floats32,
    count: int,
    shell: _Shell,
    candidates: Floats64,
) -> int:
    """Write the float64 squared distances of the candidates from the point in a slot; return their number."""
    px, py, pz = exact[slot, 0], exact[slot, 1], exact[slot, 2]
    found = 0
    for start in range(0, count * LEAF_SIZE, _WORD):
        between = _between(squared, start, shell.low, shell.high)
        while between:
            at = start + trailing_zeros(between)
            between &= between - _ONE
            q = examined[at // LEAF_SIZE] * LEAF_SIZE + at % LEAF_SIZE
            dx, dy, dz = exact[q, 0] - px, exact[q, 1] - py, exact[q, 2] - pz
            candidates[found] = (dx * dx + dy * dy) + dz * dz
            found += 1
    return found


@kernel
def _square(radius: float) -> np.float32:
    """Return the square of a radius as a threshold of float32 distances; 0 for a negative radius."""
    return np.float32(radius * radius) if radius > 0 else np.float32(0)


@kernel
def _bound(boxes: Floats32, count: int, box: Box, least: Floats32, most: Floats32) -> None:
    """Write the least and the greatest squared distance that points in each of the `boxes` can have from `box`."""
    x0, y0, z0, x1, y1, z1 = boxes[0], boxes[1], boxes[2], boxes[3], boxes[4], boxes[5]
    a0, b0, c0, a1, b1, c1 = box
    none = np.float32(0)
    for i in range(count):
        dx, dy, dz = max(x0[i] - a1, a0 - x1[i]), max(y0[i] - b1, b0 - y1[i]), max(z0[i] - c1, c0 - z1[i])
        dx, dy, dz = max(dx, none), max(dy, none), max(dz, none)
        least[i] = (dx * dx + dy * dy) + dz * dz
    for i in range(count):
        dx, dy, dz = max(x1[i] - a0, a1 - x0[i]), max(y1[i] - b0, b1 - y0[i]), max(z1[i] - c0, c1 - z0[i])
        most[i] = (dx * dx + dy * dy) + dz * dz


@kernel
def _choose(
    least: Floats32,
    most: Floats32,
    sizes: Integers,
    count: int,
    low: np.float32,
    high: np.float32,
    chosen: Integers,
) -> tuple[int, int]:
    """Write the indices of the leaves that may have squared distances from low to high to `chosen`.

    The comparisons of 64 leaves become the bits of a word: LLVM vectorises that, but no loop with a branch. So all
    arrays have room for 64 leaves more than `count`.

    Returns:
        The number of points in the leaves below, and the number of leaves chosen.
    """
    below, m = 0, 0
    for i in range(count):
        below += sizes[i] * (most[i] < low)
    for start in range(0, count, _WORD):
        bits = _ZERO
        for lane in range(_WORD):
            at = np.uint64(start) + np.uint64(lane)
            bits |= np.uint64((most[at] >= low) & (least[at] <= high)) << np.uint64(lane)
        while bits:
            chosen[m] = start + trailing_zeros(bits)
            bits &= bits - _ONE
            m += chosen[m] < count
    return below, m


@kernel
def _distances(
    scaled: Floats32, leaf: int, px: np.float32, py: np.float32, pz: np.float32, squared: Floats32, position: int
) -> None:
    """Write the squared distances from p to the points of a leaf, as the leaf at `position` in `squared`."""
    x, y, z = scaled[0], scaled[1], scaled[2]
    start, to = np.uint64(leaf * LEAF_SIZE), np.uint64(position * LEAF_SIZE)
    for i in range(LEAF_SIZE):
        q = start + np.uint64(i)
        dx, dy, dz = x[q] - px, y[q] - py, z[q] - pz
        squared[to + np.uint64(i)] = (dx * dx + dy * dy) + dz * dz


@kernel
def _counted(values: Floats32, low: np.float32, high: np.float32) -> _Shell:
    """Count the values below `low`, and those not above `high`.

    The counters are as wide as the values, so that more of them fit into a vector. The loop runs over indices,
    because LLVM does not vectorise one over the values.
    """
    below, up_to = np.int32(0), np.int32(0)
    for i in range(len(values)):
        below = np.int32(below + np.int32(values[i] < low))
        up_to = np.int32(up_to + np.int32(values[i] <= high))
    return _Shell(low, high, int(below), int(up_to))


@kernel
def _between(values: Floats32, first: int, low: np.float32, high: np.float32) -> np.uint64:
    """Return which of 64 values are from low to high, as the bits of a word.

    LLVM vectorises this loop, but not one that collects the values.
    """
    bits = _ZERO
    for i in range(_WORD):
        value = values[np.uint64(first) + np.uint64(i)]
        bits |= np.uint64((value >= low) & (value <= high)) << np.uint64(i)
    return bits


@kernel
def _narrowed(values: Floats32, shell: _Shell, lower_rank: int, upper_rank: int) -> _Shell:
    """Return a narrower shell that still contains the values at both ranks.

    Squared distances from a point on a surface are evenly distributed, so that linear interpolation between the
    counts finds a rank to within a few.
    """
    low, high, below, up_to = shell.low, shell.high, shell.below, shell.up_to
    for _ in range(8):
        if up_to - below <= _CANDIDATES or high == math.inf:
            break
        per_rank = (high - low) / (up_to - below)
        middle = low + (upper_rank - below) * per_rank
        new_low = max(np.float32(middle - _RANKS * per_rank), low)
        new_high = min(np.float32(middle + _RANKS * per_rank), high)
        new = _counted(values, new_low, new_high)
        if new.below <= lower_rank and upper_rank < new.up_to:
            low, high, below, up_to = new_low, new_high, new.below, new.up_to
        elif upper_rank < new.below:
            high, up_to = new_low, new.below
        elif new.up_to <= lower_rank:
            low, below = np.nextafter(new_high, np.float32(np.inf)), new.up_to
        else:
            break
    return _Shell(low, high, below, up_to)
