"""How far neighbours differ, in the surface's own spread: the distance in which the adaptive mode measures touch.

A jump is the difference of two neighbours' heights less what the surface does there anyway: its local slope, or,
where that foretells the difference much better, the differences next to it on the same line. Each direction has a
spread, each tile a factor to it; both are of the core of the jumps, so that neither outliers nor edges widen them.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.compiled import kernel
from socialcircle_ros.threads import in_bands

Heights = npt.NDArray[np.float32]
Jumps = npt.NDArray[np.int8]

UNIT = 16
"""Jumps are kept in sixteenths of the spread, in 8 bits: nothing asks how far beyond ±7.9 they go."""
NONE = -128
"""Where there is no jump: a point of the two is not measured, or is outside."""

_BLOCK = 8
"""Side of the blocks whose median difference is the local slope, in points."""
_TRUNCATION = 2.5
"""The core of a distribution: within so many spreads."""
_CORE = 0.6647
"""Median of the absolute values of a normal distribution of spread 1, truncated at `_TRUNCATION`."""
_LOW = 0.2533
"""Quantile .2 of the absolute values of a normal distribution of spread 1."""
_FORETOLD = 0.5
"""Neighbouring differences foretell a difference where the median error is below this share of the plain one."""
_CALMEST = 0.5
"""A tile's spread is at least this share of the cloud's: calm is not suspicious."""
_ONE_LEVEL = 0.98
"""A cloud of which more lies at one height is that plane, and what is off it is off it by no step."""
_SAMPLES = 60_000
"""Jumps that a direction's spread is taken from."""
_SMALLEST = UNIT / float(np.finfo(np.float32).max)
"""Jumps in a smaller spread would be infinite in float32, and those of 0 none at all."""


@dataclass(frozen=True)
class Scale:
    """What jumps of a cloud are measured in.

    Attributes:
        slopes: (2, h, w) float32, differences from point to point along x and along y, per block.
        spreads: (4,) float64, of the jumps to the right, down, down right and down left, in the cloud's unit.
        tiles: (h, w) float32, factor to the spread in each tile.
        tile: side of a tile, in points.
        foretold: whether jumps are taken against the differences beside them, not against the slope.
    """

    slopes: npt.NDArray[np.float32]
    spreads: npt.NDArray[np.float64]
    tiles: npt.NDArray[np.float32]
    tile: int
    foretold: bool


