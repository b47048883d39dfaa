# SPDX-License-Identifier: Apache-2.0
"""The votes of the points of the region T for each other, and their sums (section 3.2.1, eq. 4).

V_p(q) = exp(-(D_p(q) / mu_p)² / 2) / √(2π) is the vote of p for q at the distance D_p(q); mu_p comes from
`medians` (eq. 5). The score of q is the sum of the votes that it receives, M(q) = Σ_p V_p(q) over all p ≠ q. All
of this is float64.

Two cases are not in the paper: a point infinitely far from p receives no vote from p, and where mu_p is 0, p votes
only for points at its own place.
"""

import math

import numpy as np

from socialcircle_ros.cloud import Cloud, measured_points
from socialcircle_ros.kernels.compiled import kernel

from .arrays import Floats64, Indices, Integers
from .kd_tree import Points
from .medians import median_distances

_PEAK = 1 / math.sqrt(2 * math.pi)

_LANES = 32
"""Partial sums of a loop: LLVM vectorises it with them, but may not reorder the additions of a single sum."""


def voters(region: Cloud) -> tuple[Indices, Points]:
    """Return the points that vote: the measured points of the region, in row order.

    Args:
        region: (H, W, 3) the points of T.

    Returns:
        Their indices in the flattened region, (n,), and their coordinates, (3, n).
    """
    measured = measured_points(region)
    return np.flatnonzero(measured), np.ascontiguousarray(region[measured].T, np.float64)


def vote_scores(region: Cloud) -> Floats64:
    """Return the matrix M: the score of each point of the region (eq. 4 and 5).

    Args:
        region: (H, W, 3) the points of T.

    Returns:
        (H, W); NaN where a point is not measured.
    """
    indices, points = voters(region)
    scores = np.full(region.shape[0] * region.shape[1], np.nan)
    scores[indices] = _scores(points, median_distances(points), np.arange(len(indices)))
    return scores.reshape(region.shape[:2])


def highest_score(points: Points, mu: Floats64) -> int:
    """Return the index of the point with the highest score; the first one of equal scores.

    Nearly all points are ruled out by estimates, so that exact scores, n votes each, are computed for a few.

    Args:
        points: (3, n), with n above 0.
        mu: (n,) as `median_distances` returns it.

    Returns:
        0 to n - 1.
    """
    estimates, margin = _estimate_scores(points, mu)
    contenders = np.flatnonzero(estimates >= estimates.max() - margin)
    return int(contenders[np.argmax(_scores(points, mu, contenders))])


@kernel
def _scores(points: Points, mu: Floats64, members: Integers) -> Floats64:
    """Return M(q) of the points with the indices in `members`, (m,). The votes are added in the voters' order."""
    x, y, z = points[0], points[1], points[2]
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
    """Return V_p(q) (eq. 4) for the distance D_p(q)."""
    if distance == math.inf:
        return 0.0
    if mu == 0:
        return _PEAK if distance == 0 else 0.0
    ratio = distance / mu
    return math.exp(-(ratio * ratio) / 2) * _PEAK


@kernel
def _estimate_scores(points: Points, mu: Floats64) -> tuple[Floats64, float]:
    """Estimate the scores of the points that may have the highest one.

    A few scores are estimated, and they bound all others. The votes of p are a Gaussian function of space, and
    its second derivative in any direction is at most 2 e^(-3/2) / mu_p². So a point at q + d has a score of at
    most M(q) + g·d + C |d|², where g is the gradient of M at q and C = e^(-3/2) Σ_p 1 / mu_p². The point with
    the highest bound is estimated next, until no bound reaches the best estimate. For points on a surface that
    takes about fifty estimates, whatever n is.

    Votes are estimated without the factor 1 / √(2π), and with the vote of each point for itself, which adds 1 to
    each score. The errors:

    - exp(-t) = exp(-t / 16)^16, the inner one by six terms of its series, is off by less than 1e-7: the error
      t⁷ / (16⁶ 7!) e^(-t) is at most 9e-9. Beyond t = 32 the estimate is 0.
    - The gradient is then off by less than 8e-7 Σ_p 1 / mu_p. Times |d|, that is less than
      4e-7 Σ_p (1 + |d|² / mu_p²). C is enlarged by more than that.
    - Where mu_p is not between 1e-100 and 1e100, the votes of p are not estimated: any point may receive one.

    Args:
        points: (3, n).
        mu: (n,).

    Returns:
        The estimates, (n,), -Inf where a score was not estimated; and the margin: so far below the highest
        estimate the one of the point with the highest score may be.
    """
    x, y, z = points[0], points[1], points[2]
    n = len(x)
    bells = np.empty((4, n))  # x, y, z and 1 / mu² of the voters with estimated votes
    count, total = 0, 0.0
    for p in range(n):
        if 1e-100 < mu[p] < 1e100:
            bells[0, count], bells[1, count], bells[2, count] = x[p], y[p], z[p]
            bells[3, count] = 1 / (mu[p] * mu[p])
            total += bells[3, count]
            count += 1
    curvature = 0.224 * total  # e^-1.5 = 0.22313
    margin = 4e-6 * n + (n - count)
    bounds, estimates = np.full(n, np.inf), np.full(n, -np.inf)
    best = -math.inf
    for _ in range(n):
        q = np.argmax(bounds)
        if bounds[q] < best - margin:
            break
        estimate, gx, gy, gz = _estimate(bells, count, x[q], y[q], z[q])
        estimates[q] = estimate
        best = max(best, estimate)
        for i in range(n):
            dx, dy, dz = x[i] - x[q], y[i] - y[q], z[i] - z[q]
            bound = estimate + (gx * dx + gy * dy + gz * dz) + curvature * ((dx * dx + dy * dy) + dz * dz)
            bounds[i] = min(bounds[i], bound)  # min keeps the old bound where the new one is NaN
        bounds[q] = -math.inf
    return estimates, margin


@kernel
def _estimate(bells: Floats64, count: int, qx: float, qy: float, qz: float) -> tuple[float, float, float, float]:
    """Estimate the sum of the first `count` voters' votes for the place q, and its gradient."""
    x, y, z, sharpness = bells[0], bells[1], bells[2], bells[3]
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
