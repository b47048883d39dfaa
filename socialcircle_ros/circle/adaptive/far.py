# SPDX-License-Identifier: Apache-2.0
"""Points that stand far off: single ones on any surface, and islands on a plain one.

A network does not find single points in textures as fine as themselves, such as gratings, nor where most
neighbours are not measured. Hardly a texture that was measured has single points of its own so far off.

A large patch with sharp edges looks like a part of the surface to it. Whether the surface has such parts, only the
whole cloud tells: a plain surface has hardly a large step between neighbours, but for those at the border of such
patches, and at a few long edges.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask
from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .communities import label_communities
from .differences import DOWN, MISSING, RIGHT, STEPS_PER_SPREAD, Differences, Spread, normalised_differences
from .heights import RelativeHeights, with_holes_filled
from .islands import find_islands
from .isolated import isolated_among, isolated_points
from .relief import relief_of

ALONE, MOST_ALONE = 12.0, 0.1
"""A point is far off if it differs by so many spreads from its neighbours, as `isolated_points` counts them. If
more than this share of the points are, none is: then the spread is far below the noise."""
SUSPECTED_ALONE = 5.0
"""So many spreads are enough for a point that is suspected: two weak signs together are a strong one."""
NOTICED = 6.0
"""Anything is sought if two neighbours differ by so many spreads once the outliers are filled."""
LONG, NARROW = 48, 8
"""An edge extends over at least so many rows or columns, and has at most so many points for each of them: a circle
has 2 π, one column of points on either side of it."""
MOSTLY = 0.7
"""An island is known if at least this share of its points are outliers."""

_COARSER = 2
"""A step of the differences is so many times as large as elsewhere, so that 8 bits reach 15.9 spreads."""
_NEAR = 2
"""A step at most so many rows and columns from an outlier belongs to its border."""
_BLOCK = 64
"""Differences of a row that are looked through at once."""


class _Plain(NamedTuple):
    """How plain a surface is, and the islands that stand out from it.

    Attributes:
        share: at most this share of the pairs of neighbours differ by `large` spreads, without outliers and edges.
        hopeless: with a larger share before islands are found, the surface is not plain, whatever they are.
        large: in spreads.
        clip: a larger difference across the border of an island counts as this one, in spreads.
        steep: the steepness of an island is above this.
        rise: the points of an island rise further above their surroundings, in spreads.
    """

    share: float
    hopeless: float
    large: float
    clip: float
    steep: float
    rise: float


_PLAIN = _Plain(share=2e-3, hopeless=2e-2, large=12.0, clip=10.0, steep=0.95, rise=4.0)
_VERY_PLAIN = _Plain(share=2e-4, hopeless=5e-3, large=4.0, clip=4.0, steep=0.955, rise=2.0)
"""White noise is very plain: 0.6e-4 of its neighbours differ by 4 spreads."""


def far_points(heights: RelativeHeights, spread: Spread, outliers: Mask, suspected: Mask) -> Mask:
    """Find single points far off their neighbours, and the islands far off a plain surface.

    There are no such islands if the surface is not plain without them. On a very plain surface lower islands
    count, too, unless most of their points are known already: the outlines of these are better than those of
    islands.

    Args:
        heights: (H, W) float32, NaN where not measured.
        spread: of these heights, not predicted.
        outliers: (H, W) bool, measured points that are outliers whatever is found here.
        suspected: (H, W) bool, points that may be outliers.

    Returns:
        (H, W) bool.
    """
    filled = with_holes_filled(heights, outliers)
    differences = normalised_differences(filled, replace(spread, by_direction=_COARSER * spread.by_direction))
    measured = np.isfinite(filled)
    pairs = len(DOWN) * int(np.count_nonzero(measured))

    def steps(plain: _Plain, without: Mask) -> tuple[Mask, float]:
        """The points at large steps, and the share of the pairs of neighbours that have one."""
        points: Mask = np.zeros(heights.shape, np.bool_)
        least = _in_units(plain.large)
        counts = in_bands(
            lambda rows: _mark_steps(differences, least, without, rows.start, rows.stop, points), *heights.shape
        )
        return points, sum(counts) / max(pairs, 1)

    if not _has_step(differences.ravel(), _in_units(NOTICED)):
        return np.zeros(heights.shape, np.bool_)
    found = isolated_points(differences, ALONE / _COARSER)
    if np.count_nonzero(found) > MOST_ALONE * np.count_nonzero(measured):
        found[:] = False
    else:
        found |= isolated_among(suspected & ~outliers, differences, SUSPECTED_ALONE / _COARSER)
    outliers = outliers | found
    if steps(_PLAIN, outliers)[1] > _PLAIN.hopeless:
        return found
    relief = relief_of(differences)

    def islands_of(plain: _Plain) -> Mask:
        clip, rise = plain.clip / _COARSER, plain.rise / _COARSER
        islands, _ = find_islands(relief, differences, measured, clip, plain.steep, 1, rise)
        return islands & np.isfinite(heights)

    islands = islands_of(_PLAIN)
    known = outliers | _long_edges(steps(_PLAIN, outliers | islands)[0])
    if steps(_PLAIN, known | islands)[1] > _PLAIN.share:
        return found
    found |= islands
    if steps(_VERY_PLAIN, known | islands)[1] > _VERY_PLAIN.hopeless:
        return found
    lower = islands_of(_VERY_PLAIN)
    if steps(_VERY_PLAIN, known | lower)[1] <= _VERY_PLAIN.share:
        found |= _missed(lower, outliers)
    return found


def _long_edges(steps: Mask) -> Mask:
    """The edges among the points at steps: a wall is one edge of a plain surface, however long it is."""
    points, labels, number = label_communities(steps)
    extent = np.zeros(number, np.int64)
    for places in np.divmod(points, steps.shape[1]):
        first, last = np.full(number, steps.size), np.zeros(number, np.int64)
        np.minimum.at(first, labels, places)
        np.maximum.at(last, labels, places)
        extent = np.maximum(extent, last - first + 1)
    is_long = (extent >= LONG) & (np.bincount(labels, minlength=number) <= NARROW * extent)
    edges: Mask = np.zeros(steps.shape, np.bool_)
    edges.flat[points] = is_long[labels]
    return edges


def _missed(islands: Mask, outliers: Mask) -> Mask:
    """The islands of which less than `MOSTLY` are outliers already."""
    points, labels, number = label_communities(islands)
    share = np.bincount(labels, outliers.flat[points], number) / np.bincount(labels, minlength=number)
    missed: Mask = np.zeros(islands.shape, np.bool_)
    missed.flat[points] = (share < MOSTLY)[labels]
    return missed


def _in_units(spreads: float) -> int:
    """So many spreads, in the unit of the coarser differences."""
    return round(spreads / _COARSER * STEPS_PER_SPREAD)


@kernel
def _mark_steps(
    differences: Differences, least: int, outliers: Mask, first_row: int, end: int, points: Mask
) -> int:
    """Mark the kept points at differences of at least `least`, not near an outlier, and count the differences.

    The differences are those of the rows from `first_row` to before `end`; points of the next row are marked, too.
    """
    _, height, width = differences.shape
    count = 0
    for direction in range(4):
        down, right = DOWN[direction], RIGHT[direction]
        for row in range(first_row, min(end, height - down)):
            line = differences[direction, row]
            for first in range(0, width, _BLOCK):
                if not _has_step(line[first : first + _BLOCK], least):
                    continue
                for column in range(first, min(first + _BLOCK, width)):
                    if line[column] == MISSING or abs(line[column]) < least:
                        continue
                    if not outliers[row + down, column + right] and not _is_near(outliers, row, column):
                        points[row, column] = points[row + down, column + right] = True
                        count += 1
    return count


@kernel
def _has_step(line: npt.NDArray[np.int8], least: int) -> bool:
    """Whether a difference is at least `least`; has no branches, so that it becomes vector instructions."""
    upper, lower, found = np.int8(least), np.int8(-least), np.int8(0)
    for difference in line:
        found |= np.int8(difference >= upper) | (np.int8(difference <= lower) & np.int8(difference != MISSING))
    return bool(found)


@kernel
def _is_near(outliers: Mask, row: int, column: int) -> bool:
    """Whether an outlier is at most `_NEAR` rows and columns away."""
    height, width = outliers.shape
    for y in range(max(0, row - _NEAR), min(height, row + _NEAR + 1)):
        for x in range(max(0, column - _NEAR), min(width, column + _NEAR + 1)):
            if outliers[y, x]:
                return True
    return False
