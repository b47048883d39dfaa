# SPDX-License-Identifier: Apache-2.0
"""The social circle of section 3.2, point by point: the reference for `socialcircle_ros.circle`.

Plain loops in the order of the paper. Only the settings and the errors are shared with the compiled code. Votes
are float64; distances that decide membership are in the cloud's own dtype.
"""

import math
from typing import NamedTuple

import numpy as np

from socialcircle_ros.errors import CloudError, NoRadiusError, NoSeedError

SIDE = 60  # of the region T: "should not be less than 60 points in the x and y directions"
MOST_CANDIDATES = 64


class Result(NamedTuple):
    inliers: np.ndarray
    outliers: np.ndarray
    seed: tuple
    radius: float


@np.errstate(over='ignore', under='ignore')
def remove_outliers(xyz, settings):
    """The whole of section 3.2."""
    check_cloud(xyz)
    measured = measured_mask(xyz)
    region = settings.vote_region or choose_region(xyz)
    seed = elect_seed(xyz, region)
    scalar = xyz.dtype.type
    if settings.radius is None:
        limit = ring_limit(xyz, seed, settings.window)
    else:
        limit = scalar(settings.radius) * scalar(settings.radius)
    if settings.radius_scale != 1.0:
        limit = limit * (scalar(settings.radius_scale) * scalar(settings.radius_scale))
    if math.isinf(limit) and ring_overflows(xyz, seed, settings.window):
        raise CloudError(f'The dtype does not hold the squared distances round {seed}.')
    inliers = expand(xyz, seed, limit, settings.window)
    return Result(inliers, measured & ~inliers, seed, float(np.sqrt(limit)))


def check_cloud(xyz):
    if xyz.ndim != 3 or xyz.shape[2] != 3 or 0 in xyz.shape:
        raise CloudError(f'The shape must be (H, W, 3) with H and W above 0, not {xyz.shape}.')
    if xyz.dtype not in (np.float32, np.float64):
        raise CloudError(f'The dtype must be float32 or float64, not {xyz.dtype}.')


def is_measured(point):
    x, y, z = point
    return math.isfinite(x) and math.isfinite(y) and math.isfinite(z)


def measured_mask(xyz):
    rows, columns = xyz.shape[:2]
    return np.array([[is_measured(xyz[row, column]) for column in range(columns)] for row in range(rows)])


# 3.2.1 The vote region T, where the user gives none.


def choose_region(xyz):
    """The smoothest of the best measured regions of 60×60 points, or less where the cloud is smaller."""
    height, width = min(SIDE, xyz.shape[0]), min(SIDE, xyz.shape[1])
    corners = [(row, column) for row in starts(xyz.shape[0], height) for column in starts(xyz.shape[1], width)]
    # NumPy counts, because a loop over all points of all candidates would take minutes.
    mask = np.isfinite(xyz).all(axis=2)

    def count(corner):
        row, column = corner
        return int(mask[row : row + height, column : column + width].sum())

    sample = evenly_spread(corners)
    kept = [corner for corner in sample if count(corner) >= 0.95 * height * width]
    if 2 * len(kept) < len(sample):
        best = max(map(count, corners))
        if best == 0:
            raise NoSeedError('No point of the cloud is measured.')
        kept = evenly_spread([corner for corner in corners if count(corner) >= 0.95 * best])
    smoothest, least = kept[0], math.inf
    for row, column in kept:
        value = roughness(xyz[row : row + height, column : column + width])
        if value < least:
            smoothest, least = (row, column), value
    return (*smoothest, height, width)


