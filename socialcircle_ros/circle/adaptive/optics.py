"""What the depth of field says of a cloud that was a focus stack: which islands are outliers, and where walls are.

Focus variation promises heights to a share of the depth of field. Where the texture is poor a patch of points
lies off by many spreads and still keeps that promise; beside a wall the window of the focus measure sees two
surfaces, and the height is that of the sharper one.
"""

from typing import Any

import numpy as np

from socialcircle_ros.cloud import Mask
from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .differences import Heights
from .isolated import with_holes_filled

TOLERANCE = 0.37
"""Share of the depth of field that a height may be off: good points are within 0.25 of it, outliers beyond 0.5."""
WALL = 1.5
"""Share of the depth of field that neighbours differ by where the surface between them was not seen."""

_MOST = float(np.finfo(np.float32).max)
_STRIDE, _STRIDES = 4, 2
"""The surroundings of a point: every fourth point, two in each direction."""
_NEAR = 2
"""Points round an outlier that are looked at as well: flanks that the heights alone do not tell."""
_BESIDE = 1
"""Points beyond the two ends of a step that see both its surfaces."""


def beyond_tolerance(heights: Heights, found: Mask, depth_of_field: float) -> Mask:
    """Outliers, and points next to them, that are further off their surroundings than the optics promise.

    Args:
        heights: (H, W) float32, NaN where not measured.
        found: (H, W) bool, what the heights alone tell from the surface.
        depth_of_field: of the optics, in the unit of the heights.

    Returns:
        (H, W) bool.
    """
    surface = with_holes_filled(heights, found)
    doubtful: Mask = np.zeros(found.shape, np.bool_)
    _mark_near(np.flatnonzero(found), np.isfinite(heights), doubtful)
    broken: Mask = np.zeros(found.shape, np.bool_)

    limit = np.float32(min(TOLERANCE * depth_of_field, _MOST))

    def compare(rows: slice) -> None:
        _compare(heights, doubtful, surface, limit, rows.start, rows.stop, broken)

    in_bands(compare, *found.shape)
    return broken


def beside_walls(heights: Heights, found: Mask, depth_of_field: float) -> Mask:
    """Points next to a step between two surfaces that both last: what lies between was not seen.

    Args:
        heights: (H, W) float32, NaN where not measured.
        found: (H, W) bool, the outliers: steps up to those do not count.
        depth_of_field: of the optics, in the unit of the heights.

    Returns:
        (H, W) bool, of measured points.
    """
    measured: Mask = np.isfinite(heights)
    surface = with_holes_filled(heights, found | ~measured)
    beside: Mask = np.zeros(found.shape, np.bool_)
    # Each band marks points of its neighbours as well: one thread.
    for down in (0, 1):
        _mark_walls(surface, down, np.float32(min(WALL * depth_of_field, _MOST)), beside)
    return beside & measured


@kernel
def _mark_near(places: Any, measured: Any, near: Any) -> None:
    height, width = measured.shape
    for place in places:
        row, column = place // width, place % width
        for y in range(max(row - _NEAR, 0), min(row + _NEAR + 1, height)):
            for x in range(max(column - _NEAR, 0), min(column + _NEAR + 1, width)):
                near[y, x] = measured[y, x]


@kernel
def _compare(heights: Any, doubtful: Any, surface: Any, limit: Any, first: int, end: int, broken: Any) -> None:
    height, width = heights.shape
    values = np.empty((2 * _STRIDES + 1) ** 2, np.float32)
    for row in range(first, end):
        for column in range(width):
            if not doubtful[row, column]:
                continue
            # As far on one side as on the other, so that a slope does not matter.
            up = _STRIDE * min(_STRIDES, min(row, height - 1 - row) // _STRIDE)
            left = _STRIDE * min(_STRIDES, min(column, width - 1 - column) // _STRIDE)
            count = 0
            for y in range(row - up, row + up + 1, _STRIDE):
                for x in range(column - left, column + left + 1, _STRIDE):
                    if not np.isnan(surface[y, x]):
                        values[count] = surface[y, x]
                        count += 1
            # Where nothing is left all round it, nothing speaks for the point.
            broken[row, column] = count == 0 or abs(heights[row, column] - np.median(values[:count])) > limit


@kernel
def _mark_walls(surface: Any, down: int, limit: Any, beside: Any) -> None:
    """Mark the ends of each step along one axis, and what is next to them."""
    height, width = surface.shape
    right = 1 - down
    five = np.empty(5, np.float32)
    for row in range(height - down):
        for column in range(width - right):
            difference = surface[row + down, column + right] - surface[row, column]
            if not abs(difference) > limit:
                continue
            for place in range(5):
                # Beyond the border as at the border.
                y = min(max(row + (place - 2) * down, 0), height - 1 - down)
                x = min(max(column + (place - 2) * right, 0), width - 1 - right)
                five[place] = surface[y + down, x + right] - surface[y, x]
            # A slope is steep on both sides too. Where one of the five is not known, nothing can be said.
            if not np.isnan(five.sum()) and abs(difference - np.median(five)) > limit:
                for y in range(max(row - _BESIDE, 0), min(row + down + _BESIDE + 1, height)):
                    for x in range(max(column - _BESIDE, 0), min(column + right + _BESIDE + 1, width)):
                        beside[y, x] = True
