# SPDX-License-Identifier: Apache-2.0
"""The adaptive mode point by point: the reference for `socialcircle_ros.circle.adaptive`.

Plain loops that follow the docstrings, and share nothing with the compiled code, not even its constants. Heights
and differences are float32 as there, so that results are the same bit for bit.
"""

import itertools
from typing import NamedTuple

import numpy as np

MISSING, STEPS_PER_SPREAD = -128, 16
TOUCH, SIGNIFICANT = 3.5, 2.5  # spreads
FLANK, LARGEST, LEAST_COVER = 0.1, 640, 0.015

DIRECTIONS = ((0, 1), (1, 0), (1, 1), (1, -1))
"""Rows and columns to the neighbour on the right, below, below right and below left."""
AROUND = [(down, right) for down in (-1, 0, 1) for right in (-1, 0, 1) if (down, right) != (0, 0)]


class Spread(NamedTuple):
    slopes: np.ndarray
    by_direction: np.ndarray
    by_tile: np.ndarray
    predicted: bool


def places(shape):
    return itertools.product(range(shape[0]), range(shape[1]))


def inside(row, column, shape):
    return 0 <= row < shape[0] and 0 <= column < shape[1]


def neighbours(row, column, shape):
    return [(row + i, column + j) for i, j in AROUND if inside(row + i, column + j, shape)]


# Differences


def median(values):
    return np.float32(np.median(np.array(values, np.float32)))


