# SPDX-License-Identifier: Apache-2.0
"""What the network sees of a height map, as docs/learned.md defines it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .adaptive import quantisation_step

CHANNELS = 6
"""Residuals to the median of 5×5, the mean of 17×17 and of 65×65; second differences along x, y; measured."""
_SAMPLES = 65536
_SIGMA = 1.4826
_LEAST_SCALE = float(np.finfo(np.float32).tiny)
_LARGEST = 65536.0
_ONE = np.float32(1).view(np.int32)
_NARROW, _WIDE = 8, 32


class Features(NamedTuple):
    """What the network sees.

    Attributes:
        channels: (6, H, W) float32.
        grain: log2 of the median second difference along x over the spread, the same for the whole cloud.
        scale: the spread s, in the unit of the heights.
    """

    channels: NDArray[np.float32]
    grain: float
    scale: float


def features_of(heights: NDArray[np.float32]) -> Features:
    """Compute the features of a height map.

    Args:
        heights: (H, W) float32, NaN where not measured; at least one point is measured.
    """
    measured = np.isfinite(heights)
    sample = np.arange(0, heights.size, _stride(*heights.shape))
    steps = _steps(heights, sample)
    level = _without_tilt(heights, measured, sample, steps)
    filled = _with_rings_filled(level, measured)
    smooth = _median_of_five(_median_of_five(filled, 1), 0)
    sampled = sample[measured.ravel()[sample]]
    if not sampled.size:
        sampled = np.flatnonzero(measured)
    residual = filled - smooth
    along, down = _second_difference(filled, 1), _second_difference(filled, 0)
    fine = float(np.median(np.abs(along.ravel()[sampled])))
    middle = heights.ravel()[sample]
    middle = middle[np.isfinite(middle)] if np.isfinite(middle).any() else heights[measured]
    offset = float(np.median(middle.astype(np.float64)))
    rounding = float(np.spacing(np.float32(abs(offset)))) if offset else 0.0
    least = max(0.65 * quantisation_step(heights), fine / 4, rounding)
    scale = _scale(np.abs(residual.ravel()[sampled]), least)
    grain = float(np.clip(np.log2(fine / scale), -10, 2)) if fine > 0 else -10.0
    narrow, wide = (_mean_of_measured(smooth, measured, radius) for radius in (_NARROW, _WIDE))
    parts = (residual, filled - narrow, filled - wide, along, down)
    channels = np.zeros((CHANNELS, *heights.shape), np.float32)
    for place, part in enumerate(parts):
        channels[place] = np.where(measured, compressed((part / np.float32(scale)).astype(np.float32)), 0)
    channels[5] = measured
    return Features(channels, grain, scale)


def compressed(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """sign(v) · log2(1 + |v|), linear between powers of two: the bits of a float are nearly its logarithm."""
    size = np.minimum(np.abs(values), np.float32(_LARGEST)) + np.float32(1)
    logarithm = (size.view(np.int32) - _ONE).astype(np.float32) * np.float32(2.0**-23)
    return np.asarray(np.copysign(logarithm, values))


def _stride(height: int, width: int) -> int:
    """The least odd number that has no divisor in common with the width and gives at most about 65,536 samples."""
    stride = max(1, height * width // _SAMPLES)
    while stride % 2 == 0 or any(stride % each == width % each == 0 for each in range(2, stride + 1)):
        stride += 1
    return stride


def _steps(heights: NDArray[np.float32], sample: NDArray[np.int64]) -> list[NDArray[np.float64]]:
    """Differences of a sample of the heights to the next point along x and along y, where both are measured."""
    rows, columns = np.divmod(sample, heights.shape[1])
    wide = heights.astype(np.float64)
    found = []
    for down, right in ((0, 1), (1, 0)):
        inside = (rows + down < heights.shape[0]) & (columns + right < heights.shape[1])
        steps = wide[rows[inside] + down, columns[inside] + right] - wide[rows[inside], columns[inside]]
        found.append(steps[np.isfinite(steps)])
    return found


def _without_tilt(
    heights: NDArray[np.float32],
    measured: NDArray[np.bool_],
    sample: NDArray[np.int64],
    steps: list[NDArray[np.float64]],
) -> NDArray[np.float32]:
    """Subtract a plane: the medians of a sample of the heights and of their differences to the next point."""
    wide = heights.astype(np.float64)
    here = wide.ravel()[sample]
    slopes = [float(np.median(each)) if each.size else 0.0 for each in steps]
    here = here[np.isfinite(here)]
    offset = float(np.median(here if here.size else wide[measured]))
    y, x = np.ogrid[: heights.shape[0], : heights.shape[1]]
    level = (wide - offset - slopes[0] * x - slopes[1] * y).astype(np.float32)
    return np.where(measured, level, np.float32(np.nan))


def _with_rings_filled(level: NDArray[np.float32], measured: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Fill two rings of each hole with the mean of the known neighbours; 0 further inside."""
    filled, known = np.where(measured, level, 0), measured.copy()
    if known.all():
        return filled
    height, width = level.shape
    for _ in range(2):
        total, count = np.zeros(level.shape), np.zeros(level.shape)
        padded = np.pad(np.where(known, filled, 0).astype(np.float64), 1)
        there = np.pad(known.astype(np.float64), 1)
        for down in range(3):
            for right in range(3):
                total += padded[down : down + height, right : right + width]
                count += there[down : down + height, right : right + width]
        new = ~known & (count > 0)
        filled = np.where(new, total / np.maximum(count, 1), filled).astype(np.float32)
        known |= new
    return filled


