"""The repair again, hole by hole with dense least squares, so that it can be read beside its definition."""

import numpy as np

DIFFERENCES = [
    [((0, 0), 1), ((0, 1), -2), ((0, 2), 1)],
    [((0, 0), 1), ((1, 0), -2), ((2, 0), 1)],
    [((0, 0), 2**0.5), ((0, 1), -(2**0.5)), ((1, 0), -(2**0.5)), ((1, 1), 2**0.5)],
]
SIDES = [(0, -1), (0, 1), (-1, 0), (1, 0)]
LINES = [(0, 1), (1, 0), (1, 1), (1, -1), (1, 2), (2, 1), (1, -2), (2, -1)]


def find_holes(mask):
    """The holes as sorted lists of (row, column), in the order of their first points."""
    left = {(int(r), int(c)) for r, c in np.argwhere(mask)}
    holes = []
    while left:
        hole, front = set(), [min(left)]
        while front:
            point = front.pop()
            if point in left:
                left.remove(point)
                hole.add(point)
                front += [(point[0] + r, point[1] + c) for r, c in SIDES]
        holes.append(sorted(hole))
    return holes


def walk(point, step, inside):
    """The first point outside `inside` in the direction `step`, and how many steps away it is."""
    count = 0
    while point in inside:
        point = point[0] + step[0], point[1] + step[1]
        count += 1
    return point, count


def rims(point, hole, measured):
    """Distances to the measured rim: left, right, above, below; 0 where there is none."""
    ends = [walk(point, step, hole) for step in SIDES]
    return [count if end in measured else 0 for end, count in ends]


def is_inner(distances):
    left, right, above, below = distances
    return bool((left and right) or (above and below))


def measured_heights(xyz, mask):
    """Heights of the measured points by (row, column)."""
    usable = np.isfinite(xyz).all(axis=2) & ~mask
    return {(int(r), int(c)): float(xyz[r, c, 2]) for r, c in np.argwhere(usable)}


def chosen_points(xyz, mask, largest, sides, heights_agree):
    measured = measured_heights(xyz, mask)
    chosen = np.zeros(mask.shape, bool)
    for hole in find_holes(mask):
        inside = set(hole)
        inner = [p for p in hole if is_inner(rims(p, inside, measured))]
        touching = [
            measured[r + i, c + j]
            for r, c in inner
            for i in (-1, 0, 1)
            for j in (-1, 0, 1)
            if (r + i, c + j) in measured
        ]
        agree = not heights_agree or not touching or max(touching) - min(touching) <= heights_agree
        for point in inner:
            seen = sum(distance > 0 for distance in rims(point, inside, measured))
            chosen[point] = len(hole) <= largest and agree and seen >= sides
    return chosen


def biharmonic(xyz, mask):
    """Heights of all inner points by (row, column)."""
    measured = measured_heights(xyz, mask)
    heights = {}
    for hole in find_holes(mask):
        inside = set(hole)
        inner = [p for p in hole if is_inner(rims(p, inside, measured))]
        if inner:
            heights.update(fill(inner, measured))
    return heights


def fill(inner, measured):
    number = {point: item for item, point in enumerate(inner)}
    ring = []
    for r, c in inner:
        around = [(r + i, c + j) for i in range(-2, 3) for j in range(-2, 3) if abs(i) + abs(j) <= 2]
        ring += [measured[p] for p in around if p in measured]
    ring = np.sort(ring)
    levels = find_levels(ring)
    surface = solve(inner, number, measured)
    if levels and bend(inner, number, measured, surface) >= 0.5 * (np.mean(levels[1]) - np.mean(levels[0])):
        lower, upper = levels
        split = (ring[0] + ring[-1]) / 2
        step = np.mean(upper) - np.mean(lower)
        on_level = {point: float(height > split) for point, height in measured.items()}
        smooth = solve(inner, number, on_level)
        for item, point in enumerate(inner):
            surface[item] += step * (vote(point, number, on_level, smooth[item]) - smooth[item])
    margin = (ring[-1] - ring[0]) / 2
    return dict(zip(inner, np.clip(surface, ring[0] - margin, ring[-1] + margin), strict=True))


