# SPDX-License-Identifier: Apache-2.0
"""Steps and grooves through a hole: a profile along one direction, found from the points near the hole.

A straight step is a function of one direction, f(n · p), at any angle and with any blur. So is a straight groove.
If such a profile is subtracted from the heights, the rest has no step.

- n is the direction of the profile with the least leave-one-out error: projection pursuit regression with one term
  (J. H. Friedman, W. Stuetzle, J. Am. Stat. Assoc. 76 (1981) 817-823, DOI 10.1080/01621459.1981.10477729).
- f is a local linear regression of the heights over their places along n, with Gaussian weights (W. S. Cleveland,
  J. Am. Stat. Assoc. 74 (1979) 829-836, DOI 10.1080/01621459.1979.10481038). The heights are those above their
  least-squares plane, and each is shared linearly between two places `_SPACING` apart.

A profile is searched for only where second differences are much larger than is usual in the cloud. It is used only
where it explains the heights: roughness alone also has profiles, by chance.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.cloud import Floats
from socialcircle_ros.kernels.compiled import kernel

from .holes import PADDING
from .second_differences import DifferenceTables, squared_differences

_MARGIN = 4
"""The neighbourhood of a hole is its bounding box and this many rows and columns on each side."""

_EXCESS = 6.0
"""A profile is searched for if the mean of n squared second differences is above 1 + _EXCESS/√n usual ones."""

_EXPLAINED = 0.5
"""A profile is used if its error is below this share of the variance of the heights above their plane, and ..."""

_WORTH = 0.5
"""... below this factor times the mean squared second difference times the number of points of the hole."""

_SPACING = 0.25
"""Distance of two places of a profile, and standard deviation of the Gaussian weights, in points."""

_TAPS = 3
_WEIGHTS = np.exp(-0.5 * np.arange(-_TAPS, _TAPS + 1) ** 2)
"""The Gaussian weights, cut off at three standard deviations."""

_ANGLES = 12
"""Directions that are tried first."""

_HALVINGS = 4
"""How often the step between directions is then halved around the best one."""

_FLATNESS = 0.05
"""Added to the variance of the places in a regression line, in squared spacings: few points give no slope."""

_LARGEST_LEVERAGE = 0.8
"""A point with a larger weight in its own fit is left out of the leave-one-out error."""


class Profile(NamedTuple):
    """A function of one direction, f(n · p)."""

    direction_row: float
    """n along the rows."""

    direction_column: float
    """n along the columns."""

    start: float
    """n · p of the first height."""

    heights: NDArray[np.float64]
    """The heights, `_SPACING` apart; none if there is no profile."""


class _Surround(NamedTuple):
    """Rows from top to before bottom, columns from left to before right."""

    top: int
    bottom: int
    left: int
    right: int


@kernel
def find_profile(
    measured: Floats, tables: DifferenceTables, points: NDArray[np.int32], first: int, last: int
) -> Profile:
    """Find the profile that is nearest to the heights in the neighbourhood of a hole, see the module.

    Args:
        measured: padded heights, from `measured_heights`.
        tables: from `sum_differences`.
        points: (N, 2), rows and columns of the points of all holes.
        first: where the hole starts in `points`.
        last: where it ends.

    Returns:
        The profile; without heights if none is used.
    """
    nothing = Profile(0.0, 0.0, 0.0, np.empty(0))
    box = _neighbourhood(points, first, last, measured.shape[0] - 2 * PADDING, measured.shape[1] - 2 * PADDING)
    count = max(_sum_in_box(tables.counts, box), 1.0)
    if _sum_in_box(tables.sums, box) <= count + _EXCESS * np.sqrt(count):
        return nothing
    places, heights, mean_square = _collect(measured, box, count)
    variance = _subtract_plane(places, heights)
    along = np.empty(len(heights))
    diagonal = np.hypot(box.bottom - box.top, box.right - box.left)
    lines = np.empty((4, int((diagonal + 1.0) / _SPACING)))
    least, angle = _best_direction(places, heights, along, lines)
    if not (least < _EXPLAINED * variance and least < _WORTH * (last - first) * mean_square):
        return nothing
    _error(places, heights, angle, along, lines)
    start, size = _places(along)
    return Profile(np.sin(angle), np.cos(angle), start, _interpolate_gaps(lines[0, :size]))


@kernel
def _neighbourhood(points: NDArray[np.int32], first: int, last: int, height: int, width: int) -> _Surround:
    """Return the bounding box of the hole from `first` to before `last`, with a margin, within the cloud."""
    top, bottom, left, right = points[first, 0], points[first, 0], points[first, 1], points[first, 1]
    for point in range(first, last):
        row, column = points[point]
        top, bottom = min(top, row), max(bottom, row)
        left, right = min(left, column), max(right, column)
    return _Surround(
        max(top - _MARGIN, 0),
        min(bottom + _MARGIN + 1, height),
        max(left - _MARGIN, 0),
        min(right + _MARGIN + 1, width),
    )


@kernel
def _sum_in_box(table: NDArray[np.float64], box: _Surround) -> float:
    top, bottom, left, right = box
    inside: float = table[bottom, right] - table[top, right] - table[bottom, left] + table[top, left]
    return inside


@kernel
def _collect(
    measured: Floats, box: _Surround, count: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Collect the measured points in a box.

    Args:
        measured: padded heights.
        box: where.
        count: number of second differences in the box.

    Returns:
        Rows and columns (n, 2), heights (n,), and the mean squared second difference.
    """
    points = np.empty(((box.bottom - box.top) * (box.right - box.left), 2))
    heights = np.empty(len(points))
    found = 0
    mean_square = 0.0
    for row in range(box.top, box.bottom):
        for column in range(box.left, box.right):
            height = measured[row + PADDING, column + PADDING]
            if not np.isnan(height):
                points[found] = row, column
                heights[found] = height
                found += 1
                for square in squared_differences(measured, row + PADDING, column + PADDING):
                    mean_square += square / count if not np.isnan(square) else 0.0
    return points[:found], heights[:found], mean_square


