"""The acquisition of the initial point (section 3.2.1): where to vote, the votes, and who wins."""

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numba.cpython.unsafe.numbers import trailing_zeros

from socialcircle_ros.cloud import Cloud, Memory, flattened, is_measured, load_row, measured_points
from socialcircle_ros.errors import NoSeedError
from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

Region = tuple[int, int, int, int]
"""Row and column of the first point, height and width, in points."""

SIDE = 60
"""Side of a chosen region: the paper wants at least 60 points."""

CANDIDATES = 64
"""So many candidates are compared for their roughness, so that the choice costs the same for any cloud."""

_WELL_MEASURED = 0.95

_PEAK = 1 / math.sqrt(2 * math.pi)
_ERROR = 1.5e-6  # of a float32 distance between points of a cloud that reaches from -1 to 1
_LEAF = 32  # most points of a leaf of the k-d tree
_FEW = 8  # so many ranks to each side a value is sought one by one
_LANES = 32
_ZERO, _ONE = np.uint64(0), np.uint64(1)
_FAR = 0.25  # of the radius: a step beyond leads to a point off the surface
_DOUBT = 0.15  # of a step: how far the radius may be off the one that is expected
_ENOUGH = 32  # so few values are looked at one by one
_LEAST_POINTS = 400  # of a band that is worth a thread


def elect_seed(xyz: Cloud, region: Region | None) -> tuple[int, int]:
    """The initial point I: the measured point of the vote region T with the highest score.

    Args:
        xyz: (H, W, 3) organized cloud.
        region: T; what of it lies outside the cloud does not vote. None: `choose_region`.

    Returns:
        Row and column in the cloud; of points with equal scores the first in row order.

    Raises:
        NoSeedError: no point of the region is measured.
    """
    top, left, height, width = choose_region(xyz) if region is None else region
    square = xyz[top : top + height, left : left + width]
    places, x, y, z = _voters(square)
    if len(places) == 0:
        raise NoSeedError(
            f'No point of the vote region at row {top}, column {left} ({height}×{width} points) is measured'
            f' in this cloud of {xyz.shape[0]}×{xyz.shape[1]} points; move circle.vote_region, or set it to'
            ' zeros to have it chosen.'
        )
    mu = _medians(x, y, z)
    estimates, margin = _estimates(x, y, z, mu)
    contenders = np.flatnonzero(estimates >= estimates.max() - margin)
    winner = contenders[np.argmax(_scores(x, y, z, mu, contenders))]
    row, column = divmod(int(places[winner]), square.shape[1])
    return top + row, left + column


def vote_scores(xyz: Cloud) -> npt.NDArray[np.float64]:
    """Matrix M (eq. 4 and 5): for each point q of the region the sum of the votes that it receives.

    V_p(q) = exp(-(D_p(q) / mu_p)² / 2) / √(2π), mu_p the median of D_p(q) over the measured q ≠ p, and
    M(q) = Σ_p V_p(q) over p ≠ q in row order, in float64. Nobody votes for a point infinitely far away;
    where mu_p is 0, p votes only for points at its own place.

    Args:
        xyz: (H, W, 3) the points of the region.

    Returns:
        (H, W) float64; NaN where a point is not measured.
    """
    places, x, y, z = _voters(xyz)
    scores = np.full(xyz.shape[0] * xyz.shape[1], np.nan)
    scores[places] = _scores(x, y, z, _medians(x, y, z), np.arange(len(places)))
    return scores.reshape(xyz.shape[:2])


def _voters(xyz: Cloud) -> tuple[Any, Any, Any, Any]:
    """The measured points of a region in row order: their places in it, and x, y, z, each (n,) float64."""
    measured = measured_points(xyz)
    x, y, z = np.ascontiguousarray(xyz[measured].T, np.float64)
    return np.flatnonzero(measured), x, y, z


