"""The exact medians of the distances (section 3.2.1, eq. 5)."""

import math
from typing import Any

import numpy as np
from numba.cpython.unsafe.numbers import trailing_zeros

from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .kd_tree import LEAF, fill_leaves, plant
from .selection import select

_ERROR = 1.5e-6  # of a float32 distance between points of a cloud that reaches from -1 to 1
_FEW = 8  # so many ranks to each side a value is sought one by one
_ZERO, _ONE = np.uint64(0), np.uint64(1)
_FAR = 0.25  # of the radius: a step beyond leads to a point off the surface
_DOUBT = 0.15  # of a step: how far the radius may be off the one that is expected
_ENOUGH = 32  # so few values are looked at one by one
_LEAST_POINTS = 400  # of a band that is worth a thread


def median_distances(x: Any, y: Any, z: Any) -> Any:
    """mu_p (eq. 5) of each point p, (n,), exactly as sorting all distances gives it.

    Squares have the same order as their roots: the median is sought among the squared distances, and only its
    one or two members are rooted. Its radius is nearly that of a point before, a neighbour, and changes with the
    place as it did there, so that only points near a sphere have to be looked at one by one. The others are
    counted by whole leaves of a k-d tree, whose boxes lie within or beyond that sphere. Where the guess was wrong,
    counts show it, and it is widened.

    All this is done in float32, with the region's half extent as the unit, which is twice as fast. A box bounds
    its points' distances to the last bit, because both are computed alike, and rounding never changes an order.
    A float32 distance is off the float64 one by less than `_ERROR`: rounded coordinates (at most 1) and their
    rounded differences (at most 2) make 5e-7 in space, squares, sums and thresholds another 6e-7. The last two
    dozen, all whose float32 distances lie between two bounds, are looked at in float64. Who has the rank among
    them is the median, if he is more than `_ERROR` within these bounds: then all others are on the same side of
    him in float64. Else the bounds are widened by twice that, which is enough: the median of the ones is not
    farther off the median of the others, and who is more than twice that from the first is on the same side of
    the second. Twice what is needed is asked for, so that the rounding of bounds plays no part.

    Leaves are shared among threads: each point's median is exact, wherever the search for it began.
    """
    n = len(x)
    mu = np.zeros(n)
    if n < 2:
        return mu
    lows, highs = np.array([x.min(), y.min(), z.min()]) / 2, np.array([x.max(), y.max(), z.max()]) / 2
    extent, error = float((highs - lows).max()), _ERROR
    if not 1e-100 < extent < 1e100:  # float64 squares lose digits there: every point is looked at
        extent, error = math.inf, math.inf
    order, starts = np.arange(n), np.empty(n + 1, np.int64)
    leaves = plant(x, y, z, order, starts, np.empty((n + 1, 2), np.int64))
    sizes, starts = np.diff(starts[: leaves + 1]), starts[:leaves]
    points = np.full((3, leaves * LEAF), np.nan, np.float32)  # what is no point is nowhere
    exact = np.zeros((leaves * LEAF, 3))  # one after the other, because they are looked up here and there
    boxes = np.empty((6, leaves), np.float32)
    fill_leaves(x, y, z, order, starts, sizes, lows + highs, extent, points, exact, boxes)

    def find(band: slice) -> None:
        work = (
            np.empty((8, leaves + 64), np.float32),
            np.empty((3, leaves + 64), np.int64),
            np.empty(leaves * LEAF + 64, np.float32),
            np.empty(n),
        )
        first, last = np.searchsorted(starts, (band.start, band.stop))
        _find_medians(exact, order, starts, sizes, points, boxes, extent, error, first, last, *work, mu)

    in_bands(find, n, 1, _LEAST_POINTS)
    return mu


