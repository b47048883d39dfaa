"""Communities that rise from (or sink into) their surroundings on all sides.

The communities are those of every height at once: the connected parts of {relief ≥ level}, nested in a max-tree
(Salembier et al. 1998; built by union-find as in Berger et al. 2007), and of {relief ≤ level} in a min-tree.
How steeply a community ends is the mean of the differences across its border, each clipped, so that no single
one decides: as differences within it cancel, sum and border are sums over its points, and cost one pass for all
communities.
"""

import itertools
from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask
from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.kernels.union_find import root_of

from .differences import NONE, UNIT, Differences, interpolated, widened
from .relief import Relief

LARGEST = 320
"""A community of more points is a surface of its own, whatever surrounds it: a disc of 20 points across."""
WEAKER = 0.1
"""A larger community round an island belongs to it if it is less steep by this at most: its flank."""

_GROWTH = 2.5
_SURROUNDINGS = 16
_LEAST_HEIGHT = 1.0
_SMALL = 8

Score = npt.NDArray[np.float32]


def islands(
    relief: Relief, differences: Differences, measured: Mask, clip: float, strong: float, scale: int
) -> tuple[Mask, Score]:
    """Communities that are islands.

    Args:
        relief: (H, W) float32, as `relief_of` gives it.
        differences: (4, H, W) int8, as `normalised_differences` gives them.
        measured: (H, W) bool, the points that there are.
        clip: spreads beyond which a difference counts no more.
        strong: an island's border is steeper than this in the mean, where 1 is every difference clipped.
        scale: points of the cloud along a side of a point here.

    Returns:
        (H, W) bool, the points of islands, and (H, W) float32: the steepness, 0 to 1, of the steepest community
        that a point belongs to, not larger than an island may be; 0 where it belongs to none that ends steeply.
    """
    around = _surroundings(relief)
    largest = max(LARGEST // scale**2, 4)
    fill = 0.3 if scale == 1 else 0.45
    alone = 4 if scale == 1 else 2

    def one_side(sign: int) -> Any:
        points, level = _risen(relief, around, measured, sign)
        order = np.argsort(-level, kind='stable')
        return _islands_above(
            points,
            level,
            order,
            differences,
            -sign,
            round(clip * UNIT),
            largest,
            fill,
            alone,
            strong,
            strong - WEAKER,
        )

    both = in_bands(lambda places: [one_side((1, -1)[place]) for place in range(2)[places]], 2, relief.size)
    (up, up_score), (down, down_score) = itertools.chain.from_iterable(both)
    return up | down, np.maximum(up_score, down_score)


def _surroundings(relief: Relief) -> Relief:
    """Mean height of the area round each point: blocks, bilinear between their centres."""
    height, width = relief.shape
    side = _SURROUNDINGS
    means = in_bands(lambda rows: _means(relief, rows.start, rows.stop), -(-height // side), side * width)
    wide = widened(np.concatenate(means), side, width)
    around = np.empty_like(relief)
    in_bands(lambda rows: _fill(wide, rows.start, rows.stop, around), height, width)
    return around


@kernel
def _means(relief: Any, first: int, end: int) -> Any:
    """Mean of each block of some rows of blocks."""
    height, width = relief.shape
    side = _SURROUNDINGS
    columns = (width + side - 1) // side
    means, total = np.empty((end - first, columns), np.float32), np.empty(columns)
    for band in range(first, end):
        total[:] = 0
        top, bottom = band * side, min((band + 1) * side, height)
        for row in range(top, bottom):
            for place in range(columns):
                for column in range(place * side, min((place + 1) * side, width)):
                    total[place] += relief[row, column]
        for place in range(columns):
            count = (bottom - top) * (min((place + 1) * side, width) - place * side)
            means[band - first, place] = total[place] / count
    return means


@kernel
def _fill(wide: Any, first: int, end: int, around: Any) -> None:
    for row in range(first, end):
        interpolated(wide, _SURROUNDINGS, row, around[row])


@kernel
def _risen(relief: Any, around: Any, measured: Any, sign: int) -> Any:
    """Points that rise from their surroundings (or sink, where the sign is -1), row by row, and their levels."""
    height, width = relief.shape
    points, level = np.empty(relief.size, np.int32), np.empty(relief.size, np.int16)
    count = 0
    for row in range(height):
        for column in range(width):
            rise = sign * (relief[row, column] - around[row, column])
            if rise > _LEAST_HEIGHT and measured[row, column]:
                points[count] = row * width + column
                rounded = np.rint(np.float32(sign * UNIT) * relief[row, column])
                level[count] = np.int16(min(max(rounded, np.float32(-32767)), np.float32(32767)))
                count += 1
    return points[:count], level[:count]


@kernel
def _neighbours(points: Any, rank: Any, differences: Any, outward: int, clip: int) -> Any:
    """By rank: the higher neighbours among the points, and what a point adds to the steepness and to the border.

    The higher neighbours are ended by -1. Differences are looked up row by row, where they lie close together.
    """
    _, height, width = differences.shape
    count = points.size
    place = np.full((height, width), count, np.int32)  # the rank of a point, `count` of all others
    for index in range(count):
        place[points[index] // width, points[index] % width] = rank[index]
    higher = np.empty((count, 9), np.int32)
    steep, border = np.empty(count, np.int32), np.empty(count, np.int32)
    for index in range(count):
        row, column, here = points[index] // width, points[index] % width, rank[index]
        total, ends, found = 0, 0, 0
        for direction in range(4):
            down, right = (0 if direction == 0 else 1), (1, 0, 1, -1)[direction]
            for way in (1, -1):
                y, x = row + way * down, column + way * right
                if y < 0 or x < 0 or y >= height or x >= width:
                    continue
                difference = int(differences[direction, row, column] if way > 0 else differences[direction, y, x])
                there = place[y, x]
                if difference != NONE:
                    # Of two points of one community the difference there and the difference back cancel.
                    total += min(clip, max(-clip, outward * way * difference))
                    ends += -1 if there < here else 1
                if there < here:
                    higher[here, found] = there
                    found += 1
        higher[here, found] = -1
        steep[here], border[here] = total, ends
    return higher, steep, border


@kernel
def _islands_above(
    points: Any,
    level: Any,
    order: Any,
    differences: Any,
    outward: int,
    clip: int,
    largest: int,
    fill: float,
    alone: int,
    strong: float,
    weak: float,
) -> Any:
    """The islands among the communities of the points, highest first: a max-tree and what follows from it."""
    _, height, width = differences.shape
    count = points.size
    rank = np.empty(count, np.int32)
    for here in range(count):
        rank[order[here]] = here
    higher, steep, border = _neighbours(points, rank, differences, outward, clip)
    points, level = points[order], level[order]
    parent, joined, area = np.empty(count, np.int32), np.empty(count, np.int32), np.empty(count, np.int32)
    top, bottom = np.empty(count, np.int32), np.empty(count, np.int32)
    left, right = np.empty(count, np.int32), np.empty(count, np.int32)
    for here in range(count):
        row, column = points[here] // width, points[here] % width
        parent[here], joined[here], area[here] = here, here, 1
        top[here], bottom[here], left[here], right[here] = row, row, column, column
        for neighbour in higher[here]:
            if neighbour < 0:
                break
            there = root_of(joined, neighbour)
            if there != here:
                parent[there] = here
                joined[there] = here
    # Points of one community and one height have one node: the last of them.
    for here in range(count - 1, -1, -1):
        up = parent[here]
        if level[parent[up]] == level[up]:
            parent[here] = parent[up]
    for here in range(count):
        up = parent[here]
        if up != here:
            area[up] += area[here]
            border[up] += border[here]
            steep[up] += steep[here]
            top[up], bottom[up] = min(top[up], top[here]), max(bottom[up], bottom[here])
            left[up], right[up] = min(left[up], left[here]), max(right[up], right[here])
    score = np.empty(count, np.float32)
    island, overflow = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    core = np.zeros(count, np.int32)  # points of the largest strong community below, where the flank is unbroken
    for here in range(count):
        up = parent[here]
        if up != here and level[up] == level[here]:
            continue
        score[here] = steep[here] / (max(border[here], 1) * clip)
        extent = max(bottom[here] - top[here], right[here] - left[here]) + 1
        if extent > alone and area[here] < fill * extent * extent:
            score[here] = min(score[here], 0.0)  # a scratch or a ridge, no spot
        if area[here] > largest:
            core[here] = 0
            overflow[here] = score[here] > weak and area[here] <= 2 * largest
        elif score[here] > strong:
            island[here] = True
            core[here] = area[here]
        elif core[here] > 0 and score[here] > weak and area[here] <= _GROWTH * core[here]:
            island[here] = True
        else:
            core[here] = 0
        if island[here] and up != here:
            core[up] = max(core[up], core[here])
    found, best = np.zeros((height, width), np.bool_), np.zeros((height, width), np.float32)
    for here in range(count - 1, -1, -1):
        up = parent[here]
        if up == here or level[up] != level[here]:
            if up != here and overflow[up] and score[here] > weak and area[here] > _SMALL:
                overflow[here] = True  # the tip of something larger that is as steep further down
            if overflow[here]:
                island[here] = False
            if area[here] > largest:
                score[here] = 0.0
            elif up != here:
                island[here] = island[here] or island[up]
                score[here] = max(score[here], score[up])
        node = here if up == here or level[up] != level[here] else up
        row, column = points[here] // width, points[here] % width
        found[row, column] = island[node]
        best[row, column] = max(score[node], np.float32(0))
    return found, best