def _medians(x: Any, y: Any, z: Any) -> Any:
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
    leaves = _plant(x, y, z, order, starts, np.empty((n + 1, 2), np.int64))
    sizes, starts = np.diff(starts[: leaves + 1]), starts[:leaves]
    points = np.full((3, leaves * _LEAF), np.nan, np.float32)  # what is no point is nowhere
    exact = np.zeros((leaves * _LEAF, 3))  # one after the other, because they are looked up here and there
    boxes = np.empty((6, leaves), np.float32)
    _fill_leaves(x, y, z, order, starts, sizes, lows + highs, extent, points, exact, boxes)

    def find(band: slice) -> None:
        work = (
            np.empty((8, leaves + 64), np.float32),
            np.empty((3, leaves + 64), np.int64),
            np.empty(leaves * _LEAF + 64, np.float32),
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
    """The loop of `_medians` over the points of the leaves from `first` to before `last`.

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
    ox, oy, oz = points[0, first * _LEAF], points[1, first * _LEAF], points[2, first * _LEAF]
    gx, gy, gz = 0.0, 0.0, 0.0
    for leaf in range(first, last):
        box = boxes[0, leaf], boxes[1, leaf], boxes[2, leaf], boxes[3, leaf], boxes[4, leaf], boxes[5, leaf]
        half = math.sqrt((box[3] - box[0]) ** 2 + (box[4] - box[1]) ** 2 + (box[5] - box[2]) ** 2) / 2
        within, beyond, inside, count = math.inf, -math.inf, 0, 0
        for i in range(sizes[leaf]):
            p, place = order[starts[leaf] + i], leaf * _LEAF + i
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
                values, low, high = squared[: m * _LEAF], _square(inner), _square(outer)
                under, upto = _counts(values, low, high)
                if below + under <= lower_rank and upper_rank < below + upto:
                    break
                reach *= 3
                if not reach < 4 * radius:
                    guess = math.inf
            low, high, under = _narrowed(values, low, high, under, upto, lower_rank - below, upper_rank - below)
            for j in range(m * _LEAF, m * _LEAF + 64):  # the last 64 may reach there
                squared[j] = np.nan
            sure = False
            while True:
                candidates = 0
                for start in range(0, m * _LEAF, 64):
                    between = _between(squared, start, low, high)
                    while between:
                        at = start + trailing_zeros(between)
                        between &= between - _ONE
                        q = looked_at[at // _LEAF] * _LEAF + at % _LEAF
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
def _plant(x: Any, y: Any, z: Any, order: Any, starts: Any, boxes: Any) -> int:
    """Bring the `order` of the points, (n,), into that of a k-d tree; write where its leaves start; how many.

    A box is cut at the middle of its longest side, so that far points are soon alone, until it has no more than
    `_LEAF` points. `boxes`, (n + 1, 2), is for work: those still to be cut.
    """
    boxes[0, 0], boxes[0, 1] = 0, len(x)
    waiting, leaves = 1, 0
    while waiting:
        waiting -= 1
        first, last = boxes[waiting, 0], boxes[waiting, 1]
        if last - first <= _LEAF:
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
def _fill_leaves(
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
                value, place = values[order[starts[leaf] + i]], leaf * _LEAF + i
                unit = np.float32((value - middle[axis]) / extent)
                points[axis, place], exact[place, axis] = unit, value
                low, high = min(low, unit), max(high, unit)
            boxes[axis, leaf], boxes[3 + axis, leaf] = low, high


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
    start, to = np.uint64(leaf * _LEAF), np.uint64(place * _LEAF)
    for i in range(_LEAF):
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


@kernel
def _scores(x: Any, y: Any, z: Any, mu: Any, members: Any) -> Any:
    """M(q) for the points q in `members`, (m,): the votes of every p ≠ q, added in row order."""
    scores = np.zeros(len(members))
    for i in range(len(members)):
        q = members[i]
        for p in range(len(x)):
            if p == q:
                continue
            dx, dy, dz = x[q] - x[p], y[q] - y[p], z[q] - z[p]
            scores[i] += _vote(math.sqrt((dx * dx + dy * dy) + dz * dz), mu[p])
    return scores


@kernel
def _vote(distance: float, mu: float) -> float:
    """V_p(q) (eq. 4) at a distance D_p(q), and what stands for it where the equation has no value."""
    if distance == math.inf:
        return 0.0
    if mu == 0:
        return _PEAK if distance == 0 else 0.0
    ratio = distance / mu
    return math.exp(-(ratio * ratio) / 2) * _PEAK


@kernel
def _estimates(x: Any, y: Any, z: Any, mu: Any) -> tuple[Any, float]:
    """Estimates of those scores that may be the highest, (n,), and how far below the highest a winner can be.

    All others are -Inf. Few scores are estimated, and bound the others: the votes of p are a Gaussian bell over
    space, whose second derivative is at most 2 e^(-3/2) / mu_p² in any direction. So with the estimate M(q), its
    gradient g, and C = e^(-3/2) Σ 1 / mu_p², a point at q + d has a score of at most M(q) + g·d + C |d|². The
    point with the highest bound is asked next, until no bound reaches the best estimate: for points on a surface
    after some fifty, however many there are.

    Estimates have errors: exp(-t) = exp(-t/16)^16, the inner one by six terms of its series, is wrong by less than
    1e-7 (t⁷ / (16⁶ 7!) e^-t is at most 9e-9), and 0 beyond t = 32. The gradient is then wrong by less than
    8e-7 Σ 1 / mu_p, which times |d| is below 4e-7 Σ (1 + |d|² / mu_p²): C is enlarged by more than that.
    A point whose mu_p is 0 or beyond all measure has no such bell, and counts as one that may vote for anybody.
    Each point's vote for itself adds the same to all. Votes are estimated without their common factor.
    """
    n = len(x)
    voters = np.empty((4, n))  # x, y, z and 1 / mu² of those with a bell
    bells, total = 0, 0.0
    for p in range(n):
        if 1e-100 < mu[p] < 1e100:
            voters[0, bells], voters[1, bells], voters[2, bells] = x[p], y[p], z[p]
            voters[3, bells] = 1 / (mu[p] * mu[p])
            total += voters[3, bells]
            bells += 1
    curvature = 0.224 * total  # e^-1.5 = 0.22313
    margin = 4e-6 * n + (n - bells)
    bounds, estimates = np.full(n, np.inf), np.full(n, -np.inf)
    best = -math.inf
    for _ in range(n):
        q = np.argmax(bounds)
        if bounds[q] < best - margin:
            break
        estimate, gx, gy, gz = _estimate(voters, bells, x[q], y[q], z[q])
        estimates[q] = estimate
        best = max(best, estimate)
        for i in range(n):
            dx, dy, dz = x[i] - x[q], y[i] - y[q], z[i] - z[q]
            bound = estimate + (gx * dx + gy * dy + gz * dz) + curvature * ((dx * dx + dy * dy) + dz * dz)
            bounds[i] = min(bounds[i], bound)  # as it was where the bound is NaN
        bounds[q] = -math.inf
    return estimates, margin


@kernel
def _estimate(voters: Any, count: int, qx: float, qy: float, qz: float) -> tuple[float, float, float, float]:
    """The sum of the voters' votes for the place q, and its gradient.

    Each vote is added to one of several sums: such a loop is vectorised, a single sum is not.
    """
    x, y, z, sharpness = voters[0], voters[1], voters[2], voters[3]
    sums = np.zeros((4, _LANES))
    for start in range(0, count, _LANES):
        for lane in range(min(_LANES, count - start)):
            p = np.uint64(start) + np.uint64(lane)
            dx, dy, dz = x[p] - qx, y[p] - qy, z[p] - qz
            t = ((dx * dx + dy * dy) + dz * dz) * sharpness[p] / 32
            series = 1 - t * (1 - t / 2 * (1 - t / 3 * (1 - t / 4 * (1 - t / 5 * (1 - t / 6)))))
            series *= series
            series *= series
            series *= series
            vote = series * series if t < 2 else 0.0
            pull = vote * sharpness[p] if t < 2 else 0.0
            sums[0, lane] += vote
            sums[1, lane] += pull * dx
            sums[2, lane] += pull * dy
            sums[3, lane] += pull * dz
    estimate, gx, gy, gz = 0.0, 0.0, 0.0, 0.0
    for lane in range(_LANES):
        estimate += sums[0, lane]
        gx += sums[1, lane]
        gy += sums[2, lane]
        gz += sums[3, lane]
    return estimate, gx, gy, gz


@kernel
def select(values: Any, rank: int) -> Any:
    """The value at index `rank` of the sorted `values`, (n,) without NaN (Hoare's selection).

    Reorders `values` so that no value before `rank` is greater, and none behind it is less.
    """
    left, right = 0, len(values) - 1
    while left < right:
        a, b, c = values[left], values[(left + right) // 2], values[right]
        pivot = max(min(a, b), min(max(a, b), c))
        i, j = left, right
        while i <= j:
            while values[i] < pivot:
                i += 1
            while pivot < values[j]:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if rank <= j:
            right = j
        elif rank >= i:
            left = i
        else:
            break
    return values[rank]


def choose_region(xyz: Cloud) -> Region:
    """A region T that is as fully measured and as smooth as possible, always the same for the same cloud.

    Candidates of 60×60 points stand half a side apart, and 64 of them, evenly picked, are looked at. Of those
    with at least 95 % of their points measured, the one with the least median second difference of the heights
    wins: a tilt or a few outliers do not make a surface rough. Where these are less than half, all candidates are
    counted, and 64 of those with at least 95 % of the best one's measured points are compared instead.

    Args:
        xyz: (H, W, 3) organized cloud.

    Returns:
        The region, smaller than 60×60 only where the cloud is.

    Raises:
        NoSeedError: nothing is measured.
    """
    rows, columns = (_candidates(extent) for extent in xyz.shape[:2])
    height, width = rows.side, columns.side
    memory = flattened(xyz)

    def compare(picked: npt.NDArray[np.intp], least: float) -> tuple[int, int, int]:
        tops = rows.starts[picked // len(columns.starts)]
        lefts = columns.starts[picked % len(columns.starts)]

        def compare_band(band: slice) -> tuple[float, int, int]:
            differences = np.full((2, height, width), np.nan)  # along rows, along columns; the ends have none
            line, heights = np.empty((4, width + 2), xyz.dtype), np.empty((height, width))
            work = line, heights, differences, np.empty(differences.size)
            roughness, best, count = _smoothest(*memory, tops[band], lefts[band], least, *work)
            return roughness, band.start + best, count

        found = [band for band in in_bands(compare_band, len(tops), height * width) if band[2]]
        _, best, _ = min(found, default=(math.inf, 0, 0))
        return int(tops[best]), int(lefts[best]), sum(count for *_, count in found)

    picked = _evenly_picked(np.arange(len(rows.starts) * len(columns.starts)))
    top, left, count = compare(picked, _WELL_MEASURED * height * width)
    if 2 * count < len(picked):
        counts = _count_candidates(memory, rows, columns, xyz.shape[:2])
        if counts.max() == 0:
            raise NoSeedError('Nothing is measured in this cloud: each of its points has a NaN or Inf coordinate.')
        least = _WELL_MEASURED * float(counts.max())
        top, left, _ = compare(_evenly_picked(np.flatnonzero(counts >= least)), least)
    return top, left, height, width


def _evenly_picked(candidates: npt.NDArray[np.intp]) -> npt.NDArray[np.intp]:
    """At most 64 of them."""
    if len(candidates) <= CANDIDATES:
        return candidates
    return candidates[np.arange(CANDIDATES) * len(candidates) // CANDIDATES]


def _count_candidates(
    memory: Memory, rows: '_Candidates', columns: '_Candidates', shape: tuple[int, int]
) -> npt.NDArray[np.int64]:
    """How many points of each of all candidates are measured, (n,), in row order, from one pass over the cloud.

    Candidates overlap: measured points are counted between all of their edges, and then added up.
    """
    between = np.zeros((len(rows.edges) - 1, shape[1]), np.uint8)  # a side has fewer than 256 points

    def count(band: slice) -> None:
        line = np.empty((4, band.stop - band.start + 2), memory[0].dtype)
        _count_measured(*memory, rows.edges, band.start, line, between[:, band])

    in_bands(count, shape[1], shape[0])
    cells = np.add.reduceat(between, columns.edges[:-1], axis=1, dtype=np.int64)
    sums = np.pad(cells.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    sums = sums[rows.last] - sums[rows.first]
    counts: npt.NDArray[np.int64] = sums[:, columns.last] - sums[:, columns.first]
    return counts.ravel()


class _Candidates(NamedTuple):
    """Where candidates lie along an axis: the last one ends with it."""

    side: int
    starts: npt.NDArray[np.int64]
    edges: npt.NDArray[np.int64]
    """All places where one begins or ends, ascending."""
    first: npt.NDArray[np.intp]
    """Which edge each begins with."""
    last: npt.NDArray[np.intp]
    """Which edge each ends with."""


@lru_cache(maxsize=8)
def _candidates(extent: int) -> _Candidates:
    """The candidates along an axis of `extent` points; it is the same for all clouds of an instrument."""
    side = min(SIDE, extent)
    starts = np.union1d(np.arange(0, extent - side + 1, SIDE // 2), extent - side)
    edges = np.union1d(starts, starts + side)
    return _Candidates(side, starts, edges, np.searchsorted(edges, starts), np.searchsorted(edges, starts + side))


@kernel
def _count_measured(
    values: Any, row_step: int, point_step: int, edges: Any, left: int, line: Any, between: Any
) -> None:
    """Count each column's measured points between two `edges`, (E,), which are rows, and the next two.

    One pass over the columns from `left` on; `between`, (E - 1, columns), comes as 0, `line` is a row for work.
    """
    width = between.shape[1]
    for i in range(len(edges) - 1):
        counts = between[i]
        for row in range(edges[i], edges[i + 1]):
            load_row(values, row * row_step + left * point_step, point_step, width, line)
            x, y, z = line[0, 1:], line[1, 1:], line[2, 1:]
            for column in range(width):
                counts[column] += is_measured(x[column], y[column], z[column])


@kernel
def _smoothest(
    values: Any,
    row_step: int,
    point_step: int,
    tops: Any,
    lefts: Any,
    enough: float,
    line: Any,
    heights: Any,
    differences: Any,
    known: Any,
) -> tuple[float, int, int]:
    """Compare the candidates with `enough` measured points. The arrays behind `enough` are for work.

    A candidate's roughness is sought only where it is below the least so far, and that a count tells: more
    than half of its differences are below. Of 64 candidates this leaves the median of about five.

    Returns how rough the least rough one is, which it is, the first of equally rough ones, and how many there are.
    """
    height, width = heights.shape
    best, least, compared = 0, math.inf, 0
    for candidate in range(len(tops)):
        count = 0
        for row in range(height):
            start = (tops[candidate] + row) * row_step + lefts[candidate] * point_step
            load_row(values, start, point_step, width, line)
            x, y, z = line[0, 1:], line[1, 1:], line[2, 1:]
            for column in range(width):
                measured = is_measured(x[column], y[column], z[column])
                heights[row, column] = z[column] if measured else np.nan
                count += measured
        if count < enough:
            continue
        best = best if compared else candidate
        compared += 1
        n, below = _second_differences(heights, differences, least)
        rank = (n - 1) // 2
        if n and below > rank:
            n = 0
            for axis in range(2):
                for row in range(height):
                    for difference in differences[axis, row]:
                        known[n] = difference
                        n += not np.isnan(difference)
            best, least = candidate, select(known[:n], rank)
    return least, best, compared


@kernel
def _second_differences(heights: Any, differences: Any, least: float) -> tuple[int, int]:
    """Write |(a - b) - (b - c)| of three neighbours' heights; how many are known, how many below `least`.

    Where one of the three is not measured, the difference is NaN. Loops without a branch are vectorised.
    """
    height, width = heights.shape
    n, below = 0, 0
    for row in range(height):
        before, here, behind = heights[row], heights[row, 1:], heights[row, 2:]
        along = differences[0, row]
        for column in range(width - 2):
            b = here[column]
            difference = abs((before[column] - b) - (b - behind[column]))
            along[column] = difference
            n += difference == difference  # noqa: PLR0124 — not NaN
            below += difference < least
    for row in range(1, height - 1):
        above, here, under, across = heights[row - 1], heights[row], heights[row + 1], differences[1, row]
        for column in range(width):
            b = here[column]
            difference = abs((above[column] - b) - (b - under[column]))
            across[column] = difference
            n += difference == difference  # noqa: PLR0124
            below += difference < least
    return n, below
