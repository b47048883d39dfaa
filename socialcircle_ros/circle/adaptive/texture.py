# SPDX-License-Identifier: Apache-2.0
"""Islands that belong to the surface's own texture: many of one height, which together cover much of it.

The heights of outliers are random; an etched layer, a print or a lattice has islands of one height.
"""

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask
from socialcircle_ros.kernels.compiled import kernel

from .communities import Labelled
from .heights import RelativeHeights

LEAST_COVER = 0.015
"""Islands of one height that cover a smaller share of the measured points are outliers nonetheless."""

_LEAST_SIZE = 4
"""Points of an island; the height of a smaller one is too uncertain."""
_ALIKE = 1.35
"""Greatest ratio of the heights of islands that count as one height."""
_LEAST_NUMBER = 8
"""Number of islands of one height, as (Σ size)² / Σ size²: a few large outliers and some small ones of their
height are no texture."""
_LEAST_SHARE = 0.5
"""Share of the points of all such islands that those of one height must have."""


def islands_of_one_height(heights: RelativeHeights, islands: Mask, communities: Labelled) -> tuple[Mask, int]:
    """Find the islands that share a height above or below their surroundings.

    Args:
        heights: (H, W) float32, NaN where not measured.
        islands: (H, W) bool, points of islands and isolated points.
        communities: of these points.

    Returns:
        (H, W) bool, the points to keep after all, and the number of their islands.
    """
    texture: Mask = np.zeros(islands.shape, np.bool_)
    points, labels, count = communities
    sizes, rises = np.bincount(labels, minlength=count), _rises(heights, islands, communities)
    candidates = np.flatnonzero((sizes >= _LEAST_SIZE) & (rises != 0))
    if candidates.size < _LEAST_NUMBER:
        return texture, 0
    # Rises and falls count alike: a layer that covers half of the surface has islands on both sides.
    candidates = candidates[np.argsort(np.abs(rises[candidates]), kind='stable')]
    height = np.abs(rises[candidates])
    covered = np.concatenate([[0], np.cumsum(sizes[candidates])])
    ends = np.searchsorted(height, _ALIKE * height, 'right')
    alike = covered[ends] - covered[:-1]
    first = int(np.argmax(alike))
    number = int(ends[first]) - first
    least = max(_LEAST_SHARE * covered[-1], LEAST_COVER * np.count_nonzero(np.isfinite(heights)))
    of_one_height = sizes[candidates[first : first + number]].astype(np.float64)
    if of_one_height.sum() ** 2 < _LEAST_NUMBER * (of_one_height**2).sum() or alike[first] < least:
        return texture, 0
    texture.flat[points[np.isin(labels, candidates[first : first + number])]] = True
    return texture, number


@kernel
def _rises(heights: RelativeHeights, islands: Mask, communities: Labelled) -> npt.NDArray[np.float64]:
    """(n,) mean height of each island above the kept points that touch it, 0 where it is unknown."""
    height, width = islands.shape
    number = communities.number
    inside, inside_count = np.zeros(number), np.zeros(number, np.int64)
    outside, outside_count = np.zeros(number), np.zeros(number, np.int64)
    for index in range(communities.points.size):
        point, label = communities.points[index], communities.labels[index]
        row, column = point // width, point % width
        if not np.isnan(heights[row, column]):
            inside[label] += heights[row, column]
            inside_count[label] += 1
        for y in range(max(0, row - 1), min(height, row + 2)):
            for x in range(max(0, column - 1), min(width, column + 2)):
                if not islands[y, x] and not np.isnan(heights[y, x]):
                    outside[label] += heights[y, x]
                    outside_count[label] += 1
    rises = np.zeros(number)
    for label in range(number):
        if inside_count[label] and outside_count[label]:
            rises[label] = inside[label] / inside_count[label] - outside[label] / outside_count[label]
    return rises
