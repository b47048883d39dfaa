"""How far neighbours differ, in the surface's own spread: the distance in which the adaptive mode measures touch.

A normalised difference is the difference of two neighbours' heights less the predicted difference: the local
slope, or, where that predicts much better, the median of the differences next to it on the same line. Each
direction has a spread, each tile a factor to it; both are of the core of the differences, so that neither
outliers nor edges widen them.
"""

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.kernels.order_statistics import median_of_sorted, sort_columns, sorted_values

Heights = npt.NDArray[np.float32]
Differences = npt.NDArray[np.int8]
Wide = npt.NDArray[np.float64]
"""A grid of blocks, each of its rows out to points."""

UNIT = 16
"""Differences are kept in sixteenths of the spread, in 8 bits: nothing asks how far beyond ±7.9 they go."""
NONE = -128
"""Where there is no difference: a point of the two is not measured, or is outside."""

_BLOCK = 8
"""Side of the blocks whose median difference is the local slope, in points."""
_TRUNCATION = 2.5
"""The core of a distribution: within so many spreads."""
_CORE = 0.6647
"""Median of the absolute values of a normal distribution of spread 1, truncated at `_TRUNCATION`."""
_LOW = 0.2533
"""Quantile .2 of the absolute values of a normal distribution of spread 1."""
_PREDICTED = 0.5
"""Neighbouring differences foretell a difference where the median error is below this share of the plain one."""
_CALMEST = 0.5
"""A tile's spread is at least this share of the cloud's: calm is not suspicious."""
_ONE_LEVEL = 0.98
"""A cloud of which more lies at one height is that plane, and what is off it is off it by no step."""
_SAMPLES = 60_000
"""Differences that a direction's spread is taken from."""
_SMALLEST = UNIT / float(np.finfo(np.float32).max)
"""Differences in a smaller spread would be infinite in float32, and those of 0 none at all."""


@dataclass(frozen=True)
class Spread:
    """What differences of a cloud are measured in.

    Attributes:
        slopes: (2, h, w) float32, differences from point to point along x and along y, per block.
        spreads: (4,) float64, of the differences to the right, down, down right and down left.
        tiles: (h, w) float32, factor to the spread in each tile.
        tile: side of a tile, in points.
        predicted: whether differences are taken against the differences beside them, not against the slope.
    """

    slopes: npt.NDArray[np.float32]
    spreads: npt.NDArray[np.float64]
    tiles: npt.NDArray[np.float32]
    tile: int
    predicted: bool


