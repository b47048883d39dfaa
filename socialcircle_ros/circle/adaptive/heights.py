# SPDX-License-Identifier: Apache-2.0
"""The heights that the adaptive mode works on, and how it fills holes in them."""

import math

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import HeightMap, Mask
from socialcircle_ros.kernels.compiled import kernel

RelativeHeights = npt.NDArray[np.float32]
"""(H, W) float32, NaN where not measured."""

_SAMPLES = 10_000
_FEW_SAMPLES = 1000  # tell an exponent, but not a median to all digits
_SAFE = 64
"""Exponents of deviations up to which, and down to which, differences and their sums are exact in float32."""
_FURTHEST = float(np.finfo(np.float32).max) / 16
"""Greatest height: sums and differences of several such heights are finite in float32."""
_RINGS = 6
_LEAST_NEIGHBOURS = 3


def relative_heights(heights: HeightMap) -> tuple[RelativeHeights, int]:
    """Convert heights to float32 without losing digits to an offset, or to a unit that float32 hardly holds.

    Args:
        heights: (H, W) float32 or float64, NaN where not measured; at least one height is measured.

    Returns:
        (H, W) float32, contiguous, and the binary exponent e of their unit: they count in 2ᵉ units of the heights.
        e is 0 unless the surface deviates from its median by less than 2⁻⁶⁴ or more than 2⁶⁴; so heights · 2ⁿ give
        the same values for any n. Float32 heights are unchanged then; float64 heights are relative to about their
        median, and what float32 cannot add up is clipped.
    """
    if heights.dtype == np.float32:
        sample = _finite(heights.ravel()[:: max(1, heights.size // _FEW_SAMPLES)])
        sample = sample if sample.size else _finite(heights)
        exponent = _exponent(heights, sample, float(np.median(sample.astype(np.float64))))
        if exponent:
            with np.errstate(over='ignore', under='ignore'):
                return np.clip(np.ldexp(heights, -exponent), -_FURTHEST, _FURTHEST).astype(np.float32), exponent
        return np.ascontiguousarray(heights, np.float32), 0
    sample = _finite(heights)
    sample = sample[:: max(1, sample.size // _SAMPLES)]
    # Of an even number of heights it is half the sum of two, which float64 might not hold.
    middle = 4 * float(np.median(sample / 4))
    exponent = _exponent(heights, sample, middle)
    with np.errstate(over='ignore', under='ignore'):
        if exponent:
            relative = np.ldexp(heights, -exponent)
            relative -= math.ldexp(middle, -exponent)
        else:
            relative = heights - middle
        return np.clip(relative, -_FURTHEST, _FURTHEST).astype(np.float32, order='C'), exponent


def _finite(heights: HeightMap) -> HeightMap:
    """(n,) the heights that are measured."""
    finite: HeightMap = heights[np.isfinite(heights)]
    return finite


def _exponent(heights: HeightMap, sample: HeightMap, middle: float) -> int:
    """The binary exponent by which the heights are divided; 0 where float32 holds them and their differences.

    Outliers may be at any distance, so that the deviations of most points tell it. Those that are 0 tell nothing.
    """
    for values in (sample, heights):
        deviations = np.abs(values.astype(np.float64) / 4 - middle / 4)
        deviations = deviations[deviations > 0]
        if deviations.size:
            half = (deviations.size - 1) // 2
            exponent = math.frexp(np.partition(deviations, half)[half])[1] + 2
            return exponent if abs(exponent) > _SAFE else 0
    return 0


def with_holes_filled(heights: RelativeHeights, holes: Mask) -> RelativeHeights:
    """Fill holes ring by ring, each point with the mean of its known neighbours.

    The result serves to examine the remaining points; it is never published.

    Args:
        heights: (H, W) float32, NaN where not measured.
        holes: (H, W) bool.

    Returns:
        (H, W) float32, a copy. The innermost points of holes that are deeper than six rings are NaN.
    """
    filled = heights.copy()
    points = np.flatnonzero(holes)
    filled.ravel()[points] = np.nan
    _fill(filled, points)
    return filled


@kernel
def _fill(heights: RelativeHeights, holes: npt.NDArray[np.int64]) -> None:
    """Fill in place the points `holes`, (n,), which are numbered in row order."""
    height, width = heights.shape
    left = holes.copy()
    values = np.empty(holes.size, np.float32)
    for _ in range(_RINGS):
        count = 0
        for place in range(left.size):
            row, column = left[place] // width, left[place] % width
            total, known = 0.0, 0
            for y in range(max(0, row - 1), min(height, row + 2)):
                for x in range(max(0, column - 1), min(width, column + 2)):
                    if not np.isnan(heights[y, x]):
                        total += heights[y, x]
                        known += 1
            values[place] = total / known if known >= _LEAST_NEIGHBOURS else np.nan
        for place in range(left.size):
            # A ring is written when it is complete, so that no point depends on the order of the others.
            if np.isnan(values[place]):
                left[count] = left[place]
                count += 1
            else:
                heights[left[place] // width, left[place] % width] = values[place]
        if count == left.size:
            break
        left = left[:count]
