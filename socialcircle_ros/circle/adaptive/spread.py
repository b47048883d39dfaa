# SPDX-License-Identifier: Apache-2.0
"""The spread of the differences between neighbours, estimated from the cloud itself.

Each direction has a spread and each tile has a factor to it. Both are of the core of the distribution, so that
neither outliers nor edges widen them.
"""

import itertools

import numpy as np
import numpy.typing as npt

from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.kernels.order_statistics import sorted_values
from socialcircle_ros.kernels.sampling import SAMPLES, sampled_rows
from socialcircle_ros.kernels.sorting_networks import Comparators, run_network, sort_network

from .blocks import Blocks, median_of_blocks
from .differences import STEPS_PER_SPREAD, Spread, Surface, load_differences
from .heights import RelativeHeights
from .slopes import Slopes, block_slopes, load_slopes

Sample = npt.NDArray[np.float32]
"""(n,) float32 without NaN."""

_TRUNCATION = 2.5
"""The core of a distribution lies within this many spreads."""
_CORE = 0.6647
"""Median of |x| for x normal with standard deviation 1, truncated at `_TRUNCATION`."""
_LOW = 0.2533
"""Quantile 0.2 of |x| for x normal with standard deviation 1."""
_ROUNDS = 8
_MUCH_BETTER = 0.5
"""Neighbouring differences predict a difference if the median error is below this share of that of the slope."""
_CALMEST = 0.5
"""Least factor of a tile: a calm tile is not suspicious."""
_ONE_LEVEL = 0.98
"""A cloud with a larger share of its points at one height is that plane: its heights are not stored in steps."""
_SAME_LEVEL = 4.0
"""Neighbouring heights of one level differ by at most so many times the resolution of float32: a mean of four is
rounded."""
_HIGH = 0.9
"""That is the resolution at this quantile of the heights' sizes, which a few outliers do not change."""
_SMALLEST = STEPS_PER_SPREAD / float(np.finfo(np.float32).max)
"""Least spread of all: below it normalised differences overflow float32, and those of 0 become NaN."""
_ROW_STRIDE = 3
"""Every third row of a tile is enough."""