@kernel
def _find_medians(
    exact: Any,
    order: Any,
    starts: Any,
    sizes: Any,
    points: Any,
    boxes: Any,
    extent: float,
    error: float,
    first: int,
    last: int,
    bounds: Any,
    names: Any,
    squared: Any,
    distances: Any,
    mu: Any,
) -> None:
    """The loop of `median_distances` over the points of the leaves from `first` to before `last`.

    Of n points `order`ed into L leaves with `starts` and `sizes`, (L,). Float64: `exact` (32 L, 3). Float32:
    `points` (3, 32 L) and `boxes` (6, L). For work: `bounds` (8, L + 64), `names` (3, L + 64), `squared`
    (32 L + 64,) and `distances` (n,).
    """
    n, leaves = len(order), len(starts)
    upper_rank = (n - 1) // 2 + 1  # behind p itself, whose distance 0 comes first
    lower_rank = upper_rank - (n % 2)
    # For the leaf at hand, the leaves that are neither within nor beyond the spheres of all of its points.
    near, near_sizes, looked_at = names[0], names[1], names[2]
    near_boxes, least, most = bounds[:6], bounds[6], bounds[7]
    # A point before: its place, its radius, and how radii change from there on. Not one that lies far off.
    radius, strayed = math.inf, False
    ox, oy, oz = points[0, first * LEAF], points[1, first * LEAF], points[2, first * LEAF]
    gx, gy, gz = 0.0, 0.0, 0.0
    for leaf in range(first, last):
        box = boxes[0, leaf], boxes[1, leaf], boxes[2, leaf], boxes[3, leaf], boxes[4, leaf], boxes[5, leaf]
        half = math.sqrt((box[3] - box[0]) ** 2 + (box[4] - box[1]) ** 2 + (box[5] - box[2]) ** 2) / 2
        within, beyond, inside, count = math.inf, -math.inf, 0, 0
        for i in range(sizes[leaf]):
            p, place = order[starts[leaf] + i], leaf * LEAF + i
            px, py, pz = points[0, place], points[1, place], points[2, place]
            ax, ay, az = exact[place, 0], exact[place, 1], exact[place, 2]
            dx, dy, dz = float(px - ox), float(py - oy), float(pz - oz)
            step = math.sqrt(dx * dx + dy * dy + dz * dz)
            far = not step < _FAR * radius
            guess = radius if far else radius + (gx * dx + gy * dy + gz * dz)
            reach = (0.8 if far else _DOUBT) * step + error
            while True:
                inner, outer = guess - reach, guess + reach
                if guess == math.inf:
                    inner = -math.inf
                if inner < within or outer > beyond:
                    within, beyond = inner - half, outer + half
                    _bound(boxes, leaves, box, least, most)
                    low, high = _square(within - 3 * error), _square(beyond + 3 * error)
                    inside, count = _choose(least, most, sizes, leaves, low, high, near)
                    for j in range(count):
                        near_sizes[j] = sizes[near[j]]
                        for end in range(6):
                            near_boxes[end, j] = boxes[end, near[j]]
                _bound(near_boxes, count, (px, py, pz, px, py, pz), least, most)
                low, high = _square(inner - 3 * error), _square(outer + 3 * error)
                below, m = _choose(least, most, near_sizes, count, low, high, looked_at)
                below += inside
                for j in range(m):
                    looked_at[j] = near[looked_at[j]]
                    _distances(points, looked_at[j], px, py, pz, squared, j)
                values, low, high = squared[: m * LEAF], _square(inner), _square(outer)
                under, upto = _counts(values, low, high)
                if below + under <= lower_rank and upper_rank < below + upto:
                    break
                reach *= 3
                if not reach < 4 * radius:
                    guess = math.inf
            low, high, under = _narrowed(values, low, high, under, upto, lower_rank - below, upper_rank - below)
            for j in range(m * LEAF, m * LEAF + 64):  # the last 64 may reach there
                squared[j] = np.nan
            sure = False
            while True:
                candidates = 0
                for start in range(0, m * LEAF, 64):
                    between = _between(squared, start, low, high)
                    while between:
                        at = start + trailing_zeros(between)
                        between &= between - _ONE
                        q = looked_at[at // LEAF] * LEAF + at % LEAF
                        ex, ey, ez = exact[q, 0] - ax, exact[q, 1] - ay, exact[q, 2] - az
                        distances[candidates] = (ex * ex + ey * ey) + ez * ez
                        candidates += 1
                found = distances[:candidates]
                upper = math.sqrt(select(found, upper_rank - below - under))
                lower = upper
                if lower_rank < upper_rank:
                    lower = math.sqrt(found[: upper_rank - below - under].max())
                low_radius, high_radius = math.sqrt(low) + 2 * error, math.sqrt(high) - 2 * error
                if sure or (low_radius <= lower / extent and upper / extent <= high_radius):
                    break
                low, high = _square(low_radius - 4 * error), _square(high_radius + 4 * error)
                under = _counts(values, low, high)[0]
                sure = True
            mu[p] = (lower + upper) / 2 if lower_rank < upper_rank else upper
            if strayed or not far:
                change = upper / extent - radius
                if not far and step > 0:
                    learned = 0.5 * (change - (gx * dx + gy * dy + gz * dz)) / (step * step)
                    gx, gy, gz = gx + learned * dx, gy + learned * dy, gz + learned * dz
                radius, ox, oy, oz = upper / extent, px, py, pz
            strayed = far


@kernel
def _square(radius: float) -> Any:
    """The square of a radius as a threshold of float32 distances; nothing is within a negative radius."""
    return np.float32(radius * radius) if radius > 0 else np.float32(0)


@kernel
def _bound(boxes: Any, count: int, box: Any, least: Any, most: Any) -> None:
    """Write the least and the most squared distance that points in each of the `boxes` can have from `box`."""
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
def _choose(least: Any, most: Any, sizes: Any, count: int, low: Any, high: Any, chosen: Any) -> tuple[int, int]:
    """Write which leaves may have distances from low to high.

    `least`, `most` and `chosen` have room for 64 more leaves, because so many are asked at once: as the bits of a
    word this is vectorised.

    Returns how many points the leaves below have, and how many leaves it wrote.
    """
    below, m = 0, 0
    for i in range(count):
        below += sizes[i] * (most[i] < low)
    for start in range(0, count, 64):
        bits = _ZERO
        for lane in range(64):
            at = np.uint64(start) + np.uint64(lane)
            bits |= np.uint64((most[at] >= low) & (least[at] <= high)) << np.uint64(lane)
        while bits:
            chosen[m] = start + trailing_zeros(bits)
            bits &= bits - _ONE
            m += chosen[m] < count
    return below, m


@kernel
def _distances(points: Any, leaf: int, px: Any, py: Any, pz: Any, squared: Any, place: int) -> None:
    """Write the squared distances of a leaf's points from p as the leaf at `place`."""
    x, y, z = points[0], points[1], points[2]
    start, to = np.uint64(leaf * LEAF), np.uint64(place * LEAF)
    for i in range(LEAF):
        q = start + np.uint64(i)
        dx, dy, dz = x[q] - px, y[q] - py, z[q] - pz
        squared[to + np.uint64(i)] = (dx * dx + dy * dy) + dz * dz


@kernel
def _counts(values: Any, low: Any, high: Any) -> tuple[int, int]:
    """How many values are below `low`, and how many are not above `high`.

    In numbers as wide as the values: so many more fit into a vector.
    """
    under, upto = np.int32(0), np.int32(0)
    for i in range(len(values)):  # by index: a loop over the values themselves is not vectorised
        under = np.int32(under + np.int32(values[i] < low))
        upto = np.int32(upto + np.int32(values[i] <= high))
    return int(under), int(upto)


@kernel
def _between(values: Any, first: int, low: Any, high: Any) -> Any:
    """Which of 64 values are from low to high, as the bits of a word: this is vectorised, picking them is not."""
    bits = _ZERO
    for i in range(64):
        value = values[np.uint64(first) + np.uint64(i)]
        bits |= np.uint64((value >= low) & (value <= high)) << np.uint64(i)
    return bits


@kernel
def _narrowed(
    values: Any, low: Any, high: Any, under: int, upto: int, lower_rank: int, upper_rank: int
) -> tuple[Any, Any, int]:
    """Narrower bounds between which the values at both ranks lie, and how many values are under the lower one.

    `under` and `upto` are the counts at the first bounds.

    Squared distances from a point on a surface are spread evenly, so that a rank tells the value within a few.
    """
    for _ in range(8):
        if upto - under <= _ENOUGH or high == math.inf:
            break
        per_rank = (high - low) / (upto - under)
        middle = low + (upper_rank - under) * per_rank
        new_low = max(np.float32(middle - _FEW * per_rank), low)
        new_high = min(np.float32(middle + _FEW * per_rank), high)
        new_under, new_upto = _counts(values, new_low, new_high)
        if new_under <= lower_rank and upper_rank < new_upto:
            low, high, under, upto = new_low, new_high, new_under, new_upto
        elif upper_rank < new_under:
            high, upto = new_low, new_under
        elif new_upto <= lower_rank:
            low, under = np.nextafter(new_high, np.float32(np.inf)), new_upto
        else:
            break
    return low, high, under
