# SPDX-License-Identifier: Apache-2.0
"""Slow, obvious references for the repair: dense least squares for each hole, after its definition."""

import numpy as np

DIFFERENCES = [
    [((0, 0), 1), ((0, 1), -2), ((0, 2), 1)],
    [((0, 0), 1), ((1, 0), -2), ((2, 0), 1)],
    [((0, 0), 2**0.5), ((0, 1), -(2**0.5)), ((1, 0), -(2**0.5)), ((1, 1), 2**0.5)],
]
ALONG, ACROSS = (0, 1), (1, 0)
SIDES = [(0, -1), (0, 1), (-1, 0), (1, 0)]


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
    """The first point outside `inside` in the direction `step`, and its distance in steps."""
    count = 0
    while point in inside:
        point = point[0] + step[0], point[1] + step[1]
        count += 1
    return point, count


def rims(point, hole, measured):
    """Distances to the measured rim: left, right, above, below; 0 without a rim."""
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


def ratio_of_pitches(xyz, measured):
    """Distance of the rows over that of the columns, rounded and limited; 1 where x and y do not tell it."""
    places = np.array(sorted(measured)).reshape(-1, 2)
    if len(places) < 2 or np.linalg.matrix_rank(places - places.mean(axis=0)) < 2:
        return 1.0
    terms = np.column_stack([places, np.ones(len(places))])
    at = np.array([xyz[r, c, :2] for r, c in places], float)
    row_step, column_step, _ = np.linalg.lstsq(terms, at, rcond=None)[0]
    dx, dy = np.linalg.norm(column_step), np.linalg.norm(row_step)
    larger = min(float(f'{max(dx, dy) / min(dx, dy):.4g}'), 16)
    return larger if dy > dx else 1 / larger


def biharmonic(xyz, mask):
    """Heights of all inner points by (row, column)."""
    measured = measured_heights(xyz, mask)
    ratio = ratio_of_pitches(xyz, measured)
    usual = [usual_square(measured, steps) for steps in ([ALONG, ACROSS],) * 2]
    if ratio != 1:
        usual = [usual_square(measured, [step]) for step in (ALONG, ACROSS)]
    heights = {}
    for hole in find_holes(mask):
        inside = set(hole)
        inner = [p for p in hole if is_inner(rims(p, inside, measured))]
        if inner:
            heights.update(fill(hole, inner, measured, usual, ratio))
    return heights


def fill(hole, inner, measured, usual, ratio):
    around = [(r + i, c + j) for r, c in inner for i in range(-2, 3) for j in range(-2, 3) if abs(i) + abs(j) <= 2]
    ring = [measured[p] for p in around if p in measured]
    profile = find_profile(hole, measured, usual)
    number = {point: item for item, point in enumerate(inner)}
    smooth = solve(
        inner, number, {point: measured[point] - profile(point) for point in around if point in measured}, ratio
    )
    surface = [height + profile(point) for point, height in zip(inner, smooth, strict=True)]
    margin = (max(ring) - min(ring)) / 2
    return dict(zip(inner, np.clip(surface, min(ring) - margin, max(ring) + margin), strict=True))


def heights_at_rim(hole, measured):
    """The measured heights at most two steps from the unknowns of a hole."""
    inside = set(hole)
    return [
        measured[r + i, c + j]
        for r, c in hole
        if is_inner(rims((r, c), inside, measured))
        for i in range(-2, 3)
        for j in range(-2, 3)
        if abs(i) + abs(j) <= 2 and (r + i, c + j) in measured
    ]


def beyond(xyz, filled, measured, mask):
    """1 where a filled height is invented, 0 elsewhere, NaN where rounding decides."""
    found = np.zeros(mask.shape)
    for hole in find_holes(mask):
        rim = heights_at_rim(hole, measured)
        for point in hole:
            if filled[point]:
                of_all = 0.1 * (max(measured.values()) - min(measured.values()))
                margin = max(0.5 * (max(rim) - min(rim)), of_all)
                excess = max(min(rim) - xyz[point][2], xyz[point][2] - max(rim)) - margin
                found[point] = np.nan if abs(excess) < 1e-3 else excess > 0
    return found


def usual_square(measured, steps):
    return np.median(list(squared_differences(measured, measured, steps)) or [0]) / 0.4549


def squared_differences(points, measured, steps):
    """Squared second differences along the steps with the middle in one of the points."""
    for r, c in points:
        for i, j in steps:
            ends = (r - i, c - j), (r + i, c + j)
            if (r, c) in measured and all(end in measured for end in ends):
                yield (measured[ends[0]] - 2 * measured[r, c] + measured[ends[1]]) ** 2


