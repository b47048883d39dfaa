# SPDX-License-Identifier: Apache-2.0
"""Isolated points: outliers that their neighbours alone reveal, without a community."""

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask
from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .differences import DOWN, MISSING, RIGHT, STEPS_PER_SPREAD, Differences

TOUCH = 3.5
"""Neighbours are in touch if their normalised difference is below this, in spreads."""

_LEAST_NEIGHBOURS = 3
_WELL_SURROUNDED = 6
"""From this number of neighbours on, one may be in touch: two neighbouring outliers may have one height."""

_TouchCounts = npt.NDArray[np.int8]


def isolated_points(differences: Differences, touch: float = TOUCH) -> Mask:
    """Find the points that at most one neighbour is in touch with, and that lie above or below most of the others.

    The second condition keeps the points of a steep wall: they have neighbours above and below.

    Args:
        differences: (4, H, W) int8, as `normalised_differences` gives them.
        touch: neighbours are in touch below this, in spreads.

    Returns:
        (H, W) bool.
    """
    isolated: Mask = np.empty(differences.shape[1:], np.bool_)
    steps = round(touch * STEPS_PER_SPREAD)
    in_bands(lambda rows: _find(differences, steps, rows.start, rows.stop, isolated), *isolated.shape)
    return isolated


def isolated_among(suspected: Mask, differences: Differences, touch: float) -> Mask:
    """Those of `isolated_points` that are suspected: much faster where these are few.

    Args:
        suspected: (H, W) bool.
        differences: as for `isolated_points`.
        touch: as for `isolated_points`.

    Returns:
        (H, W) bool.
    """
    isolated: Mask = np.zeros(suspected.shape, np.bool_)
    _find_among(np.flatnonzero(suspected), differences, round(touch * STEPS_PER_SPREAD), isolated)
    return isolated


@kernel
def _find_among(points: npt.NDArray[np.intp], differences: Differences, touch: int, isolated: Mask) -> None:
    height, width = isolated.shape
    for point in points:
        row, column = point // width, point % width
        known, touching, side = 0, 0, 0
        for direction in range(4):
            down, right = DOWN[direction], RIGHT[direction]
            for sign in (1, -1):
                first = row if sign > 0 else row - down
                start = column if sign > 0 else column - right
                if not (0 <= first < height and 0 <= start < width):
                    continue
                difference = np.int64(differences[direction, first, start])
                if difference == MISSING:
                    continue
                known += 1
                if abs(difference) < touch:
                    touching += 1
                else:
                    side += sign if difference > 0 else -sign
        isolated[row, column] = _is_isolated(known, touching, side)


@kernel
def _is_isolated(known: int, touching: int, side: int) -> bool:
    return (
        known >= _LEAST_NEIGHBOURS
        and touching <= (1 if known >= _WELL_SURROUNDED else 0)
        and 2 * abs(side) >= known
    )


@kernel
def _find(differences: Differences, touch: int, first: int, end: int, isolated: Mask) -> None:
    width = differences.shape[2]
    known, touching, side = np.empty(width, np.int8), np.empty(width, np.int8), np.empty(width, np.int8)
    for row in range(first, end):
        known[:], touching[:], side[:] = 0, 0, 0
        for direction in range(4):
            down, right = DOWN[direction], RIGHT[direction]
            _count(differences[direction, row], touch, np.int8(1), known, touching, side)
            if row - down >= 0:
                reached = slice(max(0, right), width + min(0, right))
                start = slice(max(0, -right), width - max(0, right))
                back = differences[direction, row - down, start]
                _count(back, touch, np.int8(-1), known[reached], touching[reached], side[reached])
        for column in range(width):
            isolated[row, column] = _is_isolated(known[column], touching[column], side[column])


@kernel
def _count(
    differences: Differences,
    touch: int,
    sign: np.int8,
    known: _TouchCounts,
    touching: _TouchCounts,
    side: _TouchCounts,
) -> None:
    """Add a row of neighbours to the counts, all (n,) int8: so narrow numbers fill the processor's vectors best.

    Args:
        differences: to these neighbours, or from them.
        touch: least difference of neighbours that are not in touch.
        sign: 1 for differences to the neighbours, -1 for differences from them.
        known: number of neighbours that are measured.
        touching: number of neighbours that are in touch.
        side: number of neighbours above less that of those below, of those not in touch.
    """
    upper, lower = np.int8(touch), np.int8(-touch)
    for column in range(differences.size):
        difference = differences[column]
        is_known = np.int8(difference != MISSING)
        above, below = np.int8(difference >= upper), np.int8(difference <= lower)
        below &= is_known
        known[column] += is_known
        touching[column] += is_known - above - below
        side[column] += sign * (above - below)
