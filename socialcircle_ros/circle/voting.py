"""The acquisition of the initial point (section 3.2.1): where to vote, the votes, and who wins."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.compiled import kernel
from socialcircle_ros.errors import NoSeedError

from .cloud import Cloud, Mask, measured_points

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
    scores = vote_scores(square) if square.size else np.empty((0, 0))
    if not np.isfinite(scores).any():
        raise NoSeedError(
            f'No point of the vote region at row {top}, column {left} ({height}×{width} points) is measured'
            f' in this cloud of {xyz.shape[0]}×{xyz.shape[1]} points; move circle.vote_region, or set it to'
            ' zeros to have it chosen.'
        )
    row, column = divmod(int(np.nanargmax(scores)), scores.shape[1])
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
    measured = measured_points(xyz)
    scores = np.full(measured.shape, np.nan)
    scores[measured] = _vote_scores(*np.ascontiguousarray(xyz[measured].T, np.float64))
    return scores


@kernel
def _vote_scores(x: Any, y: Any, z: Any) -> Any:
    """`vote_scores` of the measured points, (n,) float64 each."""
    n = len(x)
    scores = np.zeros(n)
    squared, others = np.empty(n), np.empty(max(n - 1, 0))
    for p in range(n):
        for q in range(n):
            dx, dy, dz = x[q] - x[p], y[q] - y[p], z[q] - z[p]
            squared[q] = (dx * dx + dy * dy) + dz * dz
        others[:p] = squared[:p]
        others[p:] = squared[p + 1 :]
        mu = _median_root(others)
        for q in range(n):
            if q == p:
                continue
            distance = math.sqrt(squared[q])
            if distance == math.inf:
                continue
            if mu > 0:
                ratio = distance / mu
                scores[q] += math.exp(-(ratio * ratio) / 2) * _PEAK
            elif distance == 0:
                scores[q] += _PEAK
    return scores


@kernel
def _median_root(squared: Any) -> float:
    """The median of the roots of `squared`, (n,) float64, which is put in another order; 0 for n = 0.

    Squares have the same order as their roots, so that the median is found among the squares and only
    its one or two members are rooted.
    """
    n = len(squared)
    if n == 0:
        return 0.0
    upper = select(squared, n // 2)
    if n % 2 == 1:
        return math.sqrt(upper)
    lower = squared[: n // 2].max()
    return (math.sqrt(lower) + math.sqrt(upper)) / 2


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
    measured = measured_points(xyz)
    height, width = (min(SIDE, extent) for extent in measured.shape)
    rows = _starts(measured.shape[0], height)
    columns = _starts(measured.shape[1], width)
    counts = _measured_in(measured, rows, columns, height, width)
    if counts.max() == 0:
        raise NoSeedError(
            'Nothing is measured in this cloud: each of its points has a NaN or Inf coordinate.'
        )
    kept = np.flatnonzero(counts >= 0.95 * counts.max())
    if len(kept) > CANDIDATES:
        kept = kept[np.arange(CANDIDATES) * len(kept) // CANDIDATES]
    best, best_roughness = kept[0], math.inf
    for candidate in kept:
        top, left = rows[candidate // len(columns)], columns[candidate % len(columns)]
        square = slice(top, top + height), slice(left, left + width)
        roughness = _roughness(xyz[square], measured[square])
        if roughness < best_roughness:
            best, best_roughness = candidate, roughness
    return int(rows[best // len(columns)]), int(columns[best % len(columns)]), height, width


def _starts(extent: int, side: int) -> npt.NDArray[np.int64]:
    """Where candidates of `side` points begin along an axis of `extent` points; the last one ends with it."""
    return np.union1d(np.arange(0, extent - side + 1, SIDE // 2), extent - side)


@kernel
def _measured_in(measured: Mask, rows: Any, columns: Any, height: int, width: int) -> Any:
    """Number of measured points of each candidate, (rows · columns,) in row order."""
    counts = np.empty(len(rows) * len(columns), np.int64)
    of_column = np.empty(measured.shape[1], np.uint8)
    for i in range(len(rows)):
        of_column[:] = 0
        for row in range(rows[i], rows[i] + height):
            for column in range(measured.shape[1]):
                of_column[column] += measured[row, column]
        for j in range(len(columns)):
            count = 0
            for column in range(columns[j], columns[j] + width):
                count += of_column[column]
            counts[i * len(columns) + j] = count
    return counts


@kernel
def _roughness(xyz: Cloud, measured: Mask) -> float:
    """Median of |(a - b) - (b - c)| over the heights of three measured neighbours in a row or a column."""
    height, width = measured.shape
    differences = np.empty(2 * height * width)
    n = 0
    for row in range(height):
        for column in range(width):
            if not measured[row, column]:
                continue
            b = np.float64(xyz[row, column, 2])
            if 0 < column < width - 1 and measured[row, column - 1] and measured[row, column + 1]:
                differences[n] = abs((xyz[row, column - 1, 2] - b) - (b - xyz[row, column + 1, 2]))
                n += 1
            if 0 < row < height - 1 and measured[row - 1, column] and measured[row + 1, column]:
                differences[n] = abs((xyz[row - 1, column, 2] - b) - (b - xyz[row + 1, column, 2]))
                n += 1
    return select(differences[:n], (n - 1) // 2) if n else math.inf
