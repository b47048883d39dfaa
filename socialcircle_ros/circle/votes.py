"""The votes of the points for each other (section 3.2.1, eq. 4)."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Cloud, measured_points
from socialcircle_ros.kernels.compiled import kernel

from .medians import median_distances

_PEAK = 1 / math.sqrt(2 * math.pi)
_LANES = 32


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
    places, x, y, z = voters(xyz)
    scores = np.full(xyz.shape[0] * xyz.shape[1], np.nan)
    scores[places] = votes_received(x, y, z, median_distances(x, y, z), np.arange(len(places)))
    return scores.reshape(xyz.shape[:2])


def voters(xyz: Cloud) -> tuple[Any, Any, Any, Any]:
    """The measured points of a region in row order: their places in it, and x, y, z, each (n,) float64."""
    measured = measured_points(xyz)
    x, y, z = np.ascontiguousarray(xyz[measured].T, np.float64)
    return np.flatnonzero(measured), x, y, z


@kernel
def votes_received(x: Any, y: Any, z: Any, mu: Any, members: Any) -> Any:
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
def estimate_scores(x: Any, y: Any, z: Any, mu: Any) -> tuple[Any, float]:
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
