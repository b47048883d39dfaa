"""Islands that are the surface's own: many of one height, which together cover much of it.

Outliers are as high as chance has it; an etched layer, a print or a lattice has islands of one height.
"""

from typing import Any

import numpy as np

from socialcircle_ros.cloud import Mask
from socialcircle_ros.kernels.compiled import kernel

from .differences import Heights

LEAST_COVER = 0.015
"""Islands of one height that cover less of the measured points are outliers nonetheless."""

_LEAST_SIZE = 4
_ALIKE = 1.35
_MANY = 8
_MOST = 0.5


def islands_of_one_height(heights: Heights, islands: Mask) -> tuple[Mask, int]:
    """The islands that share a height over or under what surrounds them.

    Args:
        heights: (H, W) float32, NaN where not measured.
        islands: (H, W) bool, points of islands and isolated points.

    Returns:
        (H, W) bool, the points to keep after all, and the number of their islands.
    """
    texture: Mask = np.zeros(islands.shape, np.bool_)
    points = np.flatnonzero(islands)
    label, sizes, rises = _measured_islands(heights, islands, points)
    least = LEAST_COVER * np.count_nonzero(np.isfinite(heights))
    candidates = np.flatnonzero((sizes >= _LEAST_SIZE) & (rises != 0))
    if candidates.size < _MANY:
        return texture, 0
    # Up or down: of a layer that covers half of the surface both sides have islands.
    candidates = candidates[np.argsort(np.abs(rises[candidates]), kind='stable')]
    height = np.abs(rises[candidates])
    covered = np.concatenate([[0], np.cumsum(sizes[candidates])])
    ends = np.searchsorted(height, _ALIKE * height, 'right')
    alike = covered[ends] - covered[:-1]
    first = int(np.argmax(alike))
    number = int(ends[first]) - first
    if number < _MANY or alike[first] < max(_MOST * covered[-1], least):
        return texture, 0
    texture.flat[points[np.isin(label, candidates[first : first + number])]] = True
    return texture, number


@kernel
def _measured_islands(heights: Any, islands: Any, points: Any) -> Any:
    """Label of each point, and of each island its size and its rise over the kept points that touch it."""
    height, width = islands.shape
    place = np.full(height * width, -1, np.int32)
    for index in range(points.size):
        place[points[index]] = index
    label, waiting = np.full(points.size, -1, np.int32), np.empty(points.size, np.int32)
    sizes, rises = np.zeros(points.size, np.int64), np.zeros(points.size, np.float64)
    number = 0
    for start in range(points.size):
        if label[start] >= 0:
            continue
        label[start], waiting[0], count, done = number, start, 1, 0
        inside, within, outside, round_it = 0.0, 0, 0.0, 0
        while done < count:
            point = points[waiting[done]]
            done += 1
            row, column = point // width, point % width
            if not np.isnan(heights[row, column]):
                inside += heights[row, column]
                within += 1
            for y in range(max(0, row - 1), min(height, row + 2)):
                for x in range(max(0, column - 1), min(width, column + 2)):
                    there = place[y * width + x]
                    if there >= 0 and label[there] < 0:
                        label[there] = number
                        waiting[count] = there
                        count += 1
                    elif there < 0 and not np.isnan(heights[y, x]):
                        outside += heights[y, x]
                        round_it += 1
        sizes[number] = count
        if within and round_it:
            rises[number] = inside / within - outside / round_it
        number += 1
    return label, sizes[:number], rises[:number]
