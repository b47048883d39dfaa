# SPDX-License-Identifier: Apache-2.0
"""How far apart the frames of a stack are, and what that means for the quality.

Near its peak a focus curve is a Gaussian. Farther away it falls less steeply, to what blurred texture and noise
give. Where the steps are wide, only the sharpest frame is on the peak, and the parabola goes through this frame
and two on the tails. It fits them exactly, so that nothing in the curve of a pixel shows its error. The tails
also make the fitted curve wider than it is.

What does show it is the median width of the fitted curves of a stack, in steps. On simulated stacks nine pixels in
ten of quality 0.9 were good from 0.8 steps on, seven at 0.73, and three at 0.65, whatever the widths of their own
curves. Where lost frames or an uneven stage leave a gap in a stack with narrower steps, its median is that of the
curves as they are. All pixels were good in a gap of two widths, seven in eight in one of 2.5, and two in three or
fewer in one of 3.
"""

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.kernels.bands import in_bands

from .fit import CurveWidths

_LEAST_FRAMES = 4
"""A parabola goes through any three frames, so that nothing tells whether their curve is one."""

_ENOUGH, _TOO_NARROW = 0.78, 0.65
"""Median width of the curves, in steps, from which the quality is as fitted, and up to which it is 0."""

_ENOUGH_FOR_GAP, _TOO_NARROW_FOR_GAP = 0.5, 0.3
"""The same as shares of a gap."""

_BESIDE_GAP = 0.5
"""How far beyond a gap, in widths of the curves, a peak that is in it may be found."""

_COUNTED_QUALITY = 0.5
"""Curves of lower quality do not count for the median."""

_EVEN = 1.5
"""A gap between two frames, in typical steps, from which the curves in it do not count either, if others do."""


def curve_width(
    widths: CurveWidths, depth: NDArray[np.float64], quality: NDArray[np.float32], z: NDArray[np.float64]
) -> tuple[float | None, float]:
    """Find the median width of the fitted focus curves.

    Args:
        widths: of curves that were chosen without regard to their quality.
        depth: (H, W), in the unit of z, NaN where there is no peak.
        quality: (H, W), 0 to 1.
        z: (n,) of the frames, ascending.

    Returns:
        The width in the unit of z, None where there are no curves; the share of the pixels with such a curve.
    """
    fitted = widths.at(quality) >= _COUNTED_QUALITY
    gaps = np.diff(z)
    even = (gaps < _EVEN * np.median(gaps))[np.clip(np.searchsorted(z, widths.at(depth)) - 1, 0, gaps.size - 1)]
    found = widths.median(fitted & even)
    return widths.median(fitted) if found is None else found, float(np.mean(fitted))


def lower_where_steps_are_wide(
    depth: NDArray[np.float64], quality: NDArray[np.float32], z: NDArray[np.float64], width: float | None
) -> bool:
    """Lower the quality where the frames are too far apart for the focus curves.

    Args:
        depth: (H, W), in the unit of z, NaN where there is no peak.
        quality: (H, W), 0 to 1, updated.
        z: (n,) of the frames, ascending.
        width: median width of the fitted curves, whether they are trusted or not; None: there are none.

    Returns:
        Whether the steps of the whole stack are too wide, or its frames too few.
    """
    if z.size < _LEAST_FRAMES:
        quality[:] = 0
        return True
    if width is None:
        return False
    gaps = np.diff(z)
    likely = float(_ramp(np.array(width / np.median(gaps)), _TOO_NARROW, _ENOUGH))
    if likely < 1:
        quality *= np.float32(likely)
    in_gap = _ramp(width / gaps, _TOO_NARROW_FOR_GAP, _ENOUGH_FOR_GAP)
    if np.any(in_gap < 1):
        edges, factors = _gap_factors(z, in_gap, _BESIDE_GAP * width)

        def lower(rows: slice) -> None:
            for row in range(rows.start, rows.stop):
                quality[row] *= factors[np.searchsorted(edges, depth[row])]  # 1 where the depth is NaN

        in_bands(lower, *depth.shape)
    return likely < 1


def _gap_factors(
    z: NDArray[np.float64], in_gap: NDArray[np.float64], beside: float
) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """What the quality is multiplied by at each depth, as a step function.

    Args:
        z: (n,) of the frames, ascending.
        in_gap: (n - 1,), the factor in each gap between two frames.
        beside: how far beyond the gap it applies.

    Returns:
        (k,) ascending depths, and (k + 1,) the factors between them, the lowest one where gaps overlap.
    """
    wide = in_gap < 1
    lower, upper = z[:-1][wide] - beside, z[1:][wide] + beside
    edges = np.unique(np.concatenate([lower, upper]))
    factors = np.ones(edges.size + 1, np.float32)
    for first, end, factor in zip(lower, upper, in_gap[wide], strict=True):
        part = slice(np.searchsorted(edges, first) + 1, np.searchsorted(edges, end) + 1)
        factors[part] = np.minimum(factors[part], np.float32(factor))
    return edges, factors


def _ramp(values: NDArray[np.float64], low: float, high: float) -> NDArray[np.float64]:
    """From 0 at `low` to 1 at `high`, and level beyond."""
    return np.clip((values - low) / (high - low), 0.0, 1.0)
