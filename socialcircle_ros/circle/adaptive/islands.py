# SPDX-License-Identifier: Apache-2.0
"""Islands: communities that rise from (or sink into) their surroundings on all sides.

The communities are those of every height at once: the connected parts of {relief ≥ level}, nested in a max-tree
(P. Salembier, A. Oliveras, L. Garrido, Antiextensive connected operators for image and sequence processing, 1998,
https://doi.org/10.1109/83.663500), and of {relief ≤ level} in a min-tree. Union-find builds the tree (C. Berger et
al., Effective component tree computation with application to pattern recognition in astronomical imaging, 2007,
https://doi.org/10.1109/ICIP.2007.4379949).

The steepness of a community is the mean of the normalised differences across its border. Each is clipped, so
that no single difference decides. In the sum over all points of a community the differences within it cancel.
Both the sum and the border length are therefore sums over points, and one pass measures all communities.
"""

import itertools
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask
from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.kernels.union_find import root_of

from .blocks import BlockRows, interpolate_columns, interpolate_row
from .differences import DOWN, MISSING, RIGHT, STEPS_PER_SPREAD, Differences
from .relief import Relief

LARGEST = 640
"""Points of the largest island: a disc of 28 points across. A larger community is a surface of its own."""
LARGEST_SHARE = 50
"""At reduced resolution an island is at most one of so many parts of the cloud: on a small cloud, its hills are no
larger than blurred outliers."""
LEAST_RISE = 1.0
"""Only points that rise further above their surroundings belong to communities, in spreads."""
FLANK = 0.1
"""A larger community around an island is its flank, and belongs to it, if it is less steep by this at most."""

_GROWTH = 2.5
"""Greatest ratio of the points of an island with its flank to those without."""
_SURROUNDINGS = 16
"""Side of the blocks of the surroundings, in points: the mean relief of a block is their height."""
_SMALL = 8
"""A community of at most this many points remains an island on the tip of one that is too large."""

Steepness = npt.NDArray[np.float32]
"""float32, -1 to 1: 1 where every difference across the border is clipped."""
_Labels = npt.NDArray[np.int32]
_Levels = npt.NDArray[np.int16]


class _Criteria(NamedTuple):
    """When a community is an island.

    Attributes:
        clip: largest difference that counts, in steps of the normalised differences.
        steep: an island is steeper.
        flank: the flank of an island is steeper.
        largest: points of the largest island.
        narrow: a community that is no wider than this has no shape, in points.
        fill: least share of the square of its extent that a wider community fills; else it is a scratch or a
            ridge.
        rise: its points rise further above their surroundings, in spreads.
    """

    clip: int
    steep: float
    flank: float
    largest: int
    narrow: int
    fill: float
    rise: float


class _Tree(NamedTuple):
    """A max-tree of n points in descending order of level; all arrays are (n,).

    A node is a community: a point and its descendants. Of the points with the same community and level the last
    one is the node, and the others have it as their parent.

    Attributes:
        points: int32, numbered in row order.
        level: int16.
        parent: int32, index of the node of the next larger community; a root is its own.
        area: int32, points of the community.
        steepness: float32, of the community; undefined where the point is no node.
    """

    points: _Labels
    level: _Levels
    parent: _Labels
    area: _Labels
    steepness: Steepness


