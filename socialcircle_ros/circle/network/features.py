# SPDX-License-Identifier: Apache-2.0
"""What the network sees of a height map: six channels for each point, and one number for the cloud, the grain.

Every channel is a difference of heights relative to the spread s of the cloud, so that unit, offset and tilt of
the heights do not matter:

- the height less its median 5×5, and less the means of such medians over 17×17 and 65×65 measured points;
- the second differences along x and along y;
- whether the point is measured.

All but the last pass through L(v) = sign(v) · log2(1 + |v|), linear between powers of two.

The network works at half the resolution and with 8 bits: `squares_of` gives it that. The training needs the
numbers before they are rounded: `channels_of`.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from socialcircle_ros.circle.adaptive.heights import RelativeHeights
from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.kernels.order_statistics import median_of_five

from .scales import Scales, scales_of

CHANNELS = 6
CHANNELS_VERSION = '4'
"""Version of what the channels hold, scales included: a corpus of another version is refused."""
INPUTS = 4 * (CHANNELS + 1)
"""Numbers of a square: one for each channel and point, and four for the grain. ONNX Runtime convolves 28 planes of
8 bits in less time than 25."""
MARGIN = 36
"""Points around a part of the cloud that its features depend on: half of the wide window, median and rings."""

_NARROW, _WIDE = 8, 32
"""Half of the windows, in points."""
_STEPS = 1024.0
"""Means are sums of whole steps of s / 1024: exact in any order, so that bands and tiles change nothing."""
_HIGHEST = 2.0**30
"""Heights are clipped here before they are summed, in s: sums of 65×65 steps stay below 2⁵³."""
_GREATEST = np.float32(65536)
_ONE = np.int32(0x3F800000)
"""The bits of 1 in float32."""
_PER_STEP = np.float32(2.0**-23)

Channels = npt.NDArray[np.float32]
"""(6, H, W) float32, 0 where not measured."""
Squares = npt.NDArray[np.uint8]
"""(h, w, 28) uint8: squares of 2×2 points. Number 4·channel + 2·(row & 1) + (column & 1) is a channel of one of
its points, rounded; the last four are the grain."""
_Level = npt.NDArray[np.float32]
_Values = npt.NDArray[np.float32]


class Part(NamedTuple):
    """A rectangle of points: first row, row after the last, first column, column after the last."""

    top: int
    bottom: int
    left: int
    right: int


class Rounding(NamedTuple):
    """How numbers are rounded to 8 bits.

    Attributes:
        step: difference between two neighbouring numbers.
        zero: the byte of 0.
    """

    step: float
    zero: int


class _Surroundings(NamedTuple):
    """The heights of a part of the cloud and of those around it.

    Attributes:
        level: (h, w) float32, heights less the plane, in units of s, with the rings of holes filled.
        smooth: (h, w) float32, medians of `level`.
        measured: (h, w) bool.
        inner: the part.
    """

    level: npt.NDArray[np.float32]
    smooth: npt.NDArray[np.float32]
    measured: npt.NDArray[np.bool_]
    inner: Part


class _Windows(NamedTuple):
    """Sums over the rows of both windows around a row: (2, w), the narrow window first.

    Attributes:
        sums: float64, of the measured heights in whole steps, by column.
        counts: int32, number of measured points, by column.
    """

    sums: npt.NDArray[np.float64]
    counts: npt.NDArray[np.int32]


def channels_of(heights: RelativeHeights) -> tuple[Channels, float]:
    """Compute the channels of a cloud, and its grain.

    Args:
        heights: (H, W) float32, NaN where not measured; at least one point is measured.
    """
    scales = scales_of(heights)
    around = _surroundings(heights, scales, Part(0, heights.shape[0], 0, heights.shape[1]))
    channels = np.empty((CHANNELS, *heights.shape), np.float32)
    in_bands(lambda band: _write_channels(around, band.start, band.stop, channels), *heights.shape)
    return channels, scales.grain


def squares_of(
    heights: RelativeHeights, scales: Scales, part: Part, height: int, width: int, rounding: Rounding
) -> Squares:
    """Compute the squares of a part of a cloud.

    Args:
        heights: (H, W) float32, the whole cloud.
        scales: of the cloud.
        part: the part to compute the squares of; `top` and `left` are even.
        height: rows of squares, at least half of those of the part.
        width: columns of squares.
        rounding: of the channels and of the grain.

    Returns:
        (height, width, 28) uint8; beyond the part all but the last four are the bytes of 0.
    """
    around = _surroundings(heights, scales, part)
    squares = np.full((height, width, INPUTS), rounding.zero, np.uint8)
    grain, line = np.empty(4, np.uint8), np.full(4, scales.grain, np.float32)
    _round(line, rounding, grain)
    squares.view(np.uint32)[..., -1] = grain.view(np.uint32)[0]
    pairs = squares.view(np.uint16)  # two neighbouring points of a row
    rows = (around.inner.bottom - around.inner.top + 1) // 2
    in_bands(
        lambda band: _write_squares(around, rounding, band.start, band.stop, pairs),
        rows,
        2 * around.level.shape[1],
    )
    return squares


def _surroundings(heights: RelativeHeights, scales: Scales, part: Part) -> _Surroundings:
    rows, columns = heights.shape
    top, left = max(0, part.top - MARGIN), max(0, part.left - MARGIN)
    around = heights[top : part.bottom + MARGIN, left : part.right + MARGIN]
    shape = around.shape
    level = np.empty(shape, np.float32)
    holes = in_bands(lambda band: _subtract_tilt(around, scales, top, left, band.start, band.stop, level), *shape)
    measured = ~np.isnan(level) if any(holes) else np.ones(shape, np.bool_)
    if any(holes):
        ring = np.empty(shape, np.float32)
        in_bands(lambda band: _first_ring(level, band.start, band.stop, ring), *shape)
        in_bands(lambda band: _second_ring(ring, band.start, band.stop, level), *shape)
    smooth = np.empty(shape, np.float32)
    in_bands(lambda band: _smooth(level, band.start, band.stop, smooth), *shape)
    inner = Part(part.top - top, min(part.bottom, rows) - top, part.left - left, min(part.right, columns) - left)
    return _Surroundings(level, smooth, measured, inner)


@kernel
def _subtract_tilt(
    heights: RelativeHeights, scales: Scales, top: int, left: int, first: int, end: int, level: _Level
) -> bool:
    """Write the heights less the plane in units of s; return whether one of them is not measured."""
    inverse = 1.0 / scales.spread
    holes = False
    for row in range(first, end):
        base = scales.down * (top + row)
        for column in range(heights.shape[1]):
            flat = np.float64(heights[row, column]) - scales.offset - scales.along * (left + column) - base
            level[row, column] = np.float32(flat * inverse)
        for column in range(heights.shape[1]):
            holes |= np.isnan(level[row, column])
    return holes


@kernel
def _mean_around(level: _Level, row: int, column: int) -> np.float32:
    """Mean of the known neighbours; NaN where there is none."""
    height, width = level.shape
    total, known = 0.0, 0
    for y in range(max(0, row - 1), min(height, row + 2)):
        for x in range(max(0, column - 1), min(width, column + 2)):
            if not np.isnan(level[y, x]):
                total += level[y, x]
                known += 1
    return np.float32(total / known) if known else np.float32(np.nan)


@kernel
def _first_ring(level: _Level, first: int, end: int, ring: _Level) -> None:
    for row in range(first, end):
        for column in range(level.shape[1]):
            value = level[row, column]
            ring[row, column] = _mean_around(level, row, column) if np.isnan(value) else value


@kernel
def _second_ring(ring: _Level, first: int, end: int, level: _Level) -> None:
    for row in range(first, end):
        for column in range(level.shape[1]):
            value = ring[row, column]
            if np.isnan(value):
                value = _mean_around(ring, row, column)
                value = np.float32(0) if np.isnan(value) else value
            level[row, column] = value


@kernel
def _smooth(level: _Level, first: int, end: int, smooth: _Level) -> None:
    """Medians of five along the rows, then of five of these along the columns; borders are repeated."""
    height, width = level.shape
    lines = np.empty((5, width), np.float32)
    for row in range(first - 2, first + 2):
        _median_along(level[min(max(row, 0), height - 1)], lines[(row + 5) % 5])
    for row in range(first, end):
        _median_along(level[min(row + 2, height - 1)], lines[(row + 7) % 5])
        a, b, c, d, e = lines[0], lines[1], lines[2], lines[3], lines[4]
        out = smooth[row]
        for column in range(width):
            out[column] = median_of_five(a[column], b[column], c[column], d[column], e[column])


@kernel
def _median_along(line: _Values, out: _Values) -> None:
    width = line.size
    for column in range(2, width - 2):
        out[column] = median_of_five(
            line[column - 2], line[column - 1], line[column], line[column + 1], line[column + 2]
        )
    for place in range(min(4, width)):
        column = place if place < 2 else width - 1 - (place - 2)
        out[column] = median_of_five(
            line[max(column - 2, 0)],
            line[max(column - 1, 0)],
            line[column],
            line[min(column + 1, width - 1)],
            line[min(column + 2, width - 1)],
        )


@kernel
def _write_channels(around: _Surroundings, first: int, end: int, channels: Channels) -> None:
    """Write the channels of some rows of the inner part."""
    inner = around.inner
    windows = _windows_before(around, inner.top + first)
    lines = np.empty((CHANNELS, inner.right - inner.left), np.float32)
    for row in range(first, end):
        _channels_of_row(around, inner.top + row, windows, lines)
        channels[:, row] = lines


@kernel
def _write_squares(
    around: _Surroundings, rounding: Rounding, first: int, end: int, pairs: npt.NDArray[np.uint16]
) -> None:
    """Write some rows of squares, of two rows of points each; `pairs` (h, w, 14) holds two points in a number."""
    inner = around.inner
    start = inner.top + 2 * first
    windows = _windows_before(around, start)
    size = inner.right - inner.left
    lines = np.empty((CHANNELS, size), np.float32)
    bytes_ = np.full(size + size % 2, rounding.zero, np.uint8)  # of an odd number of points the last pair has one
    for row in range(start, min(inner.top + 2 * end, inner.bottom)):
        _channels_of_row(around, row, windows, lines)
        down = row - inner.top
        line = pairs[down // 2]
        for channel in range(CHANNELS):
            _round(lines[channel], rounding, bytes_)
            both = bytes_.view(np.uint16)
            for place in range(both.size):
                line[place, 2 * channel + (down & 1)] = both[place]


@kernel
def _round(line: _Values, rounding: Rounding, rounded: npt.NDArray[np.uint8]) -> None:
    """Round a line to bytes as ONNX's QuantizeLinear does: halves to even, and what is beyond 8 bits clipped."""
    step, zero = np.float32(rounding.step), np.float32(rounding.zero)
    for column in range(line.size):
        # A plain `/` would test for 0, and that test would prevent vectorisation.
        value = np.rint(np.divide(line[column], step)) + zero
        rounded[column] = np.uint8(min(max(value, np.float32(0)), np.float32(255)))


