# SPDX-License-Identifier: Apache-2.0
"""What the depth of field says of a cloud that was a focus stack: which islands are outliers, and where walls are.

The uncertainty of focus variation is a share of the depth of field. Where the texture is poor, a patch of points
may lie off by many spreads and still be within that uncertainty. Beside a wall the window of the focus measure
sees two surfaces, and returns the height of the sharper one.
"""

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask
from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .heights import RelativeHeights, with_holes_filled

TOLERANCE = 0.37
"""Share of the depth of field that a height may be off: good points are within 0.25, outliers beyond 0.5."""
WALL = 1.5
"""Share of the depth of field that neighbours differ by where the surface between them was not seen."""

_GREATEST = float(np.finfo(np.float32).max)
_STRIDE, _STRIDES = 4, 2
"""The surroundings of a point: every fourth point, two in each direction."""
_NEAR = 2
"""Distance in points from an outlier within which points are tested as well: they may be its flanks."""
_BESIDE = 1
"""Points beyond the two ends of a step: their windows of the focus measure see both surfaces."""


def beyond_tolerance(heights: RelativeHeights, found: Mask, depth_of_field: float) -> Mask:
    """Find the outliers, and points next to them, that differ from their surroundings by more than the tolerance.

    Args:
        heights: (H, W) float32, NaN where not measured.
        found: (H, W) bool, the outliers by the heights alone.
        depth_of_field: of the optics, in the unit of the heights.

    Returns:
        (H, W) bool.
    """
    surface = with_holes_filled(heights, found)
    candidates: Mask = np.zeros(found.shape, np.bool_)
    _mark_near(np.flatnonzero(found), np.isfinite(heights), candidates)
    beyond: Mask = np.zeros(found.shape, np.bool_)
    limit = np.float32(min(TOLERANCE * depth_of_field, _GREATEST))
    in_bands(
        lambda rows: _compare(heights, candidates, surface, limit, rows.start, rows.stop, beyond), *found.shape
    )
    return beyond


def beside_walls(heights: RelativeHeights, found: Mask, depth_of_field: float) -> Mask:
    """Find the points next to a step between two surfaces: what lies between them was not seen.

    Args:
        heights: (H, W) float32, NaN where not measured.
        found: (H, W) bool, the outliers; steps up to these do not count.
        depth_of_field: of the optics, in the unit of the heights.

    Returns:
        (H, W) bool, of measured points.
    """
    measured: Mask = np.isfinite(heights)
    surface = with_holes_filled(heights, found | ~measured)
    beside: Mask = np.zeros(found.shape, np.bool_)
    limit = np.float32(min(WALL * depth_of_field, _GREATEST))
    # In one thread: a band would also mark points of its neighbours.
    for down in (0, 1):
        _mark_walls(surface, down, limit, beside)
    return beside & measured


@kernel
def _mark_near(places: npt.NDArray[np.intp], measured: Mask, near: Mask) -> None:
    """Mark the measured points near to some places, (n,), which are numbered in row order."""
    height, width = measured.shape
    for place in places:
        row, column = place // width, place % width
        for y in range(max(row - _NEAR, 0), min(row + _NEAR + 1, height)):
            for x in range(max(column - _NEAR, 0), min(column + _NEAR + 1, width)):
                near[y, x] = measured[y, x]


@kernel
def _compare(
    heights: RelativeHeights,
    candidates: Mask,
    surface: RelativeHeights,
    limit: np.float32,
    first: int,
    end: int,
    beyond: Mask,
) -> None:
    """Compare the candidates of some rows with the median of the `surface` around them."""
    height, width = heights.shape
    values = np.empty((2 * _STRIDES + 1) ** 2, np.float32)
    for row in range(first, end):
        for column in range(width):
            if not candidates[row, column]:
                continue
            # The surroundings are symmetric, so that a slope does not matter.
            up = _STRIDE * min(_STRIDES, min(row, height - 1 - row) // _STRIDE)
            left = _STRIDE * min(_STRIDES, min(column, width - 1 - column) // _STRIDE)
            count = 0
            for y in range(row - up, row + up + 1, _STRIDE):
                for x in range(column - left, column + left + 1, _STRIDE):
                    if not np.isnan(surface[y, x]):
                        values[count] = surface[y, x]
                        count += 1
            # A point without known surroundings has nothing that supports it.
            beyond[row, column] = count == 0 or abs(heights[row, column] - np.median(values[:count])) > limit


@kernel
def _mark_walls(surface: RelativeHeights, down: int, limit: np.float32, beside: Mask) -> None:
    """Mark the two ends of each step along one axis (down: 1; right: 0), and the points next to them."""
    height, width = surface.shape
    right = 1 - down
    five = np.empty(5, np.float32)
    for row in range(height - down):
        for column in range(width - right):
            difference = surface[row + down, column + right] - surface[row, column]
            if not abs(difference) > limit:
                continue
            for place in range(5):
                # Differences beyond the border are those at the border.
                y = min(max(row + (place - 2) * down, 0), height - 1 - down)
                x = min(max(column + (place - 2) * right, 0), width - 1 - right)
                five[place] = surface[y + down, x + right] - surface[y, x]
            # A slope is steep on both sides too. An unknown difference decides for keeping the points.
            if not np.isnan(five.sum()) and abs(difference - np.median(five)) > limit:
                for y in range(max(row - _BESIDE, 0), min(row + down + _BESIDE + 1, height)):
                    for x in range(max(column - _BESIDE, 0), min(column + right + _BESIDE + 1, width)):
                        beside[y, x] = True