def _median_of_five(values: NDArray[np.float32], axis: int) -> NDArray[np.float32]:
    """Median of five points along an axis; the border is repeated."""
    padded = np.pad(values, [(2, 2) if place == axis else (0, 0) for place in range(2)], mode='edge')
    size = values.shape[axis]
    a, b, c, d, e = (np.take(padded, range(place, place + size), axis) for place in range(5))
    a, b = np.minimum(a, b), np.maximum(a, b)
    d, e = np.minimum(d, e), np.maximum(d, e)
    low, high = np.maximum(a, d), np.minimum(b, e)  # the least and the greatest of the four are dropped
    low, high = np.minimum(low, high), np.maximum(low, high)
    return np.asarray(np.maximum(low, np.minimum(c, high)))


def _second_difference(values: NDArray[np.float32], axis: int) -> NDArray[np.float32]:
    padded = np.pad(values, [(1, 1) if place == axis else (0, 0) for place in range(2)], mode='edge')
    size = values.shape[axis]
    before, after = (np.take(padded, range(place, place + size), axis) for place in (0, 2))
    return np.asarray(after - 2 * values + before)


def _scale(residuals: NDArray[np.float32], least: float) -> float:
    robust, mean = _SIGMA * float(np.median(residuals)), float(residuals.mean(dtype=np.float64))
    scale = max(robust if robust > 0.02 * mean else mean, least)
    return max(scale, _LEAST_SCALE) if scale > 0 else 1.0


def _mean_of_measured(
    values: NDArray[np.float32], measured: NDArray[np.bool_], radius: int
) -> NDArray[np.float32]:
    """Mean over the measured points of a square window, which ends at the border; 0 where it has none."""
    total = _window_sum(np.where(measured, values, 0).astype(np.float64), radius)
    count = _window_sum(measured.astype(np.float64), radius)
    return (total / np.maximum(count, 1)).astype(np.float32)


def _window_sum(values: NDArray[np.float64], radius: int) -> NDArray[np.float64]:
    for axis in (0, 1):
        size = values.shape[axis]
        sums = np.insert(np.cumsum(values, axis), 0, 0, axis)
        last = np.minimum(np.arange(size) + radius + 1, size)
        first = np.maximum(np.arange(size) - radius, 0)
        values = np.take(sums, last, axis) - np.take(sums, first, axis)
    return values