@kernel
def _windows_before(around: _Surroundings, row: int) -> _Windows:
    """The windows around the row before this one."""
    height, width = around.smooth.shape
    windows = _Windows(np.zeros((2, width)), np.zeros((2, width), np.int32))
    for window in range(2):
        half = _WIDE if window else _NARROW
        for other in range(max(0, row - 1 - half), min(height, row + half)):
            _add(around.smooth[other], around.measured[other], 1, windows.sums[window], windows.counts[window])
    return windows


@kernel
def _channels_of_row(around: _Surroundings, row: int, windows: _Windows, lines: Channels) -> None:
    """Write the channels of one row of the inner part to `lines`, (6, w), and move the windows on to it."""
    level, smooth, measured, inner = around.level, around.smooth, around.measured, around.inner
    height = level.shape[0]
    columns = slice(inner.left, inner.right)
    here, mask, median = level[row, columns], measured[row, columns], smooth[row, columns]
    above, below = level[max(row - 1, 0), columns], level[min(row + 1, height - 1), columns]
    values = np.empty(here.size, np.float32)
    for column in range(here.size):
        values[column] = here[column] - median[column]
    _compress(values, mask, lines[0])
    for window in range(2):
        half = _WIDE if window else _NARROW
        sums, counts = windows.sums[window], windows.counts[window]
        if row + half < height:
            _add(smooth[row + half], measured[row + half], 1, sums, counts)
        if row - half - 1 >= 0:
            _add(smooth[row - half - 1], measured[row - half - 1], -1, sums, counts)
        _means(sums, counts, half, inner, values)
        for column in range(here.size):
            values[column] = here[column] - values[column]
        _compress(values, mask, lines[1 + window])
    _second_difference(level[row], inner, values)
    _compress(values, mask, lines[3])
    for column in range(here.size):
        values[column] = below[column] - np.float32(2) * here[column] + above[column]
    _compress(values, mask, lines[4])
    for column in range(here.size):
        lines[5, column] = np.float32(mask[column])


