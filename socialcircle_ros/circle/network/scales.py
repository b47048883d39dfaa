# SPDX-License-Identifier: Apache-2.0
"""Scales of a height map: level, tilt and spread, in which the network sees the heights; and the grain."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from socialcircle_ros.circle.adaptive.heights import RelativeHeights
from socialcircle_ros.circle.adaptive.quantisation import quantisation_step
from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.kernels.order_statistics import MAD_TO_SIGMA, median_of_five

_SAMPLES = 65536
_MOSTLY_ALIKE = 0.02
"""Where the robust spread is below this share of the mean residual, most heights equal their surroundings'."""
_LEAST_SPREAD = float(np.finfo(np.float32).tiny)
_OF_A_STEP = 0.65
"""Where heights are stored in steps, the spread is at least so much of one: less noise than that makes single
points differ by a step, and these are no outliers."""
_LEAST_GRAIN, _MOST_GRAIN = -10.0, 2.0
"""The grain is not below the first. It would be above the second where slopes hide the noise, on small clouds of a
steep form: there the spread is larger, so that it is not."""

_Sizes = npt.NDArray[np.float32]


class Scales(NamedTuple):
    """Numbers of the whole cloud.

    Attributes:
        offset: subtracted from the heights, in the unit of the cloud.
        along: tilt along x, in the unit of the cloud per point.
        down: tilt along y.
        spread: s, in the unit of the cloud.
        grain: log2 of the median size of the second differences along x over s.
    """

    offset: float
    along: float
    down: float
    spread: float
    grain: float


def scales_of(heights: RelativeHeights) -> Scales:
    """Measure the scales of a cloud on a sample of its points.

    Args:
        heights: (H, W) float32, NaN where not measured; at least one point is measured.
    """
    sample = np.arange(0, heights.size, _stride(*heights.shape))
    here, right, below = _steps(heights, sample)
    along, down = (float(np.median(each)) if each.size else 0.0 for each in (right, below))
    if not here.size:
        sample = np.flatnonzero(np.isfinite(heights))
        here = heights.ravel()[sample].astype(np.float64)
    offset = float(np.median(here))
    sample = sample[np.isfinite(heights.ravel()[sample])]
    parts = in_bands(lambda places: _residuals(heights, sample[places], offset, along, down), sample.size, 25)
    residuals, second = np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])
    robust, mean = MAD_TO_SIGMA * float(np.median(residuals)), float(residuals.mean(dtype=np.float64))
    spread = robust if robust > _MOSTLY_ALIKE * mean else mean
    fine = float(np.median(second))
    step = quantisation_step(heights)
    rounding = float(np.spacing(np.float32(abs(offset)))) if offset else 0.0
    least = max(_OF_A_STEP * step, fine / 2**_MOST_GRAIN, rounding)
    spread = max(spread, least, _LEAST_SPREAD) if spread > 0 or least > 0 else 1.0
    grain = float(np.clip(np.log2(fine / spread), _LEAST_GRAIN, _MOST_GRAIN)) if fine > 0 else _LEAST_GRAIN
    return Scales(offset, along, down, spread, grain)


def _stride(height: int, width: int) -> int:
    """Distance in row order between the points of the sample: odd, and without a divisor in common with the width.

    With a common divisor only some columns would be in the sample.
    """
    stride = max(1, height * width // _SAMPLES) | 1
    while math.gcd(stride, width) > 1:
        stride += 2
    return stride


@kernel
def _steps(
    heights: RelativeHeights, sample: npt.NDArray[np.int64]
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """The measured heights of a sample, and the differences to the points on the right and below."""
    height, width = heights.shape
    here, right, below = np.empty(sample.size), np.empty(sample.size), np.empty(sample.size)
    known, known_right, known_below = 0, 0, 0
    for place in sample:
        row, column = place // width, place % width
        value = np.float64(heights[row, column])
        if np.isnan(value):
            continue
        here[known] = value
        known += 1
        if column + 1 < width and not np.isnan(heights[row, column + 1]):
            right[known_right] = np.float64(heights[row, column + 1]) - value
            known_right += 1
        if row + 1 < height and not np.isnan(heights[row + 1, column]):
            below[known_below] = np.float64(heights[row + 1, column]) - value
            known_below += 1
    return here[:known], right[:known_right], below[:known_below]


@kernel
def _residuals(
    heights: RelativeHeights, sample: npt.NDArray[np.int64], offset: float, along: float, down: float
) -> tuple[_Sizes, _Sizes]:
    """Size of the residual to the median 5×5, and of the second difference along x, at measured points."""
    height, width = heights.shape
    residuals, second = np.empty(sample.size, np.float32), np.empty(sample.size, np.float32)
    near = np.empty((5, 5), np.float32)
    for index in range(sample.size):
        row, column = sample[index] // width, sample[index] % width
        for y in range(5):
            at = min(max(row + y - 2, 0), height - 1)
            for x in range(5):
                beside = min(max(column + x - 2, 0), width - 1)
                value = _flat(heights, at, beside, offset, along, down)
                # Most points are measured: the call that fills holes would take most of the time.
                near[y, x] = _filled(heights, at, beside, offset, along, down) if np.isnan(value) else value
        middle = median_of_five(
            median_of_five(near[0, 0], near[0, 1], near[0, 2], near[0, 3], near[0, 4]),
            median_of_five(near[1, 0], near[1, 1], near[1, 2], near[1, 3], near[1, 4]),
            median_of_five(near[2, 0], near[2, 1], near[2, 2], near[2, 3], near[2, 4]),
            median_of_five(near[3, 0], near[3, 1], near[3, 2], near[3, 3], near[3, 4]),
            median_of_five(near[4, 0], near[4, 1], near[4, 2], near[4, 3], near[4, 4]),
        )
        residuals[index] = abs(near[2, 2] - middle)
        second[index] = abs(near[2, 3] - np.float32(2) * near[2, 2] + near[2, 1])
    return residuals, second


@kernel
def _flat(heights: RelativeHeights, row: int, column: int, offset: float, along: float, down: float) -> np.float32:
    """The height less the plane; NaN where not measured."""
    return np.float32(np.float64(heights[row, column]) - offset - along * column - down * row)


@kernel
def _ring(heights: RelativeHeights, row: int, column: int, offset: float, along: float, down: float) -> np.float32:
    """The height of a point, or the mean of its measured neighbours; NaN where there is none."""
    here = _flat(heights, row, column, offset, along, down)
    if not np.isnan(here):
        return here
    height, width = heights.shape
    total, known = 0.0, 0
    for y in range(max(0, row - 1), min(height, row + 2)):
        for x in range(max(0, column - 1), min(width, column + 2)):
            value = _flat(heights, y, x, offset, along, down)
            if not np.isnan(value):
                total += float(value)
                known += 1
    return np.float32(total / known) if known else np.float32(np.nan)


@kernel
def _filled(
    heights: RelativeHeights, row: int, column: int, offset: float, along: float, down: float
) -> np.float32:
    """The height of a point, filled from two rings around; 0 further from the measured points."""
    here = _ring(heights, row, column, offset, along, down)
    if not np.isnan(here):
        return here
    height, width = heights.shape
    total, known = 0.0, 0
    for y in range(max(0, row - 1), min(height, row + 2)):
        for x in range(max(0, column - 1), min(width, column + 2)):
            value = _ring(heights, y, x, offset, along, down)
            if not np.isnan(value):
                total += float(value)
                known += 1
    return np.float32(total / known) if known else np.float32(0)
