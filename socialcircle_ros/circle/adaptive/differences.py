# SPDX-License-Identifier: Apache-2.0
"""Normalised differences: how far neighbours differ, relative to the spread of the surface itself.

The difference of two neighbours' heights, less the difference that is predicted there, is divided by the spread of
such differences. The prediction is the local slope or, where that predicts much better, the median of the five
differences around it on the same line. The adaptive mode measures all touch in normalised differences.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.kernels.order_statistics import median_of_five

from .blocks import BlockRows, Blocks, interpolate_columns, interpolate_row
from .heights import RelativeHeights
from .slopes import BlockSlopes, Slopes, load_slopes

Differences = npt.NDArray[np.int8]
"""(4, H, W) int8: normalised differences to the neighbours on the right, below, below right and below left.

The unit is 1 / `STEPS_PER_SPREAD` of the spread. `MISSING` stands where one of the two points is not measured or
lies outside of the cloud."""

STEPS_PER_SPREAD = 16
"""Steps of a normalised difference per spread. 8 bits then reach ±7.9 spreads, and no rule needs more."""
MISSING = -128

DOWN, RIGHT = (0, 1, 1, 1), (1, 0, 1, -1)
"""Rows and columns from a point to its neighbour in each of the four directions."""


@dataclass(frozen=True, eq=False)
class Spread:
    """The standard deviation of the differences between neighbours, without outliers and edges.

    Attributes:
        slopes: (2, h, w) float32, slopes along x and along y in blocks, in the cloud's unit per point.
        by_direction: (4,) float64, spread to the right, down, down right and down left, in the cloud's unit.
        by_tile: (h, w) float32, factor to the spread in each tile.
        tile_side: side of a tile in points.
        predicted: whether differences are predicted from those around them, not from the slope.
    """

    slopes: BlockSlopes
    by_direction: npt.NDArray[np.float64]
    by_tile: Blocks
    tile_side: int
    predicted: bool


class Surface(NamedTuple):
    """What kernels need to compute differences.

    Attributes:
        heights: (H, W) float32, NaN where not measured.
        slopes: interpolated to the columns of the heights.
        predicted: as in `Spread`.
    """

    heights: RelativeHeights
    slopes: Slopes
    predicted: bool


def normalised_differences(heights: RelativeHeights, spread: Spread) -> Differences:
    """Compute the normalised differences from each point to the right, down, down right and down left.

    Args:
        heights: (H, W) float32, NaN where not measured.
        spread: of these heights.

    Returns:
        (4, H, W) int8 in steps of 1/16 spread, clipped to ±127; `MISSING` where there is no neighbour.
    """
    differences: Differences = np.empty((4, *heights.shape), np.int8)
    width = heights.shape[1]
    surface = Surface(heights, Slopes.from_blocks(spread.slopes, width), spread.predicted)
    factors = interpolate_columns(spread.by_tile, spread.tile_side, width)

    def normalise(rows: slice) -> None:
        _normalise(surface, spread.by_direction, factors, spread.tile_side, rows.start, rows.stop, differences)

    in_bands(normalise, *heights.shape)
    return differences


@kernel
def _normalise(
    surface: Surface,
    by_direction: npt.NDArray[np.float64],
    factors: BlockRows,
    tile_side: int,
    first: int,
    end: int,
    differences: Differences,
) -> None:
    """Write the normalised differences of the rows from `first` to before `end`."""
    width = surface.heights.shape[1]
    slopes = np.empty((2, width), np.float32)
    factor, raw = np.empty(width, np.float32), np.empty(width, np.float32)
    for row in range(first, end):
        load_slopes(surface.slopes, row, slopes)
        interpolate_row(factors, tile_side, row, factor)
        for direction in range(4):
            load_differences(surface, slopes, direction, row, raw)
            steps = np.float32(STEPS_PER_SPREAD / by_direction[direction])
            _quantise(raw, steps, factor, differences[direction, row])


@kernel
def _quantise(
    raw: npt.NDArray[np.float32], steps: np.float32, factor: npt.NDArray[np.float32], line: Differences
) -> None:
    """Write one row of differences in the cloud's unit, (W,), in steps of the spread to `line`, (W,)."""
    for column in range(raw.size):
        # No factor is 0. A plain `/` would test for it, and that test would prevent vectorisation.
        difference = np.divide(raw[column] * steps, factor[column])
        rounded = np.rint(min(max(difference, np.float32(-127)), np.float32(127)))
        line[column] = np.int8(np.float32(MISSING) if np.isnan(difference) else rounded)


@kernel
def load_differences(
    surface: Surface,
    slopes: npt.NDArray[np.float32],
    direction: int,
    row: int,
    line: npt.NDArray[np.float32],
) -> None:
    """Write the differences of one row of points in one direction, less their predictions.

    Args:
        surface: the heights and how their differences are predicted.
        slopes: (2, W) float32, the slopes of this row along x and along y.
        direction: 0 to 3: right, down, down right, down left.
        row: the row of the points.
        line: (W,) float32, receives the differences in the cloud's unit, NaN where there is none.
    """
    heights = surface.heights
    height, width = heights.shape
    down, right = DOWN[direction], RIGHT[direction]
    line[:] = np.nan
    if row + down >= height:
        return
    first, end = max(0, -right), width - max(0, right)
    if first >= end:
        return
    along_x, along_y = np.float32(right), np.float32(down)
    here, there = heights[row, first:end], heights[row + down, first + right : end + right]
    slope_x, slope_y, found = slopes[0, first:end], slopes[1, first:end], line[first:end]
    for place in range(found.size):
        slope = along_x * slope_x[place] + along_y * slope_y[place]
        found[place] = there[place] - here[place] - slope
    if not surface.predicted or row - 2 * down < 0 or row + 3 * down >= height:
        return
    first, end = (2 if right > 0 else 3) * abs(right), width - (3 if right > 0 else 2) * abs(right)
    if first >= end:
        return
    second = heights[row - 2 * down, first - 2 * right : end - 2 * right]
    before = heights[row - down, first - right : end - right]
    here, there = heights[row, first:end], heights[row + down, first + right : end + right]
    after = heights[row + 2 * down, first + 2 * right : end + 2 * right]
    furthest = heights[row + 3 * down, first + 3 * right : end + 3 * right]
    found = line[first:end]
    for place in range(found.size):
        a, b, c = second[place], before[place], here[place]
        d, e, f = there[place], after[place], furthest[place]
        difference = (d - c) - median_of_five(b - a, c - b, d - c, e - d, f - e)
        # The prediction by the slope stays where one of the six points is not measured.
        found[place] = found[place] if np.isnan((a + b + c) + (d + e + f)) else difference