def estimate_spread(heights: Heights, tile: int, *, may_predict: bool) -> Spread:
    """The surface's own spread.

    Args:
        heights: (H, W) float32, NaN where not measured.
        tile: side of the tiles, in points.
        may_predict: whether differences may be taken against the differences beside them.
    """
    height, width = heights.shape
    blocks = in_bands(
        lambda rows: _block_slopes(heights, rows.start, rows.stop), -(-height // _BLOCK), _BLOCK * width
    )
    along_x, along_y = np.concatenate(blocks, axis=1)
    slopes = np.stack([_median_of_blocks(along_x, 0.0), _median_of_blocks(along_y, 0.0)])
    wide = widened(slopes[0], _BLOCK, width), widened(slopes[1], _BLOCK, width)
    stride = max(1, height * width // _SAMPLES)
    sizes, predicted = _sampled(heights, *wide, stride, predicted=False), False
    if may_predict:
        beside = _sampled(heights, *wide, stride, predicted=True)
        predicted = _middle(beside) < _PREDICTED * _middle(sizes)
        if predicted:
            # A difference that is the median of those beside it foretells itself: that says nothing of the spread.
            sizes = [differences[np.searchsorted(differences, 0, 'right') :] for differences in beside]
    sample = heights.ravel()[::stride]
    sample = sample[np.isfinite(sample)]
    least = max(_quantum(sample), _rounding(sample), _SMALLEST)
    # Of no differences there is no spread, and it is the least.
    spreads = np.array([max(_core(differences) if differences.size else 0.0, least) for differences in sizes])
    tiles = np.concatenate(
        in_bands(
            lambda rows: _tile_spreads(heights, *wide, spreads, tile, predicted, rows.start, rows.stop),
            -(-height // tile),
            width * tile,
        )
    )
    tiles = np.maximum(tiles, np.float32(max(_CALMEST, least / spreads.min())))
    # A small rough area is not to be smoothed away: there its own spread counts.
    tiles = np.fmax(_median_of_blocks(tiles, 1.0), tiles)
    return Spread(slopes, spreads, tiles, tile, predicted)


def normalised_differences(heights: Heights, scale: Spread) -> Differences:
    """Differences from each point to the right, down, down right and down left.

    Args:
        heights: (H, W) float32, NaN where not measured.
        scale: what to measure them in.

    Returns:
        (4, H, W) int8 in sixteenths of the spread, `NONE` where there is no neighbour.
    """
    differences: Differences = np.empty((4, *heights.shape), np.int8)
    width = heights.shape[1]
    wide = widened(scale.slopes[0], _BLOCK, width), widened(scale.slopes[1], _BLOCK, width)
    tiles = widened(scale.tiles, scale.tile, width)

    def fill(rows: slice) -> None:
        _fill_differences(
            heights, *wide, scale.spreads, tiles, scale.tile, scale.predicted, rows.start, rows.stop, differences
        )

    in_bands(fill, *heights.shape)
    return differences


def _sampled(
    heights: Heights, slopes_x: Wide, slopes_y: Wide, stride: int, *, predicted: bool
) -> list[npt.NDArray[np.float32]]:
    """Sorted absolute differences in each direction on every `stride`-th row, those that there are."""

    def sizes(directions: slice) -> list[npt.NDArray[np.float32]]:
        return [
            sorted_values(np.abs(_row_differences(heights, slopes_x, slopes_y, direction, stride, predicted)))
            for direction in range(4)[directions]
        ]

    return list(itertools.chain.from_iterable(in_bands(sizes, 4, heights.size // stride)))


def _middle(samples: list[npt.NDArray[np.float32]]) -> float:
    """Mean of the medians of sorted values; of none it is 0."""
    return float(
        np.mean(
            [
                differences[(differences.size - 1) // 2 : differences.size // 2 + 1].mean()
                if differences.size
                else 0.0
                for differences in samples
            ]
        )
    )


def _quantum(sample: npt.NDArray[np.float32]) -> float:
    """The step between heights that are stored in steps: what rounding does to a difference; else next to 0."""
    steps, most = _steps(sorted_values(sample))
    if steps.size == 0 or most > _ONE_LEVEL * sample.size:
        return 0.0
    return float(np.median(steps))


def _rounding(sample: npt.NDArray[np.float32]) -> float:
    """What float32 cannot tell apart at the height of the cloud; next to 0 for one at height 0."""
    return (
        float(np.spacing(np.float32(np.median(np.abs(sample)))))
        if sample.size
        else float(np.finfo(np.float32).tiny)
    )


@kernel
def _steps(heights: Any) -> Any:
    """Steps from level to level of sorted heights, float64, and how many are at one level at most."""
    steps = np.empty(max(heights.size - 1, 0))
    number, start, most = 0, 0, 0
    for place in range(heights.size):
        if heights[place] != heights[start]:
            steps[number] = np.float64(heights[place]) - np.float64(heights[start])
            number += 1
            start = place
        most = max(most, place + 1 - start)
    return steps[:number], most


@kernel
def _core(sizes: Any) -> Any:
    """Spread of the core of sorted absolute values: the median of what is within 2.5 spreads, till it rests."""
    count = sizes.size
    spread = sizes[int(0.2 * (count - 1))] / _LOW
    for _ in range(8):
        within = np.searchsorted(sizes, _TRUNCATION * spread, 'right')
        if not spread > 0 or within == 0:
            break
        before, spread = spread, sizes[(within - 1) // 2] / _CORE
        if spread == before:
            break
    return spread


@kernel
def _block_slopes(heights: Any, first: int, end: int) -> Any:
    """(2, end - first, w): median difference along x, and along y, in blocks; NaN where too few are measured.

    Every other row of a block is enough.
    """
    height, width = heights.shape
    columns = (width + _BLOCK - 1) // _BLOCK
    slopes = np.full((2, end - first, columns), np.nan, np.float32)
    found, counts = np.empty((_BLOCK * _BLOCK // 2, columns), np.float32), np.empty(columns, np.int64)
    for axis in range(2):
        down, right = axis, 1 - axis
        for row in range(first, end):
            found[:], counts[:] = np.inf, 0
            for line in range(_BLOCK // 2):
                y = row * _BLOCK + 2 * line
                if y >= height - down:
                    break
                here, there = heights[y, : width - right], heights[y + down, right:]
                for x in range(here.size):
                    difference = there[x] - here[x]
                    if not np.isnan(difference):
                        found[line * _BLOCK + x % _BLOCK, x // _BLOCK] = difference
                        counts[x // _BLOCK] += 1
            sort_columns(found)
            for column in range(columns):
                if counts[column] >= _BLOCK:
                    slopes[axis, row - first, column] = median_of_sorted(found, counts[column], column)
    return slopes


@kernel
def _median_of_blocks(blocks: Any, otherwise: float) -> Any:
    """Median of each block and those round it, where any is known."""
    rows, columns = blocks.shape
    smooth = np.empty_like(blocks)
    found, counts = np.empty((9, columns), np.float32), np.empty(columns, np.int64)
    for row in range(rows):
        found[:], counts[:] = np.inf, 0
        for place in range(9):
            y, right = row + place // 3 - 1, place % 3 - 1
            if 0 <= y < rows:
                for column in range(max(0, -right), columns - max(0, right)):
                    if not np.isnan(blocks[y, column + right]):
                        found[place, column] = blocks[y, column + right]
                        counts[column] += 1
        sort_columns(found)
        for column in range(columns):
            smooth[row, column] = median_of_sorted(found, counts[column], column) if counts[column] else otherwise
    return smooth


@kernel
def widened(blocks: Any, side: int, width: int) -> Any:
    """(h, width) float64: each row of a grid of blocks out to points, linear between the blocks' centres."""
    rows, columns = blocks.shape
    before, after, share = np.empty(width, np.int64), np.empty(width, np.int64), np.empty(width)
    for column in range(width):
        right = min(max((column + 0.5) / side - 0.5, 0.0), columns - 1.0)
        before[column] = int(right)
        after[column] = min(before[column] + 1, columns - 1)
        share[column] = right - before[column]
    wide = np.empty((rows, width))
    for row in range(rows):
        for column in range(width):
            right = share[column]
            wide[row, column] = blocks[row, before[column]] * (1 - right) + blocks[row, after[column]] * right
    return wide


@kernel
def interpolated(wide: Any, side: int, row: int, values: Any) -> None:
    """One row of points out of a widened grid of blocks: bilinear between their centres."""
    rows = wide.shape[0]
    down = min(max((row + 0.5) / side - 0.5, 0.0), rows - 1.0)
    above = int(down)
    down -= above
    upper, lower = wide[above], wide[min(above + 1, rows - 1)]
    for column in range(values.size):
        values[column] = upper[column] * (1 - down) + lower[column] * down


@kernel
def _middle_of_five(a: Any, b: Any, c: Any, d: Any, e: Any) -> Any:
    low, high = max(min(a, b), min(c, d)), min(max(a, b), max(c, d))
    return max(min(low, high), min(max(low, high), e))


@kernel
def _raw_differences(
    heights: Any, slope_x: Any, slope_y: Any, direction: int, row: int, predicted: bool, differences: Any
) -> None:
    """Differences of one row of points in one direction, in the cloud's unit; NaN where there is none."""
    height, width = heights.shape
    down = 0 if direction == 0 else 1
    right = (1, 0, 1, -1)[direction]
    differences[:] = np.nan
    if row + down >= height:
        return
    first, end = max(0, -right), width - max(0, right)
    if first >= end:
        return
    along_x, along_y = np.float32(right), np.float32(down)
    here, there = heights[row, first:end], heights[row + down, first + right : end + right]
    beside_x, beside_y, found = slope_x[first:end], slope_y[first:end], differences[first:end]
    for place in range(found.size):
        slope = along_x * beside_x[place] + along_y * beside_y[place]
        found[place] = there[place] - here[place] - slope
    if not predicted or row - 2 * down < 0 or row + 3 * down >= height:
        return
    first, end = (2 if right > 0 else 3) * abs(right), width - (3 if right > 0 else 2) * abs(right)
    if first >= end:
        return
    second = heights[row - 2 * down, first - 2 * right : end - 2 * right]
    before = heights[row - down, first - right : end - right]
    here, there = heights[row, first:end], heights[row + down, first + right : end + right]
    after = heights[row + 2 * down, first + 2 * right : end + 2 * right]
    furthest = heights[row + 3 * down, first + 3 * right : end + 3 * right]
    found = differences[first:end]
    for place in range(found.size):
        a, b, c = second[place], before[place], here[place]
        d, e, f = there[place], after[place], furthest[place]
        difference = (d - c) - _middle_of_five(b - a, c - b, d - c, e - d, f - e)
        # Where one of the six is not measured, the slope has to do.
        found[place] = found[place] if np.isnan((a + b + c) + (d + e + f)) else difference


@kernel
def _row_differences(
    heights: Any, slopes_x: Any, slopes_y: Any, direction: int, stride: int, predicted: bool
) -> Any:
    """Differences in one direction on every `stride`-th row, those that there are."""
    height, width = heights.shape
    slope_x, slope_y, differences = (
        np.empty(width, np.float32),
        np.empty(width, np.float32),
        np.empty(width, np.float32),
    )
    found = np.empty(((height + stride - 1) // stride) * width, np.float32)
    count = 0
    for row in range(0, height, stride):
        interpolated(slopes_x, _BLOCK, row, slope_x)
        interpolated(slopes_y, _BLOCK, row, slope_y)
        _raw_differences(heights, slope_x, slope_y, direction, row, predicted, differences)
        for column in range(width):
            if not np.isnan(differences[column]):
                found[count] = differences[column]
                count += 1
    return found[:count]


@kernel
def _tile_spreads(
    heights: Any, slopes_x: Any, slopes_y: Any, spreads: Any, tile: int, predicted: bool, first: int, end: int
) -> Any:
    """(tiles down, tiles across): spread of the differences in each tile, relative to the cloud's, or NaN.

    Every third row of a tile is enough.
    """
    height, width = heights.shape
    columns = (width + tile - 1) // tile
    factors = np.full((end - first, columns), np.nan, np.float32)
    slope_x, slope_y, differences = (
        np.empty(width, np.float32),
        np.empty(width, np.float32),
        np.empty(width, np.float32),
    )
    room = 2 * tile * ((tile + 2) // 3)
    found, counts = np.empty((room, columns), np.float32), np.empty(columns, np.int64)
    for band in range(first, end):
        found[:], counts[:] = np.inf, 0
        line = 0
        for row in range(band * tile, min(height, (band + 1) * tile), 3):
            interpolated(slopes_x, _BLOCK, row, slope_x)
            interpolated(slopes_y, _BLOCK, row, slope_y)
            for direction in range(2):
                _raw_differences(heights, slope_x, slope_y, direction, row, predicted, differences)
                spread = spreads[direction]
                for column in range(width):
                    differences[column] = np.divide(abs(differences[column]), spread)
                for place in range(columns):
                    for column in range(place * tile, min((place + 1) * tile, width)):
                        size = differences[column]
                        if not np.isnan(size) and not (predicted and size == 0):
                            found[line + column - place * tile, place] = size
                            counts[place] += 1
                line += tile
        sort_columns(found)
        for place in range(columns):
            if counts[place] >= room // 4:
                factors[band - first, place] = _core(found[: counts[place], place].copy())
    return factors


@kernel
def _fill_differences(
    heights: Any,
    slopes_x: Any,
    slopes_y: Any,
    spreads: Any,
    tiles: Any,
    tile: int,
    predicted: bool,
    first: int,
    end: int,
    differences: Any,
) -> None:
    """Differences of a band of rows, in sixteenths of the spread."""
    width = heights.shape[1]
    slope_x, slope_y = np.empty(width, np.float32), np.empty(width, np.float32)
    factor, raw = np.empty(width, np.float32), np.empty(width, np.float32)
    for row in range(first, end):
        interpolated(slopes_x, _BLOCK, row, slope_x)
        interpolated(slopes_y, _BLOCK, row, slope_y)
        interpolated(tiles, tile, row, factor)
        for direction in range(4):
            _raw_differences(heights, slope_x, slope_y, direction, row, predicted, raw)
            _quantize(raw, np.float32(UNIT / spreads[direction]), factor, differences[direction, row])


@kernel
def _quantize(raw: Any, unit: Any, factor: Any, differences: Any) -> None:
    """One row of differences in 8 bits."""
    for column in range(raw.size):
        # Nothing is divided by 0; but a plain `/` would make sure of that, and not be compiled to vectors.
        difference = np.divide(raw[column] * unit, factor[column])
        rounded = np.rint(min(max(difference, np.float32(-127)), np.float32(127)))
        differences[column] = np.int8(np.float32(NONE) if np.isnan(difference) else rounded)