def core_spread(sizes):
    """Standard deviation of a normal distribution, from the core of its absolute values."""
    sizes = sorted(map(float, sizes))
    if not sizes:
        return 0.0
    spread = sizes[int(0.2 * (len(sizes) - 1))] / 0.2533
    for _ in range(8):
        core = [size for size in sizes if size <= 2.5 * spread]
        if spread == 0 or not core:
            break
        spread = core[(len(core) - 1) // 2] / 0.6647
    return spread


def median_of_blocks(blocks, otherwise):
    smooth = np.empty_like(blocks)
    for row, column in places(blocks.shape):
        known = [blocks[place] for place in [(row, column), *neighbours(row, column, blocks.shape)]]
        known = [value for value in known if not np.isnan(value)]
        smooth[row, column] = median(known) if known else otherwise
    return smooth


def interpolated(blocks, side, row, column):
    """Bilinear between the centres of blocks, constant beyond the outermost."""
    rows, columns = blocks.shape
    down = min(max((row + 0.5) / side - 0.5, 0.0), rows - 1.0)
    right = min(max((column + 0.5) / side - 0.5, 0.0), columns - 1.0)
    above, before = int(down), int(right)
    below, after = min(above + 1, rows - 1), min(before + 1, columns - 1)
    down, right = down - above, right - before
    upper = float(blocks[above, before]) * (1 - right) + float(blocks[above, after]) * right
    lower = float(blocks[below, before]) * (1 - right) + float(blocks[below, after]) * right
    return np.float32(upper * (1 - down) + lower * down)


def block_slopes(heights):
    height, width = heights.shape
    slopes = np.full((2, -(-height // 8), -(-width // 8)), np.nan, np.float32)
    for axis, (down, right) in enumerate([(0, 1), (1, 0)]):
        for row, column in places(slopes.shape[1:]):
            differences = [
                heights[y + down, x + right] - heights[y, x]
                for y in range(8 * row, 8 * row + 8, 2)
                for x in range(8 * column, 8 * column + 8)
                if inside(y + down, x + right, heights.shape)
            ]
            differences = [difference for difference in differences if not np.isnan(difference)]
            if len(differences) >= 8:
                slopes[axis, row, column] = median(differences)
    return np.stack([median_of_blocks(slopes[0], 0.0), median_of_blocks(slopes[1], 0.0)])


def raw_difference(heights, slopes, row, column, direction, predicted):
    """Difference to a neighbour in the cloud's unit; NaN where there is none."""
    down, right = DIRECTIONS[direction]
    if not inside(row + down, column + right, heights.shape):
        return np.float32(np.nan)
    line = [(row + step * down, column + step * right) for step in range(-2, 4)]
    if predicted and all(inside(*place, heights.shape) for place in line):
        values = [heights[place] for place in line]
        if not np.isnan(values).any():
            differences = [after - before for before, after in itertools.pairwise(values)]
            return differences[2] - sorted(differences)[2]
    slope = np.float32(right) * interpolated(slopes[0], 8, row, column) + np.float32(down) * interpolated(
        slopes[1], 8, row, column
    )
    return heights[row + down, column + right] - heights[row, column] - slope


def raw_differences(heights, slopes, direction, predicted):
    """The differences that exist."""
    found = [raw_difference(heights, slopes, *place, direction, predicted) for place in places(heights.shape)]
    return [difference for difference in found if not np.isnan(difference)]


def least_spread(heights):
    """The step that heights are stored in, or the resolution of float32 at their height."""
    known = heights[np.isfinite(heights)]
    middle, high = np.quantile(np.abs(known), [0.5, 0.9]) if known.size else (0, 0)
    rounding, same = (float(np.spacing(np.float32(each))) for each in (middle, high))
    return max(
        quantum(known, 0), quantum(known, 4 * same), rounding, STEPS_PER_SPREAD / float(np.finfo(np.float32).max)
    )


def quantum(known, same):
    """Median step from level to level, where neighbouring heights of a level differ by `same` at most."""
    levels, counts = [], []
    before = -np.inf
    for height in np.sort(known.astype(float)):
        if height - before > same:
            levels.append(height)
            counts.append(0)
        counts[-1] += 1
        before = height
    stored = len(levels) > 1 and max(counts) <= 0.98 * known.size
    return float(np.median(np.diff(levels))) if stored else 0.0


def quantisation_step(heights):
    """The step that explains the second differences along lines; of at most 8192 points, all of them."""
    return max(step_of([line for line in lines if len(line) > 2]) for lines in (heights, heights.T))


def step_of(lines):
    """The least candidate of which the second differences, less their median, are multiples."""
    curves = [
        (c - b) - (b - a)
        for line in lines
        for a, b, c in zip(line[:-2].astype(float), line[1:-1].astype(float), line[2:].astype(float), strict=True)
    ]
    curves = sorted(each for each in curves if np.isfinite(each))
    if len(curves) < 50:
        return 0.0
    sizes = sorted(abs(each - curves[len(curves) // 2]) for each in curves)
    known = [abs(each) for line in lines for each in line if np.isfinite(each)]
    rounding = 4 * float(np.spacing(np.float32(np.quantile(np.array(known, np.float32), 0.9))))
    above = [each for each in sizes if each > rounding]
    steps = []
    for quantile in (0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95) if above else ():
        step = above[int(quantile * (len(above) - 1))]
        large = [each / step for each in sizes if each >= step / 2]
        small = [each for each in sizes if each < step / 2]
        off = 1 / 256 + rounding / step
        multiples = [each for each in large if abs(each - round(each)) <= off]
        zeros = [each for each in small if each <= off * step]
        is_step = len(multiples) >= 0.8 * len(large) > 0.8 * 0.23 * len(sizes) and len(zeros) >= 0.9 * len(small)
        if step > 10 * rounding and is_step:
            steps.append(step)
    return min(steps, default=0.0)


def estimate_spread(heights, tile, may_predict):
    """The spread of a cloud of less than 120,000 points, of which every row is sampled."""
    slopes = block_slopes(heights)
    samples = [raw_differences(heights, slopes, direction, False) for direction in range(4)]
    predicted = False
    if may_predict:
        beside = [raw_differences(heights, slopes, direction, True) for direction in range(4)]
        predicted = typical(beside) < 0.5 * typical(samples)
        if predicted:
            samples = [[difference for difference in differences if difference != 0] for differences in beside]
    least = least_spread(heights)
    spreads = np.array([max(core_spread(np.abs(differences)), least) for differences in samples])
    tiles = np.full((-(-heights.shape[0] // tile), -(-heights.shape[1] // tile)), np.nan, np.float32)
    for row, column in places(tiles.shape):
        sizes = [
            abs(float(raw_difference(heights, slopes, y, x, direction, predicted))) / spreads[direction]
            for y in range(row * tile, min((row + 1) * tile, heights.shape[0]), 3)
            for x in range(column * tile, min((column + 1) * tile, heights.shape[1]))
            for direction in range(2)
        ]
        sizes = [np.float32(size) for size in sizes if not np.isnan(size) and not (predicted and size == 0)]
        if len(sizes) >= 2 * tile * ((tile + 2) // 3) // 4:
            tiles[row, column] = core_spread(sizes)
    tiles = np.maximum(tiles, np.float32(max(0.5, least / spreads.min())))
    return Spread(slopes, spreads, np.fmax(median_of_blocks(tiles, 1.0), tiles), predicted)


def typical(samples):
    return np.mean(
        [float(np.median(np.abs(np.array(differences)))) if differences else 0.0 for differences in samples]
    )


def normalised_differences(heights, spread, tile):
    differences = np.empty((4, *heights.shape), np.int8)
    for direction, (row, column) in itertools.product(range(4), places(heights.shape)):
        raw = raw_difference(heights, spread.slopes, row, column, direction, spread.predicted)
        steps = np.float32(STEPS_PER_SPREAD / spread.by_direction[direction])
        difference = raw * steps / interpolated(spread.by_tile, tile, row, column)
        differences[direction, row, column] = MISSING if np.isnan(raw) else np.rint(np.clip(difference, -127, 127))
    return differences


def difference_between(differences, here, there):
    """Steps from a point up to its neighbour; None where there is no difference."""
    step = there[0] - here[0], there[1] - here[1]
    if step in DIRECTIONS:
        difference = int(differences[DIRECTIONS.index(step)][here])
    else:
        difference = -int(differences[DIRECTIONS.index((-step[0], -step[1]))][there])
    return None if abs(difference) == -MISSING else difference


# Isolated points


def isolated_points(differences, touch=TOUCH * STEPS_PER_SPREAD):
    shape = differences.shape[1:]
    isolated = np.zeros(shape, bool)
    for place in places(shape):
        around = [difference_between(differences, place, other) for other in neighbours(*place, shape)]
        around = [difference for difference in around if difference is not None]
        above = sum(difference >= touch for difference in around)
        below = sum(difference <= -touch for difference in around)
        touching = len(around) - above - below
        most = 1 if len(around) >= 6 else 0
        isolated[place] = len(around) >= 3 and touching <= most and abs(above - below) >= len(around) / 2
    return isolated


def with_holes_filled(heights, holes):
    filled = np.where(holes, np.float32(np.nan), heights)
    for _ in range(6):
        before = filled.copy()
        for place in map(tuple, np.argwhere(holes & np.isnan(before))):
            around = [float(before[other]) for other in neighbours(*place, heights.shape)]
            around = [value for value in around if not np.isnan(value)]
            if len(around) >= 3:
                filled[place] = sum(around) / len(around)
    return filled


# Optics


def beyond_tolerance(heights, found, limit):
    """Points within two points of an outlier that differ from every fourth point, up to eight points away."""
    surface, beyond = with_holes_filled(heights, found), np.zeros(found.shape, bool)
    height, width = found.shape
    for row, column in places(found.shape):
        if (
            np.isnan(heights[row, column])
            or not found[max(row - 2, 0) : row + 3, max(column - 2, 0) : column + 3].any()
        ):
            continue
        up = 4 * min(2, row // 4, (height - 1 - row) // 4)
        left = 4 * min(2, column // 4, (width - 1 - column) // 4)
        around = surface[row - up : row + up + 1 : 4, column - left : column + left + 1 : 4]
        around = around[~np.isnan(around)]
        beyond[row, column] = around.size == 0 or abs(heights[row, column] - median(around)) > np.float32(limit)
    return beyond


def beside_walls(heights, found, limit):
    """Points next to a step along a row or column that is larger than the differences beside it."""
    surface = with_holes_filled(heights, found | np.isnan(heights))
    beside = np.zeros(found.shape, bool)
    for turned, marked in ((surface, beside), (surface.T, beside.T)):
        for row, line in enumerate(turned):
            differences = np.pad(np.diff(line), 2, mode='edge') if line.size > 1 else []
            for column in range(line.size - 1):
                five = differences[column : column + 5]
                step = five[2] - median(five)
                if not np.isnan(five).any() and min(abs(five[2]), abs(step)) > np.float32(limit):
                    marked[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 3] = True
    return beside & ~np.isnan(heights)


# Relief


def wanted_differences(differences):
    """Sum of the differences to the four neighbours in a surface of the significant differences alone."""
    shape = differences.shape[1:]
    wanted = np.zeros(shape)
    for place in places(shape):
        for down, right in ((0, 1), (0, -1), (1, 0), (-1, 0)):
            other = place[0] + down, place[1] + right
            difference = difference_between(differences, place, other) if inside(*other, shape) else None
            if difference is not None and abs(difference) > SIGNIFICANT * STEPS_PER_SPREAD:
                wanted[place] += difference / STEPS_PER_SPREAD
    return wanted


def relief(differences):
    """The least-squares surface of mean 0, by a dense solve."""
    shape = differences.shape[1:]
    number = {place: index for index, place in enumerate(places(shape))}
    equations = np.zeros((len(number), len(number)))
    for (row, column), index in number.items():
        for other in [(row, column + 1), (row, column - 1), (row + 1, column), (row - 1, column)]:
            if other in number:
                equations[index, number[other]] += 1
                equations[index, index] -= 1
    solution = np.linalg.lstsq(equations, wanted_differences(differences).ravel(), rcond=None)[0]
    return solution.reshape(shape)


# Islands


class Community:
    """A connected part of {relief ≥ level}."""

    def __init__(self, points, differences, sign, clip, reduction):
        self.points = points
        shape = differences.shape[1:]
        border = [
            difference_between(differences, point, other)
            for point in points
            for other in neighbours(*point, shape)
            if other not in points
        ]
        ends = [max(-clip, min(clip, -sign * difference)) for difference in border if difference is not None]
        self.steepness = float(np.float32(sum(ends) / (max(len(ends), 1) * clip)))  # kept in float32
        rows, columns = zip(*points, strict=True)
        extent = max(max(rows) - min(rows), max(columns) - min(columns)) + 1
        narrow, fill = (4, 0.3) if reduction == 1 else (2, 0.45)
        if extent > narrow and len(points) < fill * extent**2:
            self.steepness = min(self.steepness, 0.0)
        self.core = 0
        self.is_island = self.overflows = False


def component(start, points):
    found, waiting = {start}, [start]
    while waiting:
        row, column = waiting.pop()
        for down, right in AROUND:
            place = row + down, column + right
            if place in points and place not in found:
                found.add(place)
                waiting.append(place)
    return frozenset(found)


def surroundings(relief):
    """Mean of blocks of 16×16 points, bilinear between their centres."""
    rows, columns = -(-relief.shape[0] // 16), -(-relief.shape[1] // 16)
    mean = np.empty((rows, columns), np.float32)
    for row, column in places((rows, columns)):
        values = relief[16 * row : 16 * row + 16, 16 * column : 16 * column + 16].ravel().tolist()
        mean[row, column] = sum(values) / len(values)
    return np.array(
        [
            [interpolated(mean, 16, row, column) for column in range(relief.shape[1])]
            for row in range(relief.shape[0])
        ]
    )


def one_sided_islands(relief, around, differences, measured, sign, clip, steep, reduction, rise):
    shape, largest = relief.shape, LARGEST
    if reduction > 1:
        largest = max(min(LARGEST // reduction**2, relief.size // 50), 4)
    level = {
        place: int(np.clip(np.rint(sign * STEPS_PER_SPREAD * relief[place]), -32767, 32767))
        for place in places(shape)
        if measured[place] and sign * relief[place] - sign * around[place] > rise
    }
    communities = {}
    for height in sorted(set(level.values())):
        points = {place for place in level if level[place] >= height}
        for place in points:
            found = component(place, points)
            if found not in communities:
                communities[found] = Community(found, differences, sign, clip, reduction)
    ascending = sorted(communities.values(), key=lambda community: len(community.points))
    larger = {one: next((o for o in ascending if one.points < o.points), None) for one in ascending}
    for one in ascending:
        size = len(one.points)
        cores = [inner.core for inner in ascending if larger[inner] is one and inner.is_island]
        core = max(cores, default=0)
        if size > largest:
            one.overflows = one.steepness > steep - FLANK and size <= 2 * largest
        elif one.steepness > steep:
            one.is_island, one.core = True, size
        elif core and one.steepness > steep - FLANK and size <= 2.5 * core:
            one.is_island, one.core = True, core
    found, best = np.zeros(shape, bool), np.zeros(shape, np.float32)
    for one in reversed(ascending):
        beyond = larger[one]
        if beyond is not None and beyond.overflows and one.steepness > steep - FLANK and len(one.points) > 8:
            one.overflows = True
        for point in one.points:
            if one.is_island and not one.overflows:
                found[point] = True
            if len(one.points) <= largest:
                best[point] = max(best[point], one.steepness)
    return found, best


def find_islands(relief, differences, measured, clip, steep, reduction, rise=1.0):
    around = surroundings(relief)
    up, down = (
        one_sided_islands(
            relief, around, differences, measured, sign, round(clip * STEPS_PER_SPREAD), steep, reduction, rise
        )
        for sign in (1, -1)
    )
    return up[0] | down[0], np.maximum(up[1], down[1])


# Islands far off


def steps_of(differences, outliers, least):
    """Pairs of kept neighbours that differ by `least` units, the first of which is not near an outlier."""
    found = []
    for direction, (row, column) in itertools.product(range(4), places(outliers.shape)):
        other = row + DIRECTIONS[direction][0], column + DIRECTIONS[direction][1]
        difference = int(differences[direction, row, column])
        if difference == MISSING or abs(difference) < least or outliers[row, column] or outliers[other]:
            continue
        if not outliers[max(0, row - 2) : row + 3, max(0, column - 2) : column + 3].any():
            found.append(((row, column), other))
    return found


def long_edges(steps, shape):
    """Components of points at steps that are long and narrow."""
    points = {point for pair in steps for point in pair}
    edges = np.zeros(shape, bool)
    for part in {component(place, points) for place in points}:
        rows, columns = zip(*part, strict=True)
        extent = max(max(rows) - min(rows), max(columns) - min(columns)) + 1
        if extent >= 48 and len(part) <= 8 * extent:
            for place in part:
                edges[place] = True
    return edges


def far_points(heights, outliers, suspected, differences, find):
    """Single points far off, and the islands by `find` far off a plain surface; differences are in 1/8 spread."""
    pairs = 4 * np.isfinite(with_holes_filled(heights, outliers)).sum()

    def steps(without, spreads):
        return len(steps_of(differences, without, 8 * spreads))

    noticed = any(abs(int(difference)) >= 48 for difference in differences.ravel() if difference != MISSING)
    if not noticed:
        return np.zeros(heights.shape, bool)
    alone = isolated_points(differences, 96) & np.isfinite(heights)
    if 10 * alone.sum() > np.isfinite(with_holes_filled(heights, outliers)).sum():
        alone[:] = False
    else:
        alone |= isolated_points(differences, 40) & suspected & ~outliers & np.isfinite(heights)
    outliers = outliers | alone
    if steps(outliers, 12) > 0.02 * pairs:
        return alone
    islands = find(10, 0.95, 4) & np.isfinite(heights)
    known = outliers | long_edges(steps_of(differences, outliers | islands, 96), heights.shape)
    if steps(known | islands, 12) > 0.002 * pairs:
        return alone
    islands |= alone
    if steps(known | islands, 4) > 0.005 * pairs:
        return islands
    lower = find(4, 0.955, 2) & np.isfinite(heights)
    if steps(known | lower, 4) > 0.0002 * pairs:
        return islands
    points = {tuple(map(int, place)) for place in np.argwhere(lower)}
    for part in {component(place, points) for place in points}:
        if sum(outliers[place] for place in part) < 0.7 * len(part):
            for place in part:
                islands[place] = True
    return islands


# Texture


def islands_of_one_height(heights, islands):
    """The islands that are kept, the removed ones that may be parts, and whether the former are kept narrowly."""
    points = {tuple(map(int, place)) for place in np.argwhere(islands)}
    parts = {component(place, points) for place in points}
    level = heights.astype(float)
    for axis in (1, 0):
        differences = np.diff(heights, axis=axis)
        tilt = np.median(differences[np.isfinite(differences)]) if np.isfinite(differences).any() else 0
        level -= float(tilt) * np.indices(heights.shape)[axis]
    rises = []
    for part in parts:
        inner = [level[point] for point in part]
        outer = [
            level[other] for point in part for other in neighbours(*point, heights.shape) if other not in points
        ]
        inner, outer = ([value for value in values if not np.isnan(value)] for values in (inner, outer))
        if inner and outer and sum(inner) / len(inner) != sum(outer) / len(outer):
            rises.append((abs(sum(inner) / len(inner) - sum(outer) / len(outer)), part))
    rises.sort(key=lambda rise: rise[0])
    measured = np.isfinite(heights).sum()
    group = group_of_one_height(rises, measured, 1.0)
    if group:
        return group, [], not group_of_one_height(rises, measured, 1 / 0.85)
    return [], group_of_one_height(rises, measured, 0.85) or few_of_one_height(rises), False


def groups_of_one_height(rises, size, ratio):
    rises = [(rise, part) for rise, part in rises if len(part) >= size]
    groups = [[part for rise, part in rises if low <= rise <= ratio * low] for low, _ in rises]
    return sorted(groups, key=cover, reverse=True), cover([part for _, part in rises])


def group_of_one_height(rises, measured, factor):
    groups, whole = groups_of_one_height(rises, 4, 1.35)
    for group in groups:
        enough = len(group) >= 8 * factor and evenness(group) >= 7 * factor
        if enough and cover(group) >= factor * max(0.5 * whole, LEAST_COVER * measured):
            return group
    return []


def few_of_one_height(rises):
    groups, whole = groups_of_one_height(rises, 36, 1.1)
    for group in groups:
        if len(group) >= 4 and evenness(group) >= 3 and cover(group) >= 0.5 * whole:
            return group
    return []


def evenness(parts):
    return cover(parts) ** 2 / sum(len(part) ** 2 for part in parts)


def taken_for_parts(outliers, known):
    """The sizes of the communities of at least 64 outliers of which less than half are known."""
    points = {tuple(map(int, place)) for place in np.argwhere(outliers)}
    communities = {component(place, points) for place in points}
    return [len(each) for each in communities if len(each) >= 64 and 2 * sum(known[p] for p in each) < len(each)]


def cover(parts):
    return sum(len(part) for part in parts)


def distances_with_few_neighbours(heights):
    """How far points with few neighbours stand beyond the others, less half of their range.

    Returns:
        (H, W), above 0 for outliers; -Inf for other points.
    """
    known = {place: heights[place] for place in places(heights.shape) if np.isfinite(heights[place])}
    found = np.full(heights.shape, -np.inf)
    numbers = np.array([(column, row, 1.0) for row, column in known]).reshape(-1, 3)
    slope, row_slope, _ = np.linalg.pinv(numbers) @ np.array(list(known.values()))
    level = {(row, column): z - slope * column - row_slope * row for (row, column), z in known.items()}
    sparse = [place for place in level if sum(near in level for near in neighbours(*place, heights.shape)) < 3]
    others = [level[place] for place in level if place not in sparse]
    if others and len(sparse) <= 0.1 * len(level):
        low, high = min(others), max(others)
        for place in sparse:
            found[place] = max(low - level[place], level[place] - high) - 0.5 * (high - low)
    return found
