# SPDX-License-Identifier: Apache-2.0
"""The step in which heights are stored, also where a plane or a form was subtracted from them since.

Many instruments store whole numbers, and their software then levels them: sorted heights no longer show the step.
Second differences along a line do. A plane changes none of them, and a form of second order adds one number to
all. Less that number, they are multiples of the step.
"""

import math

import numpy as np
import numpy.typing as npt

from .heights import RelativeHeights

_SAMPLES = 8192
"""Second differences along an axis that are looked at."""
_FEWEST = 50
"""Fewer second differences tell nothing."""
_QUANTILES = (0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95)
"""Quantiles of the sizes above the rounding that may be the step."""
_OFF = 2.0**-8
"""A size is a multiple of a step if it is off one by at most this share of the step, besides rounding.

Software that levels 14 bits in float32 rounds so. The lines of a grating differ by more, unless all are of one
height that is a thousand times the noise.
"""
_MULTIPLES, _ZEROS = 0.8, 0.9
"""Least share of the sizes above half a step that are multiples, and of the others that are 0."""
_FEW = 0.23
"""More than this share of the sizes are above half a step. Where fewer are, the step may be the height of a few
outliers: 8 % of the points, if they are single ones."""
_ROUNDINGS = 4.0
"""A second difference is the sum of four heights, each rounded."""
_HIGH = 0.9
"""The resolution of float32 counts at this quantile of the heights' sizes, which a few outliers do not change."""
_LEAST_ROUNDINGS = 10.0
"""A smaller step cannot be told from rounding."""


def quantisation_step(heights: RelativeHeights) -> float:
    """Find the step in which heights are stored.

    Args:
        heights: (H, W) float32, NaN where not measured.

    Returns:
        The step, in the unit of the heights; 0 if there is none, or if the noise is so far below it that hardly a
        height differs from its neighbours'.
    """
    return max(_step_along(heights, axis) for axis in (0, 1))


def _step_along(heights: RelativeHeights, axis: int) -> float:
    across = heights.shape[1 - axis]
    lines = np.take(heights, range(0, across, max(1, math.ceil(heights.size / _SAMPLES))), axis=1 - axis)
    curves = np.diff(lines.astype(np.float64), 2, axis=axis).ravel()
    curves = curves[np.isfinite(curves)]
    if curves.size < _FEWEST:
        return 0.0
    # One of them, never a mean of two: that may lie between two multiples.
    middle = np.partition(curves, curves.size // 2)[curves.size // 2]
    sizes = np.sort(np.abs(curves - middle))
    largest = np.quantile(np.abs(lines[np.isfinite(lines)]), _HIGH).astype(np.float32)
    rounding = _ROUNDINGS * float(np.spacing(largest))
    above = sizes[np.searchsorted(sizes, rounding, 'right') :]
    candidates = {float(above[int(quantile * (above.size - 1))]) for quantile in _QUANTILES if above.size}
    steps = [each for each in candidates if each > _LEAST_ROUNDINGS * rounding and _is_step(sizes, each, rounding)]
    return min(steps, default=0.0)


def _is_step(sizes: npt.NDArray[np.float64], step: float, rounding: float) -> bool:
    """Whether sorted sizes are 0 or multiples of a step, but for a few."""
    first = int(np.searchsorted(sizes, step / 2))
    multiples = sizes[first:] / step
    if multiples.size <= _FEW * sizes.size:
        return False
    off = _OFF + rounding / step
    zeros = int(np.searchsorted(sizes, off * step, 'right'))
    near = np.count_nonzero(np.abs(multiples - np.rint(multiples)) <= off)
    return bool(near >= _MULTIPLES * multiples.size and min(zeros, first) >= _ZEROS * first)