@kernel
def _best_direction(
    points: NDArray[np.float64],
    heights: NDArray[np.float64],
    along: NDArray[np.float64],
    lines: NDArray[np.float64],
) -> tuple[float, float]:
    """Search the direction of the profile with the least error; `along` and `lines` are work arrays of `_error`.

    Returns:
        The least error, and the angle of its direction in radians.
    """
    least, angle = np.inf, 0.0
    for turn in range(_ANGLES):
        trial = turn * np.pi / _ANGLES
        error = _error(points, heights, trial, along, lines)
        if error < least:
            least, angle = error, trial
    step = np.pi / _ANGLES
    for _ in range(_HALVINGS):
        step /= 2
        middle = angle
        for trial in (middle - step, middle + step):
            error = _error(points, heights, trial, along, lines)
            if error < least:
                least, angle = error, trial
    return least, angle


@kernel
def _subtract_plane(points: NDArray[np.float64], heights: NDArray[np.float64]) -> float:
    """Subtract the least-squares plane from the heights, in place. Returns the variance of the rest."""
    count = len(heights)
    row, column, height = points[:, 0].mean(), points[:, 1].mean(), heights.mean()
    rows, columns, mixed, by_row, by_column = 0.0, 0.0, 0.0, 0.0, 0.0
    for item in range(count):
        r, c, h = points[item, 0] - row, points[item, 1] - column, heights[item] - height
        rows += r * r
        columns += c * c
        mixed += r * c
        by_row += r * h
        by_column += c * h
    determinant = rows * columns - mixed * mixed
    slope_row, slope_column = 0.0, 0.0
    if determinant > 0.5:  # otherwise the points are on one line: the sums are multiples of 1/count
        slope_row = (by_row * columns - by_column * mixed) / determinant
        slope_column = (by_column * rows - by_row * mixed) / determinant
    variance = 0.0
    for item in range(count):
        heights[item] -= height + slope_row * (points[item, 0] - row) + slope_column * (points[item, 1] - column)
        variance += heights[item] ** 2
    return variance / count


@kernel
def _error(
    points: NDArray[np.float64],
    heights: NDArray[np.float64],
    angle: float,
    along: NDArray[np.float64],
    lines: NDArray[np.float64],
) -> float:
    """Fit the profile in one direction, and return its mean squared leave-one-out error.

    The leave-one-out residual of a height is its residual divided by 1 - its own weight in its fit.

    Args:
        points: (n, 2), rows and columns.
        heights: (n,), above their plane.
        angle: of the direction, radians.
        along: (n,), overwritten by n · p of each point.
        lines: (4, at least as many as places), overwritten by the profile, and by the weights of the places
            before, at and after each place in the height there.

    Returns:
        The mean square; infinite if it is known for half of the heights or fewer.
    """
    direction_row, direction_column = np.sin(angle), np.cos(angle)
    for item in range(len(heights)):
        along[item] = direction_row * points[item, 0] + direction_column * points[item, 1]
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
    total, counted = 0.0, 0
    for item in range(len(heights)):
        place = (along[item] - start) / _SPACING
        before = int(place)
        share = place - before
        rest = 1.0 - share
        own = rest * (rest * weight_at[before] + share * weight_after[before])
        own += share * (rest * weight_before[before + 1] + share * weight_at[before + 1])
        if own < _LARGEST_LEVERAGE:
            height = rest * profile[before] + share * profile[before + 1]
            total += ((heights[item] - height) / (1.0 - own)) ** 2
            counted += 1
    return total / counted if counted > len(heights) / 2 else np.inf


@kernel
def _places(along: NDArray[np.float64]) -> tuple[float, int]:
    """Return the first place of a profile and the number of places; the points are in their middle."""
    least, greatest = along.min(), along.max()
    # Rounded, because spans of whole points are common: rounding errors must not change the size.
    size = int((greatest - least) / _SPACING + 0.5) + 3
    return (least + greatest - (size - 1) * _SPACING) / 2.0, size


@kernel
def _fit_lines(sums: NDArray[np.float64], counts: NDArray[np.float64], lines: NDArray[np.float64]) -> None:
    """Write the heights of the regression lines at their places, and three of their weights, to `lines`.

    All places are fitted at once, offset by offset: the loops then run along memory, and the compiler vectorises
    them.

    Args:
        sums: (places + 2 · _TAPS,), heights that each place shares.
        counts: (places + 2 · _TAPS,), number of points that each place shares.
        lines: (4, places), see `_error`.
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
def _interpolate_gaps(heights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the heights of a profile, interpolated linearly where no point is near."""
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
def height_on(profile: Profile, row: int, column: int) -> float:
    """Height of the profile at a point; 0 if the profile has no heights."""
    direction_row, direction_column, start, heights = profile
    if len(heights) == 0:
        return 0.0
    place = (direction_row * row + direction_column * column - start) / _SPACING
    before = min(max(int(place), 0), len(heights) - 2)
    share = min(max(place - before, 0.0), 1.0)
    height: float = (1.0 - share) * heights[before] + share * heights[before + 1]
    return height