def find_levels(ring):
    gaps = np.diff(ring)
    if not len(gaps):
        return None
    widest = int(np.argmax(gaps))
    lower, upper = ring[: widest + 1], ring[widest + 1 :]
    return (lower, upper) if gaps[widest] > 1.5 * max(np.ptp(lower), np.ptp(upper)) else None


def differences(inner, number, measured):
    """All differences that hold an unknown and otherwise only known points, as (point, factor)."""
    corners = {(r - i, c - j) for r, c in inner for i in range(3) for j in range(3)}
    for r, c in sorted(corners):
        for difference in DIFFERENCES:
            places = [((r + i, c + j), factor) for (i, j), factor in difference]
            if any(p in number for p, _ in places) and all(p in number or p in measured for p, _ in places):
                yield places


def solve(inner, number, measured):
    """Least squares of all differences."""
    lines, right = [], []
    for places in differences(inner, number, measured):
        line = np.zeros(len(inner))
        for p, factor in places:
            if p in number:
                line[number[p]] = factor
        lines.append(line)
        right.append(-sum(factor * measured[p] for p, factor in places if p in measured))
    return np.linalg.lstsq(np.array(lines), np.array(right), rcond=None)[0]


def bend(inner, number, measured, surface):
    """The greatest difference times the factor of one of its unknowns."""
    greatest = 0.0
    for places in differences(inner, number, measured):
        total = sum(factor * (surface[number[p]] if p in number else measured[p]) for p, factor in places)
        greatest = max([greatest, *(abs(total * factor) for p, factor in places if p in number)])
    return greatest


def vote(point, number, on_level, otherwise):
    votes = weights = 0.0
    for step in LINES:
        first, before = walk(point, step, number)
        second, after = walk(point, (-step[0], -step[1]), number)
        if first in on_level and second in on_level and on_level[first] == on_level[second]:
            weight = 1 / ((before + after) ** 2 * (step[0] ** 2 + step[1] ** 2))
            votes += weight * on_level[first]
            weights += weight
    return votes / weights if weights else otherwise


def natural_spline(knots, values, at):
    """The natural cubic spline as the solution of one dense system for its second derivatives."""
    n = len(knots)
    matrix, right = np.eye(n), np.zeros(n)
    for i in range(1, n - 1):
        before, after = knots[i] - knots[i - 1], knots[i + 1] - knots[i]
        matrix[i, i - 1 : i + 2] = before / 6, (before + after) / 3, after / 6
        right[i] = (values[i + 1] - values[i]) / after - (values[i] - values[i - 1]) / before
    second = np.linalg.solve(matrix, right)
    i = int(np.searchsorted(knots, at)) - 1
    h = knots[i + 1] - knots[i]
    a, b = (knots[i + 1] - at) / h, (at - knots[i]) / h
    bend = ((a**3 - a) * second[i] + (b**3 - b) * second[i + 1]) * h * h / 6
    return a * values[i] + b * values[i + 1] + bend


def spline(xyz, mask):
    """Heights of all inner points by (row, column)."""
    measured = measured_heights(xyz, mask)
    heights = {}
    for hole in find_holes(mask):
        inside = set(hole)
        for row, column in hole:
            left, right, above, below = rims((row, column), inside, measured)
            values, weights = [], []
            if left and right:
                knots = [c for c in range(mask.shape[1]) if (row, c) in measured]
                values.append(natural_spline(knots, [measured[row, c] for c in knots], column))
                weights.append(1 / (left + right) ** 2)
            if above and below:
                knots = [r for r in range(mask.shape[0]) if (r, column) in measured]
                values.append(natural_spline(knots, [measured[r, column] for r in knots], row))
                weights.append(1 / (above + below) ** 2)
            if values:
                heights[row, column] = np.average(values, weights=weights)
    return heights
