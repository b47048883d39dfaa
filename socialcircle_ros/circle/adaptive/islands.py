"""Communities that rise from (or sink into) their surroundings on all sides.

The communities are those of every height at once: the connected parts of {relief ≥ level}, nested in a max-tree
(Salembier et al. 1998; built by union-find as in Berger et al. 2007), and of {relief ≤ level} in a min-tree. How
steeply a community ends is the mean of the jumps across its border, each clipped, so that no single jump decides:
as jumps within it cancel, sum and border are sums over its points, and cost one pass for all communities.
"""

import itertools
from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask
from socialcircle_ros.compiled import kernel
from socialcircle_ros.threads import in_bands

from .jumps import NONE, UNIT, Jumps
from .relief import Relief

LARGEST = 320
"""A community of more points is a surface of its own, whatever surrounds it: a disc of 20 points across."""
STRONG = 0.93
"""An island's border is at least so steep, in the mean, of 1: every jump clipped."""
WEAK = 0.8
"""A larger community round an island belongs to it down to this steepness: its flank."""

_GROWTH = 2.5
_SURROUNDINGS = 16
_LEAST_HEIGHT = 1.0
_SMALL = 8

Score = npt.NDArray[np.float32]


def islands(relief: Relief, jumps: Jumps, measured: Mask, clip: float, scale: int) -> tuple[Mask, Score]:
    """Communities that are islands.

    Args:
        relief: (H, W) float32, as `relief_of` gives it.
        jumps: (4, H, W) int8, as `jumps_of` gives them.
        measured: (H, W) bool, the points that there are.
        clip: spreads beyond which a jump counts no more.
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
        risen = sign * relief
        risen -= sign * around
        points = np.flatnonzero((risen > _LEAST_HEIGHT) & measured)
        level = np.clip(np.rint(sign * UNIT * relief.ravel()[points]), -32767, 32767).astype(np.int16)
        order = np.argsort(-level, kind='stable')
        return _islands_above(
            points[order], level[order], jumps, -sign, round(clip * UNIT), largest, fill, alone, STRONG, WEAK
        )

    both = in_bands(lambda places: [one_side((1, -1)[place]) for place in range(2)[places]], 2, relief.size)
    (up, up_score), (down, down_score) = itertools.chain.from_iterable(both)
    return up | down, np.maximum(up_score, down_score)


@kernel
def _surroundings(relief: Any) -> Any:
    """Mean height of the area round each point: blocks, bilinear between their centres."""
    height, width = relief.shape
    side = _SURROUNDINGS
    rows, columns = (height + side - 1) // side, (width + side - 1) // side
    total, count = np.zeros((rows, columns)), np.zeros((rows, columns))
    for row in range(height):
        for column in range(width):
            total[row // side, column // side] += relief[row, column]
            count[row // side, column // side] += 1
    mean = (total / count).astype(np.float32)
    around = np.empty((height, width), np.float32)
    for row in range(height):
        down = min(max((row + 0.5) / side - 0.5, 0.0), rows - 1.0)
        above = int(down)
        down -= above
        below = min(above + 1, rows - 1)
        for column in range(width):
            right = min(max((column + 0.5) / side - 0.5, 0.0), columns - 1.0)
            before = int(right)
            right -= before
            after = min(before + 1, columns - 1)
            around[row, column] = (mean[above, before] * (1 - right) + mean[above, after] * right) * (1 - down) + (
                mean[below, before] * (1 - right) + mean[below, after] * right
            ) * down
    return around


@kernel
def _root(joined: Any, place: int) -> Any:
    while joined[place] != place:
        joined[place] = joined[joined[place]]
        place = joined[place]
    return place


@kernel
def _jump(jumps: Any, row: int, column: int, down: int, right: int) -> Any:
    """Jump from a point to a neighbour; `NONE` where there is none."""
    if down > 0 or (down == 0 and right > 0):
        direction = 0 if down == 0 else (1 if right == 0 else (2 if right > 0 else 3))
        return np.int64(jumps[direction, row, column])
    direction = 0 if down == 0 else (1 if right == 0 else (2 if right < 0 else 3))
    jump = np.int64(jumps[direction, row + down, column + right])
    return jump if jump == NONE else -jump


@kernel
def _islands_above(
    points: Any,
    level: Any,
    jumps: Any,
    outward: int,
    clip: int,
    largest: int,
    fill: float,
    alone: int,
    strong: float,
    weak: float,
) -> Any:
    """The islands among the communities of the points, highest first: a max-tree and what follows from it."""
    _, height, width = jumps.shape
    count = points.size
    place = np.full(height * width, -1, np.int32)  # of a point in the order, once it is in the tree
    parent, joined = np.empty(count, np.int32), np.empty(count, np.int32)
    area, border, steep = np.empty(count, np.int32), np.empty(count, np.int32), np.empty(count, np.int32)
    top, bottom = np.empty(count, np.int32), np.empty(count, np.int32)
    left, right = np.empty(count, np.int32), np.empty(count, np.int32)
    for here in range(count):
        point = points[here]
        row, column = point // width, point % width
        parent[here], joined[here] = here, here
        area[here], border[here], steep[here] = 1, 0, 0
        top[here], bottom[here], left[here], right[here] = row, row, column, column
        for down in range(-1, 2):
            for across in range(-1, 2):
                y, x = row + down, column + across
                if (down == 0 and across == 0) or y < 0 or x < 0 or y >= height or x >= width:
                    continue
                there = place[y * width + x]
                jump = _jump(jumps, row, column, down, across)
                if jump != NONE:
                    # Of two points of one community the jump there and the jump back cancel.
                    steep[here] += min(clip, max(-clip, outward * jump))
                    border[here] += -1 if there >= 0 else 1
                if there < 0:
                    continue
                there = _root(joined, there)
                if there != here:
                    parent[there] = here
                    joined[there] = here
        place[point] = here
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
        found.flat[points[here]] = island[node]
        best.flat[points[here]] = max(score[node], np.float32(0))
    return found, best
