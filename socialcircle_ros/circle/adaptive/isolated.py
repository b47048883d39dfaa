"""Points that touch nobody, or one other: the outliers that need no community to be told."""

from typing import Any

import numpy as np

from socialcircle_ros.cloud import Mask
from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .differences import NONE, UNIT, Differences, Heights

TOUCH = 3.5
"""Neighbours within so many spreads are in touch."""

_RINGS = 6


def isolated_points(differences: Differences) -> Mask:
    """Points that hardly any neighbour is in touch with, and that nearly all of them lie on one side of.

    The second condition keeps the points of a steep wall, whose neighbours are above and below; the first lets two
    neighbouring outliers by chance be at one height.

    Args:
        differences: (4, H, W) int8, as `normalised_differences` gives them.

    Returns:
        (H, W) bool.
    """
    lone: Mask = np.empty(differences.shape[1:], np.bool_)

    def find(rows: slice) -> None:
        _find(differences, round(TOUCH * UNIT), rows.start, rows.stop, lone)

    in_bands(find, *lone.shape)
    return lone


def with_holes_filled(heights: Heights, holes: Mask) -> Heights:
    """The heights with `holes` filled by the mean of what surrounds them, ring by ring; NaN where too deep.

    For looking at what is left, never for publishing.

    Args:
        heights: (H, W) float32.
        holes: (H, W) bool.

    Returns:
        (H, W) float32, a copy.
    """
    filled = heights.copy()
    points = np.flatnonzero(holes)
    filled.ravel()[points] = np.nan
    _fill(filled, points)
    return filled


@kernel
def _find(differences: Any, touch: int, first: int, end: int, lone: Any) -> None:
    width = differences.shape[2]
    there, touching, side = np.empty(width, np.int8), np.empty(width, np.int8), np.empty(width, np.int8)
    for row in range(first, end):
        there[:], touching[:], side[:] = 0, 0, 0
        for direction in range(4):
            down, right = (0 if direction == 0 else 1), (1, 0, 1, -1)[direction]
            _count(differences[direction, row], touch, np.int8(1), there, touching, side)
            if row - down >= 0:
                reached, left = (
                    slice(max(0, right), width + min(0, right)),
                    slice(max(0, -right), width - max(0, right)),
                )
                back = differences[direction, row - down, left]
                _count(back, touch, np.int8(-1), there[reached], touching[reached], side[reached])
        for column in range(width):
            lone[row, column] = (
                there[column] >= 3
                and touching[column] <= (1 if there[column] >= 6 else 0)
                and 2 * abs(side[column]) >= there[column]
            )


@kernel
def _count(differences: Any, touch: int, sign: Any, there: Any, touching: Any, side: Any) -> None:
    """Add a row of neighbours to the numbers that there are, that are in touch, and (less those below) above.

    All in 8 bits, of which the processor does many at a time.
    """
    upper, lower = np.int8(touch), np.int8(-touch)
    for column in range(differences.size):
        difference = differences[column]
        known, above, below = (
            np.int8(difference != NONE),
            np.int8(difference >= upper),
            np.int8(difference <= lower),
        )
        below &= known
        there[column] += known
        touching[column] += known - above - below
        side[column] += sign * (above - below)


@kernel
def _fill(heights: Any, holes: Any) -> None:
    height, width = heights.shape
    left = holes.copy()
    values = np.empty(holes.size, np.float32)
    for _ in range(_RINGS):
        count = 0
        for place in range(left.size):
            row, column = left[place] // width, left[place] % width
            total, known = 0.0, 0
            for y in range(max(0, row - 1), min(height, row + 2)):
                for x in range(max(0, column - 1), min(width, column + 2)):
                    if not np.isnan(heights[y, x]):
                        total += heights[y, x]
                        known += 1
            values[place] = total / known if known >= 3 else np.nan
        for place in range(left.size):
            # All of a ring at once: no point is to depend on the order of the others.
            if np.isnan(values[place]):
                left[count] = left[place]
                count += 1
            else:
                heights[left[place] // width, left[place] % width] = values[place]
        if count == left.size:
            break
        left = left[:count]
