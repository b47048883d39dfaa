"""Steps and grooves as a profile along one direction, found from the points round a hole."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.kernels.compiled import kernel

from .holes import MEASURED, PADDING

_MARGIN = 4
"""A hole's surroundings are its bounding box and this many rows and columns beyond it."""

_SAMPLES = 20000
"""About as many points tell how much a cloud bends usually."""

_MEDIAN_OF_SQUARES = 0.4549
"""Median of the square of a normal variable of variance 1."""

_BEND = 6.0
"""A profile is looked for where the mean of n squared second differences is above 1 + this/√n of the usual."""

_EXPLAINED = 0.5
"""A profile is used if it leaves less than this part of the variance of the heights round their plane, ..."""

_WORTH = 0.5
"""... and less than this times the mean squared second difference and the number of points of the hole."""

_LARGEST = 1e4
"""Squared second differences are counted up to this times the usual."""

_SPACING = 0.25
"""Distance of the heights of a profile, and standard deviation of the Gaussian that weighs points, in points."""

_TAPS = 3
_WEIGHTS = np.exp(-0.5 * np.arange(-_TAPS, _TAPS + 1) ** 2)
"""That Gaussian, cut off at three standard deviations."""

_ANGLES = 12
_HALVINGS = 4
"""Directions that are tried, and how often the distance of two of them is halved round the best."""

_FLATNESS = 0.05
"""Added to the variance of places in a regression line, in squares of their spacing: few points tell no slope."""

_LONELY = 0.8
"""A point with more than this weight in its own fit is not asked what the others leave of it."""


@kernel
def measured_heights(z: NDArray[Any], unknowns: NDArray[np.int32]) -> NDArray[Any]:
    """Heights in the shape of the map of unknowns, close together in memory, NaN where nothing is measured."""
    height, width = z.shape
    heights = np.full(unknowns.shape, np.nan, z.dtype)
    for row in range(height):
        for column in range(width):
            if unknowns[row + PADDING, column + PADDING] == MEASURED:
                heights[row + PADDING, column + PADDING] = z[row, column]
    return heights