def find_profile(hole, measured, usual):
    """The profile across a step or groove, as a function of (row, column); 0 if there is none."""
    top, left = np.min(hole, axis=0) - 4
    bottom, right = np.max(hole, axis=0) + 4
    box = [(r, c) for r in range(top, bottom + 1) for c in range(left, right + 1)]
    points = [point for point in box if point in measured]
    squares, multiples = [], []
    for step, mean in zip((ALONG, ACROSS), usual, strict=True):
        found = list(squared_differences(box, measured, [step]))
        squares += found
        multiples += [min(square / mean, 1e4) if mean else 1e4 * (square > 0) for square in found]
    if not squares or np.mean(multiples) <= 1 + 6 / np.sqrt(len(squares)):
        return lambda point: 0.0
    heights = np.array([measured[point] for point in points])
    plane = np.column_stack([points, np.ones(len(points))])
    flat = heights - plane @ np.linalg.lstsq(plane, heights, rcond=None)[0]

    def error(angle):
        return regression(points, flat, angle)[0]

    best = min((np.pi * k / 12 for k in range(12)), key=error)
    for halving in range(1, 5):
        step = np.pi / 12 / 2**halving
        best = min((best, best - step, best + step), key=error)
    if not error(best) < min(0.5 * np.mean(flat**2), 0.5 * len(hole) * np.mean(squares)):
        return lambda point: 0.0
    return regression(points, flat, best)[1]


def regression(points, heights, angle):
    """Leave-one-out error of the profile in one direction, and the profile."""
    direction = np.array([np.sin(angle), np.cos(angle)])
    along = np.array(points) @ direction
    places = np.arange(int(np.ptp(along) / 0.25 + 0.5) + 3)
    start = (along.min() + along.max()) / 2 - 0.25 * (len(places) - 1) / 2

    def shares(at):
        """Share of each place in a point: linear between the two nearest."""
        return np.clip(1 - abs((at - start) / 0.25 - places), 0, 1)

    spread = np.array([shares(at) for at in along])
    weights = np.full((len(places), len(places)), np.nan)  # of each place in the height at each place
    for place in places:
        offset = places - place
        near = np.where(abs(offset) <= 3, np.exp(-0.5 * offset**2), 0)
        counts = near * spread.sum(axis=0)
        if counts.sum() > 0:
            first, second = (counts * offset).sum(), (counts * offset**2).sum() + 0.05 * counts.sum()
            weights[place] = near * (second - first * offset) / (counts.sum() * second - first**2)
    line = weights @ (spread.T @ heights)
    kept = ~np.isnan(line)
    line = np.interp(places, places[kept], line[kept])
    own = np.array([share @ np.nan_to_num(weights) @ share for share in spread])
    counted = own < 0.8
    residuals = ((heights - spread @ line) / np.where(counted, 1 - own, 1))[counted]
    return (
        np.mean(residuals**2) if counted.sum() > len(points) / 2 else np.inf,
        lambda point: float(np.interp(np.array(point) @ direction, start + 0.25 * places, line)),
    )


def differences(inner, number, measured, ratio):
    """All differences with at least one unknown and no unusable point, as (point, factor)."""
    corners = {(r - i, c - j) for r, c in inner for i in range(3) for j in range(3)}
    for r, c in sorted(corners):
        for difference, weight in zip(DIFFERENCES, [ratio, 1 / ratio, 1.0], strict=True):
            places = [((r + i, c + j), weight * factor) for (i, j), factor in difference]
            if any(p in number for p, _ in places) and all(p in number or p in measured for p, _ in places):
                yield places


def solve(inner, number, measured, ratio):
    """Least-squares solution of all differences."""
    lines, right = [], []
    for places in differences(inner, number, measured, ratio):
        line = np.zeros(len(inner))
        for p, factor in places:
            if p in number:
                line[number[p]] = factor
        lines.append(line)
        right.append(-sum(factor * measured[p] for p, factor in places if p in measured))
    return np.linalg.lstsq(np.array(lines), np.array(right), rcond=None)[0]


def natural_spline(knots, values, at):
    """The natural cubic spline, from one dense system for its second derivatives."""
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
    ratio = ratio_of_pitches(xyz, measured)
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
                weights.append(1 / (ratio * (above + below)) ** 2)
            if values:
                heights[row, column] = np.average(values, weights=weights)
    return heights