@kernel
def _add(
    smooth: _Values,
    measured: npt.NDArray[np.bool_],
    sign: int,
    sums: npt.NDArray[np.float64],
    counts: npt.NDArray[np.int32],
) -> None:
    """Add a row to the sums of the columns, or take it away (`sign` -1)."""
    factor, step = np.float64(sign), np.int32(sign)
    for column in range(smooth.size):
        steps = np.rint(min(max(np.float64(smooth[column]), -_HIGHEST), _HIGHEST) * _STEPS)
        counts_here = np.int32(measured[column])
        sums[column] += factor * steps * counts_here
        counts[column] += step * counts_here


@kernel
def _means(
    sums: npt.NDArray[np.float64], counts: npt.NDArray[np.int32], half: int, inner: Part, means: _Values
) -> None:
    """Means over the windows around the points of a row; 0 where nothing is measured."""
    width = sums.size
    total, known = 0.0, 0
    for column in range(max(0, inner.left - 1 - half), min(width, inner.left + half)):
        total += sums[column]
        known += counts[column]
    for column in range(inner.left, inner.right):
        if column + half < width:
            total += sums[column + half]
            known += counts[column + half]
        if column - half - 1 >= 0:
            total -= sums[column - half - 1]
            known -= counts[column - half - 1]
        means[column - inner.left] = total / (max(known, 1) * _STEPS)


@kernel
def _second_difference(line: _Values, inner: Part, values: _Values) -> None:
    last = line.size - 1
    for column in range(inner.left, inner.right):
        before, after = line[max(column - 1, 0)], line[min(column + 1, last)]
        values[column - inner.left] = after - np.float32(2) * line[column] + before


@kernel
def _compress(values: _Values, measured: npt.NDArray[np.bool_], out: _Values) -> None:
    """Write L(v), and 0 where not measured; the bits of a float are nearly its logarithm."""
    for column in range(values.size):
        out[column] = min(abs(values[column]), _GREATEST) + np.float32(1)
    bits = out.view(np.int32)
    for column in range(values.size):
        logarithm = np.float32(bits[column] - _ONE) * _PER_STEP
        signed = -logarithm if values[column] < 0 else logarithm
        out[column] = signed if measured[column] else np.float32(0)