@kernel
def usual_bend(heights: NDArray[Any]) -> float:
    """Mean square of second differences along rows and columns, from its median, which no step moves.

    Args:
        heights: padded, from `measured_heights`.

    Returns:
        The square of the unit of the heights; 0 where nothing is measured.
    """
    height, width = heights.shape
    stride = max(1, int(np.sqrt(height * width / _SAMPLES)))
    squares = np.empty(2 * (height // stride + 1) * (width // stride + 1))
    count = 0
    for row in range(PADDING, height - PADDING, stride):
        for column in range(PADDING, width - PADDING, stride):
            for square in _squares(heights, row, column):
                if not np.isnan(square):
                    squares[count] = square
                    count += 1
    return np.median(squares[:count]) / _MEDIAN_OF_SQUARES if count > 0 else 0.0


@kernel
def _squares(heights: NDArray[Any], row: Any, column: Any) -> tuple[float, float]:
    """Squared second differences along the row and the column; NaN where one of the points is missing."""
    twice = 2.0 * heights[row, column]
    along = heights[row, column - 1] - twice + heights[row, column + 1]
    across = heights[row - 1, column] - twice + heights[row + 1, column]
    return along * along, across * across


@kernel
def sum_bends(heights: NDArray[Any], usual: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Summed-area tables (Crow 1984) of squared second differences, each as a multiple of the usual one.

    Args:
        heights: padded, from `measured_heights`.
        usual: the usual square, from `usual_bend`.

    Returns:
        (H + 1, W + 1) sum and number of the differences whose middle lies above and left of a place.
        Multiples end at `_LARGEST`, so that one spike does not drown the others in rounding.
    """
    height, width = heights.shape[0] - 2 * PADDING, heights.shape[1] - 2 * PADDING
    sums, counts = np.zeros((height + 1, width + 1)), np.zeros((height + 1, width + 1))
    scale = 1.0 / usual if usual > 0 else np.inf
    line, numbers = np.empty(width), np.empty(width)
    for row in range(height):
        for column in range(width):
            along, across = _squares(heights, row + PADDING, column + PADDING)
            line[column] = (min(along * scale, _LARGEST) if along > 0 else 0.0) + (
                min(across * scale, _LARGEST) if across > 0 else 0.0
            )
            numbers[column] = (1.0 if along >= 0 else 0.0) + (1.0 if across >= 0 else 0.0)
        total, number = 0.0, 0.0
        for column in range(width):
            total += line[column]
            number += numbers[column]
            sums[row + 1, column + 1] = sums[row, column + 1] + total
            counts[row + 1, column + 1] = counts[row, column + 1] + number
    return sums, counts


@kernel
def find_profile(
    measured: NDArray[Any],
    bends: tuple[NDArray[np.float64], NDArray[np.float64]],
    points: NDArray[np.int32],
    first: Any,
    last: Any,
) -> tuple[float, float, float, NDArray[np.float64]]:
    """The function of one direction, f(n · p), that comes nearest to the heights round a hole.

    A straight step, whatever its angle and however blurred, is such a function, and so is a straight groove;
    with it taken away, what is left has no step. f is a local linear regression (Cleveland 1979) of
    the heights, less their plane of least squares, over their places along n: heights are shared linearly
    between places `_SPACING` apart, and weighed with a Gaussian. n is the direction in which the points,
    each left out in turn, are told best by the others: projection pursuit regression with one term
    (Friedman and Stuetzle 1981).

    It is looked for only where the surface bends much more than it does usually, and used only where it
    explains the heights: roughness alone has profiles too, which chance put there.

    Args:
        measured: padded heights, from `measured_heights`.
        bends: the tables of `sum_bends`.
        points: (N, 2) rows and columns, hole after hole.
        first: where the hole starts in `points`.
        last: where it ends.

    Returns:
        n as row and column, n · p of the first height, and the heights, `_SPACING` apart; none of them if there
        is no profile.
    """
    nothing = 0.0, 0.0, 0.0, np.empty(0)
    top, bottom, left, right = points[first, 0], points[first, 0], points[first, 1], points[first, 1]
    for point in range(first, last):
        row, column = points[point]
        top, bottom = min(top, row), max(bottom, row)
        left, right = min(left, column), max(right, column)
    top, bottom = max(top - _MARGIN, 0), min(bottom + _MARGIN + 1, measured.shape[0] - 2 * PADDING)
    left, right = max(left - _MARGIN, 0), min(right + _MARGIN + 1, measured.shape[1] - 2 * PADDING)
    differences = max(_in_box(bends[1], top, bottom, left, right), 1.0)
    if _in_box(bends[0], top, bottom, left, right) <= differences + _BEND * np.sqrt(differences):
        return nothing
    places = np.empty(((bottom - top) * (right - left), 2))
    heights = np.empty(len(places))
    count = 0
    bend = 0.0
    for row in range(top, bottom):
        for column in range(left, right):
            height = measured[row + PADDING, column + PADDING]
            if not np.isnan(height):
                places[count] = row, column
                heights[count] = height
                count += 1
                for square in _squares(measured, row + PADDING, column + PADDING):
                    bend += square / differences if not np.isnan(square) else 0.0
    places, heights = places[:count], heights[:count]
    variance = _flatten(places, heights)

    along = np.empty(count)
    lines = np.empty((4, int((np.hypot(bottom - top, right - left) + 1.0) / _SPACING)))
    least, angle = np.inf, 0.0
    for turn in range(_ANGLES):
        trial = turn * np.pi / _ANGLES
        error = _error(places, heights, trial, along, lines)
        if error < least:
            least, angle = error, trial
    step = np.pi / _ANGLES
    for _ in range(_HALVINGS):
        step /= 2
        middle = angle
        for trial in (middle - step, middle + step):
            error = _error(places, heights, trial, along, lines)
            if error < least:
                least, angle = error, trial
    if not (least < _EXPLAINED * variance and least < _WORTH * (last - first) * bend):
        return nothing
    _error(places, heights, angle, along, lines)
    start, size = _places(along)
    return np.sin(angle), np.cos(angle), start, _bridge(lines[0, :size])


@kernel
def _in_box(table: NDArray[np.float64], top: int, bottom: int, left: int, right: int) -> float:
    inside: float = table[bottom, right] - table[top, right] - table[bottom, left] + table[top, left]
    return inside


@kernel
def _flatten(places: NDArray[np.float64], heights: NDArray[np.float64]) -> float:
    """Take the plane of least squares from the heights, in place; the variance that is left."""
    count = len(heights)
    row, column, height = places[:, 0].mean(), places[:, 1].mean(), heights.mean()
    rows, columns, mixed, by_row, by_column = 0.0, 0.0, 0.0, 0.0, 0.0
    for item in range(count):
        r, c, h = places[item, 0] - row, places[item, 1] - column, heights[item] - height
        rows += r * r
        columns += c * c
        mixed += r * c
        by_row += r * h
        by_column += c * h
    determinant = rows * columns - mixed * mixed
    slope_row, slope_column = 0.0, 0.0
    if determinant > 0.5:  # else the points lie on one line; the sums are multiples of 1/count
        slope_row = (by_row * columns - by_column * mixed) / determinant
        slope_column = (by_column * rows - by_row * mixed) / determinant
    variance = 0.0
    for item in range(count):
        heights[item] -= height + slope_row * (places[item, 0] - row) + slope_column * (places[item, 1] - column)
        variance += heights[item] ** 2
    return variance / count


@kernel
def _error(
    places: NDArray[np.float64],
    heights: NDArray[np.float64],
    angle: float,
    along: NDArray[np.float64],
    lines: NDArray[np.float64],
) -> float:
    """Mean square that is left of each height by the profile of the others; fills `along` and `lines`.

    The rows of `lines` hold the profile, and of each of its heights the weights of the places before, at and
    after it. A height's residual, divided by 1 - its own weight in its fit, is what the others leave of it.
    """
    direction_row, direction_column = np.sin(angle), np.cos(angle)
    for item in range(len(heights)):
        along[item] = direction_row * places[item, 0] + direction_column * places[item, 1]
    start, size = _places(along)
    sums, counts = np.zeros((2, size + 2 * _TAPS))
    for item in range(len(heights)):
        place = (along[item] - start) / _SPACING
        before = int(place) + _TAPS
        share = place - int(place)
        sums[before] += (1.0 - share) * heights[item]
        sums[before + 1] += share * heights[item]
        counts[before] += 1.0 - share
        counts[before + 1] += share
    _fit_lines(sums, counts, lines[:, :size])
    profile, weight_before, weight_at, weight_after = lines
    left_over, told = 0.0, 0
    for item in range(len(heights)):
        place = (along[item] - start) / _SPACING
        before = int(place)
        share = place - before
        rest = 1.0 - share
        own = rest * (rest * weight_at[before] + share * weight_after[before])
        own += share * (rest * weight_before[before + 1] + share * weight_at[before + 1])
        if own < _LONELY:
            height = rest * profile[before] + share * profile[before + 1]
            left_over += ((heights[item] - height) / (1.0 - own)) ** 2
            told += 1
    return left_over / told if told > len(heights) / 2 else float('inf')


@kernel
def _places(along: NDArray[np.float64]) -> tuple[float, int]:
    """The first place of a profile and their number; as far beyond the points on one side as on the other."""
    least, greatest = along.min(), along.max()
    # Rounded: spans of whole points, which are common, must not fall on either side of a jump in the size.
    size = int((greatest - least) / _SPACING + 0.5) + 3
    return (least + greatest - (size - 1) * _SPACING) / 2.0, size


@kernel
def _fit_lines(sums: NDArray[np.float64], counts: NDArray[np.float64], lines: NDArray[np.float64]) -> None:
    """Heights of the regression lines at their places, and three of their weights.

    All places at once, offset by offset, so that the loops run along memory and the compiler may use vectors.
    """
    size = lines.shape[1]
    zeroth, first, second, height, moment = np.zeros((5, size))
    for tap in range(2 * _TAPS + 1):
        offset = float(tap - _TAPS)
        weight = _WEIGHTS[tap]
        for place in range(size):
            count, total = weight * counts[place + tap], weight * sums[place + tap]
            zeroth[place] += count
            first[place] += offset * count
            second[place] += offset * offset * count
            height[place] += total
            moment[place] += offset * total
    profile, before, at, after = lines
    for place in range(size):
        spread = second[place] + _FLATNESS * zeroth[place]
        determinant = zeroth[place] * spread - first[place] * first[place]
        share = 1.0 / determinant if determinant > 0.0 else np.nan
        beside = _WEIGHTS[_TAPS + 1] * share
        profile[place] = (spread * height[place] - first[place] * moment[place]) * share
        before[place] = beside * (spread + first[place])
        at[place] = spread * share
        after[place] = beside * (spread - first[place])


@kernel
def _bridge(heights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Heights of a profile; linear between their neighbours where no point is near."""
    profile = heights.copy()
    last = 0
    for place in range(1, len(profile)):
        if not np.isnan(profile[place]):
            for between in range(last + 1, place):
                share = (between - last) / (place - last)
                profile[between] = (1.0 - share) * profile[last] + share * profile[place]
            last = place
    return profile


@kernel
def height_on(profile: tuple[float, float, float, NDArray[np.float64]], row: Any, column: Any) -> float:
    """Height of a profile at a point; 0 everywhere without one."""
    direction_row, direction_column, start, heights = profile
    if len(heights) == 0:
        return 0.0
    place = (direction_row * row + direction_column * column - start) / _SPACING
    before = min(max(int(place), 0), len(heights) - 2)
    share = min(max(place - before, 0.0), 1.0)
    height: float = (1.0 - share) * heights[before] + share * heights[before + 1]
    return height