def find_islands(
    relief: Relief,
    differences: Differences,
    measured: Mask,
    clip: float,
    steep: float,
    reduction: int,
    rise: float = LEAST_RISE,
) -> tuple[Mask, Steepness]:
    """Find the communities that are islands.

    Args:
        relief: (H, W) float32, as `relief_of` gives it.
        differences: (4, H, W) int8, as `normalised_differences` gives them.
        measured: (H, W) bool, the points that exist.
        clip: a larger normalised difference counts as this one, in spreads.
        steep: the steepness of an island is above this.
        reduction: factor by which the rows and columns of the cloud are reduced: 1, 2 or 4.
        rise: the points of an island rise further above their surroundings, in spreads.

    Returns:
        (H, W) bool, the points of islands, and (H, W) float32, the steepness, 0 to 1, of the steepest community
        that a point belongs to and that is not larger than an island may be; 0 where there is none.
    """
    around = _surroundings(relief)
    full = reduction == 1
    largest = LARGEST if full else min(LARGEST // reduction**2, relief.size // LARGEST_SHARE)
    criteria = _Criteria(
        clip=round(clip * STEPS_PER_SPREAD),
        steep=steep,
        flank=steep - FLANK,
        largest=max(largest, 4),
        narrow=4 if full else 2,
        fill=0.3 if full else 0.45,
        rise=rise,
    )

    def find(sides: slice) -> list[tuple[Mask, Steepness]]:
        return [_one_sided(relief, around, differences, measured, sign, criteria) for sign in [1, -1][sides]]

    both = in_bands(find, 2, relief.size)
    (above, above_steepness), (below, below_steepness) = itertools.chain.from_iterable(both)
    return above | below, np.maximum(above_steepness, below_steepness)


def _surroundings(relief: Relief) -> Relief:
    """Mean height of the area around each point: the means of blocks, bilinear between their centres."""
    height, width = relief.shape
    side = _SURROUNDINGS
    means = in_bands(lambda rows: _block_means(relief, rows.start, rows.stop), -(-height // side), side * width)
    wide = interpolate_columns(np.concatenate(means), side, width)
    around = np.empty_like(relief)
    in_bands(lambda rows: _interpolate(wide, rows.start, rows.stop, around), height, width)
    return around


def _one_sided(
    relief: Relief, around: Relief, differences: Differences, measured: Mask, sign: int, criteria: _Criteria
) -> tuple[Mask, Steepness]:
    """Find the islands that rise (`sign` 1) or sink (-1); otherwise as `find_islands`."""
    points, level = _risen(relief, around, measured, sign, criteria.rise)
    order = np.argsort(-level, kind='stable')
    rank = np.empty(order.size, np.int32)
    rank[order] = np.arange(order.size, dtype=np.int32)
    higher, sums, borders = _neighbours(points, rank, differences, -sign, criteria.clip)
    points, level = points[order], level[order]
    parent = _max_tree(level, higher)
    area, steepness = _measure(points, parent, sums, borders, relief.shape[1], criteria)
    tree = _Tree(points, level, parent, area, steepness)
    island, overflow = _judge(tree, criteria)
    found, best = np.zeros(relief.shape, np.bool_), np.zeros(relief.shape, np.float32)
    _mark(tree, island, overflow, criteria, found, best)
    return found, best


@kernel
def _block_means(relief: Relief, first: int, end: int) -> Relief:
    """(end - first, w) float32: mean of each block in some rows of blocks."""
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
def _interpolate(wide: BlockRows, first: int, end: int, around: Relief) -> None:
    for row in range(first, end):
        interpolate_row(wide, _SURROUNDINGS, row, around[row])


@kernel
def _risen(relief: Relief, around: Relief, measured: Mask, sign: int, least: float) -> tuple[_Labels, _Levels]:
    """Points that rise more than `least` (or sink, where `sign` is -1) in row order, and their levels."""
    height, width = relief.shape
    points, level = np.empty(relief.size, np.int32), np.empty(relief.size, np.int16)
    count = 0
    for row in range(height):
        for column in range(width):
            rise = sign * (relief[row, column] - around[row, column])
            if rise > least and measured[row, column]:
                points[count] = row * width + column
                rounded = np.rint(np.float32(sign * STEPS_PER_SPREAD) * relief[row, column])
                level[count] = np.int16(min(max(rounded, np.float32(-32767)), np.float32(32767)))
                count += 1
    return points[:count], level[:count]


@kernel
def _neighbours(
    points: _Labels, rank: _Labels, differences: Differences, outward: int, clip: int
) -> tuple[_Labels, _Labels, _Labels]:
    """Find the neighbours of lower rank, and what each point adds to the sums of its communities.

    The points come in row order, because their differences then lie close together; the results are by rank.

    Args:
        points: (n,), numbered in row order.
        rank: (n,) rank of each, 0 for the highest.
        differences: (4, H, W) int8.
        outward: sign of the differences that lead out of a community: -1 for one that rises.
        clip: largest difference that counts.

    Returns:
        (n, 9) ranks of the higher neighbours among the points, ended by -1; (n,) what a point adds to the sum of
        the differences across the border; (n,) what it adds to the length of the border.
    """
    _, height, width = differences.shape
    count = points.size
    place = np.full((height, width), count, np.int32)  # rank of a point; `count` where there is none
    for index in range(count):
        place[points[index] // width, points[index] % width] = rank[index]
    higher = np.empty((count, 9), np.int32)
    sums, borders = np.empty(count, np.int32), np.empty(count, np.int32)
    for index in range(count):
        row, column, here = points[index] // width, points[index] % width, rank[index]
        total, ends, found = 0, 0, 0
        for direction in range(4):
            down, right = DOWN[direction], RIGHT[direction]
            for way in (1, -1):
                y, x = row + way * down, column + way * right
                if y < 0 or x < 0 or y >= height or x >= width:
                    continue
                difference = int(differences[direction, row, column] if way > 0 else differences[direction, y, x])
                there = place[y, x]
                if difference != MISSING:
                    # Between two points of one community the differences there and back cancel.
                    total += min(clip, max(-clip, outward * way * difference))
                    ends += -1 if there < here else 1
                if there < here:
                    higher[here, found] = there
                    found += 1
        higher[here, found] = -1
        sums[here], borders[here] = total, ends
    return higher, sums, borders


@kernel
def _max_tree(level: _Levels, higher: _Labels) -> _Labels:
    """Build the tree of points in descending order of level; return the parents."""
    count = level.size
    parent, joined = np.empty(count, np.int32), np.empty(count, np.int32)
    for here in range(count):
        parent[here], joined[here] = here, here
        for neighbour in higher[here]:
            if neighbour < 0:
                break
            there = root_of(joined, neighbour)
            if there != here:
                parent[there] = here
                joined[there] = here
    # Points of one community and level share a node: the last of them.
    for here in range(count - 1, -1, -1):
        up = parent[here]
        if level[parent[up]] == level[up]:
            parent[here] = parent[up]
    return parent


@kernel
def _measure(
    points: _Labels, parent: _Labels, sums: _Labels, borders: _Labels, width: int, criteria: _Criteria
) -> tuple[_Labels, Steepness]:
    """Measure the area and steepness of each node; `sums` and `borders` become those of the communities."""
    count = points.size
    area, steepness = np.ones(count, np.int32), np.empty(count, np.float32)
    top, left = np.empty(count, np.int32), np.empty(count, np.int32)
    bottom, right = np.empty(count, np.int32), np.empty(count, np.int32)
    for here in range(count):
        row, column = points[here] // width, points[here] % width
        top[here], bottom[here], left[here], right[here] = row, row, column, column
    for here in range(count):
        up = parent[here]
        if up != here:
            area[up] += area[here]
            borders[up] += borders[here]
            sums[up] += sums[here]
            top[up], bottom[up] = min(top[up], top[here]), max(bottom[up], bottom[here])
            left[up], right[up] = min(left[up], left[here]), max(right[up], right[here])
    for here in range(count):
        steepness[here] = sums[here] / (max(borders[here], 1) * criteria.clip)
        extent = max(bottom[here] - top[here], right[here] - left[here]) + 1
        if extent > criteria.narrow and area[here] < criteria.fill * extent * extent:
            steepness[here] = min(steepness[here], 0.0)
    return area, steepness


@kernel
def _is_node(tree: _Tree, here: int) -> bool:
    up = tree.parent[here]
    return bool(up == here or tree.level[up] != tree.level[here])


@kernel
def _judge(tree: _Tree, criteria: _Criteria) -> tuple[Mask, Mask]:
    """Decide from the highest node down which are islands, and which overflow.

    A node overflows that is nearly as steep as an island, but too large to be one.

    Returns:
        (n,) bool, islands, and (n,) bool, overflowing nodes; False where a point is no node.
    """
    count = tree.points.size
    island, overflow = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    core = np.zeros(count, np.int32)  # area of the largest steep community above, while the flank is unbroken
    for here in range(count):
        if not _is_node(tree, here):
            continue
        up, area, steepness = tree.parent[here], tree.area[here], tree.steepness[here]
        if area > criteria.largest:
            core[here] = 0
            overflow[here] = steepness > criteria.flank and area <= 2 * criteria.largest
        elif steepness > criteria.steep:
            island[here] = True
            core[here] = area
        elif core[here] > 0 and steepness > criteria.flank and area <= _GROWTH * core[here]:
            island[here] = True
        else:
            core[here] = 0
        if island[here] and up != here:
            core[up] = max(core[up], core[here])
    return island, overflow


@kernel
def _mark(tree: _Tree, island: Mask, overflow: Mask, criteria: _Criteria, found: Mask, best: Steepness) -> None:
    """Write to each point whether it belongs to an island, and the steepest community that it belongs to.

    Goes from the lowest node up, so that a node inherits from its parent; changes `island`, `overflow` and the
    steepness of the tree. `found` and `best`, (H, W), come as 0.
    """
    width = found.shape[1]
    parent, steepness = tree.parent, tree.steepness
    for here in range(tree.points.size - 1, -1, -1):
        up, node = parent[here], here
        if _is_node(tree, here):
            area = tree.area[here]
            if up != here and overflow[up] and steepness[here] > criteria.flank and area > _SMALL:
                overflow[here] = True  # the tip of something too large, and as steep further down
            if overflow[here]:
                island[here] = False
            if area > criteria.largest:
                steepness[here] = 0.0
            elif up != here:
                island[here] = island[here] or island[up]
                steepness[here] = max(steepness[here], steepness[up])
        else:
            node = up
        row, column = tree.points[here] // width, tree.points[here] % width
        found[row, column] = island[node]
        best[row, column] = max(steepness[node], np.float32(0))