def estimate_spread(heights: RelativeHeights, tile_side: int, *, may_predict: bool, step: float = 0.0) -> Spread:
    """Estimate the spread of the differences between neighbours.

    Args:
        heights: (H, W) float32, NaN where not measured.
        tile_side: side of the tiles in points.
        may_predict: whether differences may be predicted from those around them. Where they may, the choice is
            made once for the whole cloud.
        step: the spread is at least this, such as the `quantisation_step`.
    """
    slopes = block_slopes(heights)
    rows = sampled_rows(*heights.shape)
    surface = Surface(heights, Slopes.from_blocks(slopes, heights.shape[1]), predicted=False)
    sizes = _sampled_sizes(surface, rows)
    if may_predict:
        with_prediction = surface._replace(predicted=True)
        predicted_sizes = _sampled_sizes(with_prediction, rows)
        if _mean_median(predicted_sizes) < _MUCH_BETTER * _mean_median(sizes):
            # A difference that is the median of the five predicts itself: that says nothing of the spread.
            surface, sizes = with_prediction, [_above_zero(each) for each in predicted_sizes]
    least = max(_least_spread(heights.ravel()[:: max(1, heights.size // SAMPLES)]), step)
    by_direction = np.array([max(_core(each) if each.size else 0.0, least) for each in sizes])
    by_tile = _spread_by_tile(surface, by_direction, tile_side, max(_CALMEST, least / by_direction.min()))
    return Spread(slopes, by_direction, by_tile, tile_side, surface.predicted)


def _sampled_sizes(surface: Surface, rows: npt.NDArray[np.int64]) -> list[Sample]:
    """Absolute differences in each direction on some rows, each direction sorted."""

    def sizes(directions: slice) -> list[Sample]:
        return [
            sorted_values(np.abs(_sample_differences(surface, direction, rows)))
            for direction in range(4)[directions]
        ]

    return list(itertools.chain.from_iterable(in_bands(sizes, 4, rows.size * surface.heights.shape[1])))


def _mean_median(samples: list[Sample]) -> float:
    """Mean of the medians of sorted samples; an empty sample counts as 0."""
    return float(
        np.mean(
            [sizes[(sizes.size - 1) // 2 : sizes.size // 2 + 1].mean() if sizes.size else 0.0 for sizes in samples]
        )
    )


def _above_zero(sizes: Sample) -> Sample:
    """The part of a sorted sample that is above 0."""
    return sizes[np.searchsorted(sizes, 0, 'right') :]


def _least_spread(heights: RelativeHeights) -> float:
    """The spread that storage alone causes, in the cloud's unit; NaN heights do not count."""
    sample = heights[np.isfinite(heights)]
    rounding, largest = _roundings(sample)
    # Steps of a few roundings are seen by the first, levels that are rounded themselves by the second.
    return max(_quantum(sample, 0.0), _quantum(sample, _SAME_LEVEL * largest), rounding, _SMALLEST)


def _quantum(sample: Sample, same: float) -> float:
    """Step between heights that are stored in steps: what rounding does to a difference; else next to 0."""
    steps, most = _steps(sorted_values(sample), same)
    if steps.size == 0 or most > _ONE_LEVEL * sample.size:
        return 0.0
    return float(np.median(steps))


def _roundings(sample: Sample) -> tuple[float, float]:
    """Resolution of float32 at the median and at `_HIGH` of the sizes of the heights; next to 0 at height 0."""
    sizes = np.quantile(np.abs(sample), [0.5, _HIGH]) if sample.size else np.zeros(2)
    rounding, largest = np.spacing(sizes.astype(np.float32))
    return float(rounding), float(largest)


def _spread_by_tile(
    surface: Surface, by_direction: npt.NDArray[np.float64], tile_side: int, least: float
) -> Blocks:
    """(h, w) float32: factor to the spread in each tile, smoothed over 3×3 tiles."""
    height, width = surface.heights.shape
    room = 2 * tile_side * -(-tile_side // _ROW_STRIDE)  # along x and along y
    sort = sort_network(room, room)
    bands = in_bands(
        lambda rows: _tile_spreads(surface, by_direction, tile_side, room, sort, rows.start, rows.stop),
        -(-height // tile_side),
        width * tile_side,
    )
    tiles = np.maximum(np.concatenate(bands), np.float32(least))
    # Smoothing must not hide a small rough area: there its own spread counts.
    return np.fmax(median_of_blocks(tiles, 1.0), tiles)


@kernel
def _steps(heights: Sample, same: float) -> tuple[npt.NDArray[np.float64], int]:
    """Steps from level to level of sorted heights, (m,) float64, and the number of points of the fullest level.

    Heights of one level are at most `same` apart from the next.
    """
    steps = np.empty(max(heights.size - 1, 0))
    number, start, most = 0, 0, 0
    for place in range(heights.size):
        if np.float64(heights[place]) - np.float64(heights[max(place - 1, 0)]) > same:
            steps[number] = np.float64(heights[place]) - np.float64(heights[start])
            number += 1
            start = place
        most = max(most, place + 1 - start)
    return steps[:number], most


@kernel
def _core(sizes: Sample) -> float:
    """Standard deviation of the core of sorted absolute values: from the median of those within 2.5 spreads."""
    count = sizes.size
    spread = sizes[int(0.2 * (count - 1))] / _LOW
    for _ in range(_ROUNDS):
        within = np.searchsorted(sizes, _TRUNCATION * spread, 'right')
        if not spread > 0 or within == 0:
            break
        before, spread = spread, sizes[(within - 1) // 2] / _CORE
        if spread == before:
            break
    return float(spread)


@kernel
def _sample_differences(surface: Surface, direction: int, rows: npt.NDArray[np.int64]) -> Sample:
    """The differences in one direction on some rows that exist, in row order."""
    width = surface.heights.shape[1]
    slopes, line = np.empty((2, width), np.float32), np.empty(width, np.float32)
    found = np.empty(rows.size * width, np.float32)
    count = 0
    for row in rows:
        load_slopes(surface.slopes, row, slopes)
        load_differences(surface, slopes, direction, row, line)
        for column in range(width):
            if not np.isnan(line[column]):
                found[count] = line[column]
                count += 1
    return found[:count]


@kernel
def _tile_spreads(
    surface: Surface,
    by_direction: npt.NDArray[np.float64],
    tile_side: int,
    room: int,
    sort: Comparators,
    first: int,
    end: int,
) -> Blocks:
    """(end - first, w) float32: core spread of the differences along x and y in rows of tiles.

    It is relative to the cloud's spread, and NaN where a tile has too few differences. `room` is the greatest
    number of differences that are sampled in a tile; `sort` sorts as many.
    """
    height, width = surface.heights.shape
    columns = (width + tile_side - 1) // tile_side
    factors = np.full((end - first, columns), np.nan, np.float32)
    slopes, line = np.empty((2, width), np.float32), np.empty(width, np.float32)
    found, counts = np.empty((room, columns), np.float32), np.empty(columns, np.int64)
    for band in range(first, end):
        found[:], counts[:] = np.inf, 0
        start = 0
        for row in range(band * tile_side, min(height, (band + 1) * tile_side), _ROW_STRIDE):
            load_slopes(surface.slopes, row, slopes)
            for direction in range(2):
                load_differences(surface, slopes, direction, row, line)
                spread = by_direction[direction]
                for column in range(width):
                    line[column] = np.divide(abs(line[column]), spread)
                for place in range(columns):
                    for column in range(place * tile_side, min((place + 1) * tile_side, width)):
                        size = line[column]
                        if not np.isnan(size) and not (surface.predicted and size == 0):
                            found[start + column - place * tile_side, place] = size
                            counts[place] += 1
                start += tile_side
        run_network(sort, found, columns)
        for place in range(columns):
            if counts[place] >= room // 4:
                factors[band - first, place] = _core(found[: counts[place], place].copy())
    return factors