def scale_of(heights: Heights, tile: int, *, may_foretell: bool) -> Scale:
    """The surface's own spread.

    Args:
        heights: (H, W) float32, NaN where not measured.
        tile: side of the tiles, in points.
        may_foretell: whether jumps may be taken against the differences beside them.
    """
    height, width = heights.shape
    slopes = _block_slopes(heights)
    slopes = np.stack([_median_of_blocks(slopes[0], 0.0), _median_of_blocks(slopes[1], 0.0)])
    stride = max(1, height * width // _SAMPLES)
    plain = [_sampled(heights, slopes, direction, stride, False) for direction in range(4)]
    samples, foretold = plain, False
    if may_foretell:
        beside = [_sampled(heights, slopes, direction, stride, True) for direction in range(4)]
        foretold = _middle(beside) < _FORETOLD * _middle(plain)
        if foretold:
            # A difference that is the median of those beside it foretells itself: that says nothing of the spread.
            samples = [jumps[jumps != 0] for jumps in beside]
    least = max(_quantum(heights), _rounding(heights), _SMALLEST)
    spreads = np.array([max(_core_spread(jumps), least) for jumps in samples])
    tiles = np.concatenate(
        in_bands(
            lambda rows: _tile_spreads(heights, slopes, spreads, tile, foretold, rows.start, rows.stop),
            -(-height // tile),
            width * tile,
        )
    )
    tiles = np.maximum(tiles, np.float32(max(_CALMEST, least / spreads.min())))
    # A small rough area is not to be smoothed away: there its own spread counts.
    tiles = np.fmax(_median_of_blocks(tiles, 1.0), tiles)
    return Scale(slopes, spreads, tiles, tile, foretold)


def jumps_of(heights: Heights, scale: Scale) -> Jumps:
    """Jumps from each point to the right, down, down right and down left.

    Args:
        heights: (H, W) float32, NaN where not measured.
        scale: what to measure them in.

    Returns:
        (4, H, W) int8 in sixteenths of the spread, `NONE` where there is no neighbour.
    """
    jumps: Jumps = np.empty((4, *heights.shape), np.int8)

    def fill(rows: slice) -> None:
        _fill_jumps(
            heights,
            scale.slopes,
            scale.spreads,
            scale.tiles,
            scale.tile,
            scale.foretold,
            rows.start,
            rows.stop,
            jumps,
        )

    in_bands(fill, *heights.shape)
    return jumps


def _middle(samples: list[npt.NDArray[np.float32]]) -> float:
    return float(np.mean([np.median(np.abs(jumps)) if jumps.size else 0.0 for jumps in samples]))


def _core_spread(jumps: npt.NDArray[np.float32]) -> float:
    """Standard deviation of the normal core of the jumps, however many lie far off; 0 where there is none."""
    sizes = np.sort(np.abs(jumps))
    if sizes.size == 0:
        return 0.0
    return float(_core(sizes))


def _quantum(heights: Heights) -> float:
    """The step between heights that are stored in steps: what rounding does to a difference; else next to 0."""
    flat = heights.ravel()
    sample = flat[:: max(1, flat.size // _SAMPLES)]
    sample = sample[np.isfinite(sample)]
    levels, counts = np.unique(sample, return_counts=True)
    if levels.size < 2 or counts.max() > _ONE_LEVEL * sample.size:
        return 0.0
    return float(np.median(np.diff(levels.astype(np.float64))))


def _rounding(heights: Heights) -> float:
    """What float32 cannot tell apart at the height of the cloud; next to 0 for one at height 0."""
    flat = heights.ravel()
    sample = np.abs(flat[:: max(1, flat.size // _SAMPLES)])
    sample = sample[np.isfinite(sample)]
    return float(np.spacing(np.float32(np.median(sample)))) if sample.size else float(np.finfo(np.float32).tiny)


@kernel
def _core(sizes: Any) -> Any:
    """Spread of the core of sorted absolute values: the median of what is within 2.5 spreads, till it rests."""
    count = sizes.size
    spread = sizes[int(0.2 * (count - 1))] / _LOW
    for _ in range(8):
        within = np.searchsorted(sizes, _TRUNCATION * spread, 'right')
        if not spread > 0 or within == 0:
            break
        spread = sizes[(within - 1) // 2] / _CORE
    return spread


@kernel
def _block_slopes(heights: Any) -> Any:
    """(2, h, w): median difference along x, and along y, in blocks; NaN where too few are measured.

    Every other row of a block is enough.
    """
    height, width = heights.shape
    rows, columns = (height + _BLOCK - 1) // _BLOCK, (width + _BLOCK - 1) // _BLOCK
    slopes = np.full((2, rows, columns), np.nan, np.float32)
    found = np.empty(_BLOCK * _BLOCK, np.float32)
    for axis in range(2):
        down, right = axis, 1 - axis
        for row in range(rows):
            for column in range(columns):
                count = 0
                for y in range(row * _BLOCK, min(height - down, (row + 1) * _BLOCK), 2):
                    for x in range(column * _BLOCK, min(width - right, (column + 1) * _BLOCK)):
                        difference = heights[y + down, x + right] - heights[y, x]
                        if not np.isnan(difference):
                            found[count] = difference
                            count += 1
                if count >= _BLOCK:
                    slopes[axis, row, column] = np.median(found[:count])
    return slopes


@kernel
def _median_of_blocks(blocks: Any, otherwise: float) -> Any:
    """Median of each block and those round it, where any is known."""
    rows, columns = blocks.shape
    smooth = np.empty_like(blocks)
    found = np.empty(9, np.float32)
    for row in range(rows):
        for column in range(columns):
            count = 0
            for y in range(max(0, row - 1), min(rows, row + 2)):
                for x in range(max(0, column - 1), min(columns, column + 2)):
                    if not np.isnan(blocks[y, x]):
                        found[count] = blocks[y, x]
                        count += 1
            smooth[row, column] = np.median(found[:count]) if count else otherwise
    return smooth


@kernel
def _interpolated(blocks: Any, side: int, row: int, values: Any) -> None:
    """One row of points out of a grid of blocks, bilinear between their centres."""
    rows, columns = blocks.shape
    down = min(max((row + 0.5) / side - 0.5, 0.0), rows - 1.0)
    above = int(down)
    down -= above
    below = min(above + 1, rows - 1)
    for column in range(values.size):
        right = min(max((column + 0.5) / side - 0.5, 0.0), columns - 1.0)
        before = int(right)
        right -= before
        after = min(before + 1, columns - 1)
        upper = blocks[above, before] * (1 - right) + blocks[above, after] * right
        lower = blocks[below, before] * (1 - right) + blocks[below, after] * right
        values[column] = upper * (1 - down) + lower * down


@kernel
def _middle_of_five(a: Any, b: Any, c: Any, d: Any, e: Any) -> Any:
    low, high = max(min(a, b), min(c, d)), min(max(a, b), max(c, d))
    return max(min(low, high), min(max(low, high), e))


@kernel
def _raw_jumps(
    heights: Any, slope_x: Any, slope_y: Any, direction: int, row: int, foretold: bool, jumps: Any
) -> None:
    """Jumps of one row of points in one direction, in the cloud's unit; NaN where there is none."""
    height, width = heights.shape
    down = 0 if direction == 0 else 1
    right = (1, 0, 1, -1)[direction]
    jumps[:] = np.nan
    if row + down >= height:
        return
    along_x, along_y = np.float32(right), np.float32(down)
    for column in range(max(0, -right), width - max(0, right)):
        jumps[column] = (
            heights[row + down, column + right]
            - heights[row, column]
            - (along_x * slope_x[column] + along_y * slope_y[column])
        )
    if not foretold or row - 2 * down < 0 or row + 3 * down >= height:
        return
    first, last = (2 if right > 0 else 3) * abs(right), (3 if right > 0 else 2) * abs(right)
    for column in range(first, width - last):
        second = heights[row - 2 * down, column - 2 * right]
        before = heights[row - down, column - right]
        here = heights[row, column]
        there = heights[row + down, column + right]
        after = heights[row + 2 * down, column + 2 * right]
        furthest = heights[row + 3 * down, column + 3 * right]
        # Where one of the six is not measured, the slope has to do.
        if not np.isnan((second + before + here) + (there + after + furthest)):
            difference = there - here
            jumps[column] = difference - _middle_of_five(
                before - second, here - before, difference, after - there, furthest - after
            )


@kernel
def _sampled(heights: Any, slopes: Any, direction: int, stride: int, foretold: bool) -> Any:
    """Jumps in one direction on every `stride`-th row, those that there are."""
    height, width = heights.shape
    slope_x, slope_y, jumps = np.empty(width, np.float32), np.empty(width, np.float32), np.empty(width, np.float32)
    found = np.empty(((height + stride - 1) // stride) * width, np.float32)
    count = 0
    for row in range(0, height, stride):
        _interpolated(slopes[0], _BLOCK, row, slope_x)
        _interpolated(slopes[1], _BLOCK, row, slope_y)
        _raw_jumps(heights, slope_x, slope_y, direction, row, foretold, jumps)
        for column in range(width):
            if not np.isnan(jumps[column]):
                found[count] = jumps[column]
                count += 1
    return found[:count]


@kernel
def _tile_spreads(heights: Any, slopes: Any, spreads: Any, tile: int, foretold: bool, first: int, end: int) -> Any:
    """(tiles down, tiles across): spread of the jumps along x and y in each tile, against the cloud's, or NaN.

    Every third row of a tile is enough.
    """
    height, width = heights.shape
    columns = (width + tile - 1) // tile
    factors = np.full((end - first, columns), np.nan, np.float32)
    slope_x, slope_y, jumps = np.empty(width, np.float32), np.empty(width, np.float32), np.empty(width, np.float32)
    room = 2 * tile * ((tile + 2) // 3)
    found = np.empty((columns, room), np.float32)
    counts = np.empty(columns, np.int64)
    for band in range(first, end):
        counts[:] = 0
        for row in range(band * tile, min(height, (band + 1) * tile), 3):
            _interpolated(slopes[0], _BLOCK, row, slope_x)
            _interpolated(slopes[1], _BLOCK, row, slope_y)
            for direction in range(2):
                _raw_jumps(heights, slope_x, slope_y, direction, row, foretold, jumps)
                for column in range(width):
                    size = abs(jumps[column]) / spreads[direction]
                    if not np.isnan(size) and not (foretold and size == 0):
                        place = column // tile
                        found[place, counts[place]] = size
                        counts[place] += 1
        for place in range(columns):
            if counts[place] >= room // 4:
                factors[band - first, place] = _core(np.sort(found[place, : counts[place]]))
    return factors


@kernel
def _fill_jumps(
    heights: Any,
    slopes: Any,
    spreads: Any,
    tiles: Any,
    tile: int,
    foretold: bool,
    first: int,
    end: int,
    jumps: Any,
) -> None:
    """Jumps of a band of rows, in sixteenths of the spread."""
    width = heights.shape[1]
    slope_x, slope_y = np.empty(width, np.float32), np.empty(width, np.float32)
    factor, raw = np.empty(width, np.float32), np.empty(width, np.float32)
    for row in range(first, end):
        _interpolated(slopes[0], _BLOCK, row, slope_x)
        _interpolated(slopes[1], _BLOCK, row, slope_y)
        _interpolated(tiles, tile, row, factor)
        for direction in range(4):
            _raw_jumps(heights, slope_x, slope_y, direction, row, foretold, raw)
            unit = np.float32(UNIT / spreads[direction])
            for column in range(width):
                jump = raw[column] * unit / factor[column]
                if not np.isnan(jump):
                    clipped = min(max(jump, np.float32(-127)), np.float32(127))
                    jumps[direction, row, column] = np.int8(np.rint(clipped))
                else:
                    jumps[direction, row, column] = NONE
