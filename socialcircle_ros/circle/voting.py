"""The acquisition of the initial point (section 3.2.1): where to vote, the votes, and who wins."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Cloud, flattened, load_row, measured_in_row, measured_points
from socialcircle_ros.compiled import kernel
from socialcircle_ros.errors import NoSeedError

Region = tuple[int, int, int, int]
"""Row and column of the first point, height and width, in points."""

SIDE = 60
"""Side of a chosen region: the paper wants at least 60 points."""

CANDIDATES = 64
"""So many candidates are compared for their roughness, so that the choice costs the same for any cloud."""

_PEAK = 1 / math.sqrt(2 * math.pi)


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
    contenders = _contenders(x, y, z, mu)
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


@kernel
def _medians(x: Any, y: Any, z: Any) -> Any:
    """mu_p (eq. 5) of each point p, (n,).

    Squares have the same order as their roots: the median is found among the squared distances, and only
    its one or two members are rooted. Neighbours have nearly the same median, so that it is sought first
    among the distances close to that of the point before: about a tenth of them.
    """
    n = len(x)
    mu = np.zeros(n)
    squared, near = np.empty(n), np.empty(n)
    upper_rank = (n - 1) // 2 + 1  # behind p itself, whose distance 0 comes first
    lower_rank = upper_rank - (n % 2)
    upper = 0.0
    for p in range(n if n > 1 else 0):
        for q in range(n):
            dx, dy, dz = x[q] - x[p], y[q] - y[p], z[q] - z[p]
            squared[q] = (dx * dx + dy * dy) + dz * dz
        low, high = 0.9 * upper, 1.1 * upper
        below, count = 0, 0
        for q in range(n):
            below += squared[q] < low
            near[count] = squared[q]
            count += (squared[q] >= low) & (squared[q] <= high)
        if below <= lower_rank and upper_rank < below + count:
            candidates, skipped = near[:count], below
        else:
            candidates, skipped = squared, 0
        upper = select(candidates, upper_rank - skipped)
        if lower_rank == upper_rank:
            mu[p] = math.sqrt(upper)
        else:
            lower = candidates[: upper_rank - skipped].max()
            mu[p] = (math.sqrt(lower) + math.sqrt(upper)) / 2
    return mu


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
def _contenders(x: Any, y: Any, z: Any, mu: Any) -> Any:
    """The points that can have the highest score, in row order.

    All scores are estimated, each vote with an error below 1e-7: exp(-t) = exp(-t/16)^16, the inner one by
    six terms of its series, whose error t⁷/(16⁶ 7!) e^-t is at most 9e-9; such a loop is vectorised, exp is
    not. Whose estimate lies further below the best than both errors cannot win, and the few that remain
    are counted exactly. (Each point's vote for itself adds the same to all. Votes are estimated without
    their common factor.)
    """
    n = len(x)
    estimates = np.zeros(n)
    for p in range(n):
        spread = 32 * mu[p] * mu[p]
        if not 1e-200 < spread < 1e200:
            for q in range(n):
                dx, dy, dz = x[q] - x[p], y[q] - y[p], z[q] - z[p]
                estimates[q] += _vote(math.sqrt((dx * dx + dy * dy) + dz * dz), mu[p]) / _PEAK
            continue
        scale = 1 / spread
        for q in range(n):
            dx, dy, dz = x[q] - x[p], y[q] - y[p], z[q] - z[p]
            t = ((dx * dx + dy * dy) + dz * dz) * scale
            t = t if t < 2 else 2.0  # e^-32 is nothing
            series = 1 - t * (1 - t / 2 * (1 - t / 3 * (1 - t / 4 * (1 - t / 5 * (1 - t / 6)))))
            series *= series
            series *= series
            series *= series
            estimates[q] += series * series
    return np.flatnonzero(estimates >= estimates.max() - 2e-7 * n)


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

    Candidates of 60×60 points stand half a side apart. Of those that have at least 95 % of the best one's
    measured points, and at most 64 of them, evenly picked, the one with the least median second difference
    of the heights wins: a tilt or a few outliers do not make a surface rough.

    Args:
        xyz: (H, W, 3) organized cloud.

    Returns:
        The region, smaller than 60×60 only where the cloud is.

    Raises:
        NoSeedError: nothing is measured.
    """
    height, width = (min(SIDE, extent) for extent in xyz.shape[:2])
    rows = _starts(xyz.shape[0], height)
    columns = _starts(xyz.shape[1], width)
    values, row_step, point_step = flattened(xyz)
    counts = _measured_in(values, row_step, point_step, xyz.shape[1], rows, columns, height, width)
    if counts.max() == 0:
        raise NoSeedError('Nothing is measured in this cloud: each of its points has a NaN or Inf coordinate.')
    kept = np.flatnonzero(counts >= 0.95 * counts.max())
    if len(kept) > CANDIDATES:
        kept = kept[np.arange(CANDIDATES) * len(kept) // CANDIDATES]
    tops, lefts = rows[kept // len(columns)], columns[kept % len(columns)]
    best = _smoothest(values, row_step, point_step, tops, lefts, height, width)
    return int(tops[best]), int(lefts[best]), height, width


def _starts(extent: int, side: int) -> npt.NDArray[np.int64]:
    """Where candidates of `side` points begin along an axis of `extent` points; the last one ends with it."""
    return np.union1d(np.arange(0, extent - side + 1, SIDE // 2), extent - side)


@kernel
def _measured_in(
    values: Any,
    row_step: int,
    point_step: int,
    columns_of_cloud: int,
    rows: Any,
    columns: Any,
    height: int,
    width: int,
) -> Any:
    """Number of measured points of each candidate, (rows · columns,) in row order, in one pass over the cloud."""
    counts = np.zeros((len(rows), len(columns)), np.int64)
    of_column = np.zeros((len(rows), columns_of_cloud), np.uint8)  # a side has fewer than 256 points
    line = np.empty((4, columns_of_cloud + 2), values.dtype)
    measured = np.empty(columns_of_cloud, np.bool_)
    first = 0  # of the candidates, row by row, that the row at hand may be in
    for row in range(rows[-1] + height):
        load_row(values, row * row_step, point_step, columns_of_cloud, line)
        measured_in_row(line, measured)
        while row >= rows[first] + height:
            first += 1
        for i in range(first, len(rows)):
            if row < rows[i]:
                break
            column_counts = of_column[i]
            for column in range(columns_of_cloud):
                column_counts[column] += measured[column]
    for i in range(len(rows)):
        for j in range(len(columns)):
            for column in range(columns[j], columns[j] + width):
                counts[i, j] += of_column[i, column]
    return counts.ravel()


@kernel
def _smoothest(values: Any, row_step: int, point_step: int, tops: Any, lefts: Any, height: int, width: int) -> int:
    """Which candidate is the least rough: the first of equally rough ones.

    A candidate's roughness is sought only where it is below the least so far, and that a count tells: more
    than half of its differences are below. Of 64 candidates this leaves the median of about five.
    """
    line = np.empty((4, width + 2), values.dtype)
    measured = np.empty(width, np.bool_)
    heights = np.empty((height, width))
    differences = np.full((2, height, width), np.nan)  # along rows, along columns; the ends have none
    best, least = 0, math.inf
    for candidate in range(len(tops)):
        for row in range(height):
            start = (tops[candidate] + row) * row_step + lefts[candidate] * point_step
            load_row(values, start, point_step, width, line)
            measured_in_row(line, measured)
            for column in range(width):
                heights[row, column] = line[2, column + 1] if measured[column] else np.nan
        n, below = _second_differences(heights, differences, least)
        rank = (n - 1) // 2
        if n and below > rank:
            known = differences.ravel()
            best, least = candidate, select(known[~np.isnan(known)], rank)
    return best


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