def evenly_spread(corners):
    """At most 64 of the corners."""
    if len(corners) <= MOST_CANDIDATES:
        return corners
    return [corners[k * len(corners) // MOST_CANDIDATES] for k in range(MOST_CANDIDATES)]


def starts(length, side):
    """Every 30th start at which `side` points fit, and the last one."""
    found = [start for start in range(0, length, 30) if start + side <= length]
    if found[-1] != length - side:
        found.append(length - side)
    return found


def roughness(region):
    """The lower median of all second differences of the heights; infinite where all heights are equal."""
    grid = [[float(p[2]) if is_measured(p) else None for p in row] for row in region.tolist()]
    if len({height for row in grid for height in row if height is not None}) == 1:
        return math.inf
    differences = []
    for line in grid + [list(column) for column in zip(*grid, strict=True)]:
        for a, b, c in zip(line, line[1:], line[2:], strict=False):
            if a is not None and b is not None and c is not None:
                differences.append(abs((a - b) - (b - c)))
    if not differences:
        return math.inf
    return sorted(differences)[(len(differences) - 1) // 2]


# 3.2.1 The initial point I.


def elect_seed(xyz, region):
    """The point of T, clipped to the cloud, with the highest score; the first in row order of several."""
    row0, column0, height, width = region
    scores = vote_scores(xyz[row0 : row0 + height, column0 : column0 + width])
    seed, highest = None, -math.inf
    for row in range(scores.shape[0]):
        for column in range(scores.shape[1]):
            if scores[row, column] > highest:  # False for NaN
                seed, highest = (row0 + row, column0 + column), scores[row, column]
    if seed is None:
        raise NoSeedError(f'No point of the vote region {region} is measured.')
    return seed


def vote_scores(region):
    """M: for each measured point of T the sum of the votes that it receives; NaN for the others."""
    rows, columns = region.shape[:2]
    places = [(row, column) for row in range(rows) for column in range(columns)]
    places = [place for place in places if is_measured(region[place])]
    points = [[float(coordinate) for coordinate in region[place]] for place in places]
    scores = [0.0] * len(points)
    for p in range(len(points)):
        distances = [distance(points[p], q) for q in points]
        others = distances[:p] + distances[p + 1 :]
        if not others:
            break
        mu = median(others)  # eq. 5
        for q in range(len(points)):
            if q != p:
                scores[q] += vote(distances[q], mu)
    matrix = np.full((rows, columns), np.nan)
    for place, score in zip(places, scores, strict=True):
        matrix[place] = score
    return matrix


def distance(p, q):
    dx, dy, dz = p[0] - q[0], p[1] - q[1], p[2] - q[2]
    return math.sqrt((dx * dx + dy * dy) + dz * dz)


def median(values):
    values = sorted(values)
    middle = len(values) // 2
    return values[middle] if len(values) % 2 else (values[middle - 1] + values[middle]) / 2


def vote(distance, mu):
    """Eq. 4."""
    peak = 1 / math.sqrt(2 * math.pi)
    if math.isinf(distance):
        return 0.0
    if mu == 0:
        return peak if distance == 0 else 0.0
    ratio = distance / mu
    return math.exp(-(ratio * ratio) / 2) * peak


# 3.2.2 The radius R.


@np.errstate(over='ignore', under='ignore')
def ring_limit(xyz, seed, window):
    """R²: index 8k of the sorted ring, or the middle of its measured points (eq. 6, 7)."""
    k = window // 2
    ring = []
    for row in range(seed[0] - 2 * k, seed[0] + 2 * k + 1):
        for column in range(seed[1] - 2 * k, seed[1] + 2 * k + 1):
            on_ring = max(abs(row - seed[0]), abs(column - seed[1])) == 2 * k
            if on_ring and inside(xyz, row, column) and is_measured(xyz[row, column]):
                ring.append(squared_distance(xyz[seed], xyz[row, column]))
    if not ring:
        raise NoRadiusError(f'No point of the ring round {seed} is measured.')
    limit = sorted(ring)[8 * k if len(ring) == 16 * k else len(ring) // 2]
    if limit == 0:
        raise NoRadiusError(f'Half of the ring round {seed} is at the seed.')
    return limit


def ring_overflows(xyz, seed, window):
    try:
        return math.isinf(ring_limit(xyz, seed, window))
    except NoRadiusError:
        return False


def inside(xyz, row, column):
    return 0 <= row < xyz.shape[0] and 0 <= column < xyz.shape[1]


def squared_distance(initial, point):
    """In the cloud's own dtype, which the coordinates have."""
    dx, dy, dz = point[0] - initial[0], point[1] - initial[1], point[2] - initial[2]
    return (dx * dx + dy * dy) + dz * dz


# 3.2.3 The expansion.


@np.errstate(over='ignore', under='ignore')
def expand(xyz, seed, limit, window):
    """Steps (1) to (7), with a mask of the points that have joined in place of the heights in B."""
    k = window // 2
    joined = np.zeros(xyz.shape[:2], dtype=bool)
    joined[seed] = True
    v1 = [seed]
    while v1:
        v2 = []
        for initial in v1:
            for row in range(initial[0] - k, initial[0] + k + 1):
                for column in range(initial[1] - k, initial[1] + k + 1):
                    if not inside(xyz, row, column) or joined[row, column]:
                        continue
                    if not is_measured(xyz[row, column]):
                        continue
                    if squared_distance(xyz[initial], xyz[row, column]) < limit:
                        joined[row, column] = True
                        if max(abs(row - initial[0]), abs(column - initial[1])) == k:
                            v2.append((row, column))
        v1 = v2
    return joined
