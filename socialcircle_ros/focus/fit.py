"""The fit of the focus curve: where between the frames its peak lies, and how far that is to be trusted.

The peak is taken for a Gaussian (Nayar and Nakagawa 1994), so that the logarithm of F is a parabola in z, and a weighted
least-squares parabola through the frames round the sharpest gives it. A frame weighs (1 + ln(F / F_peak))², and nothing
below F_peak / e: a narrow curve is fitted by three frames, which is Nayar's fit, and a wide one by all that the curve has.
"""

import math
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.compiled import kernel

from .curve import PER_OCTAVE, REACH, SLOTS, Codes, Curves

Row = NDArray[np.float32]

_USED = REACH - 1
"""Places used on either side: one fewer than kept, see `Curves.make_room`."""

_TILE = 256
"""Pixels fitted side by side: their sums stay in the first cache, at distances that the compiler knows."""

_NEAREST = 0.01
"""Least weight of the two nearest frames, so that three frames are always there to fit."""

_PER_CODE = math.log(2) / PER_OCTAVE


class Reason(IntFlag):
    """Why a pixel is bad: the bits of `FocusResult.reasons`, 0 where nothing speaks against it."""

    NO_PEAK = 1
    SCAN_END = 2
    SATURATED = 4
    TWO_PEAKS = 8
    LOW_CONTRAST = 16


def fit_peaks(
    curves: Curves, z: NDArray[np.float64], first: int, *, three: bool
) -> tuple[NDArray[np.float64], NDArray[np.float32], NDArray[np.uint8]]:
    """Depth, quality and reasons of all pixels.

    Args:
        curves: what was kept of the focus curves.
        z: (n,) position of each place, ascending.
        first: place of z[0].
        three: whether only the sharpest frame and its two neighbours are used, all weighing the same.

    Returns:
        depth (H, W) float64 in z's unit, NaN where there is no peak; quality (H, W) float32, 0 to 1;
        reasons (H, W) uint8, bits of `Reason`, without SATURATED.
    """
    shape = curves.centre.shape
    depth = np.empty(shape, np.float64)
    quality = np.empty(shape, np.float32)
    reasons = np.zeros(shape, np.uint8)
    scale = float(np.median(np.diff(z)))
    # in typical steps from the first place: float32 then resolves 1e-4 of a step over a thousand frames
    near = np.pad((z - z[0]) / scale, REACH).astype(np.float32)
    _fit(
        curves.slots,
        curves.centre,
        curves.peak,
        curves.lowest,
        curves.outside,
        z,
        near,
        first,
        scale,
        three,
        depth,
        quality,
        reasons,
    )
    return depth, quality, reasons


@kernel
def _fit(
    slots: Codes,
    centre: NDArray[np.int16],
    peak: Codes,
    lowest: Codes,
    outside: Codes,
    z: NDArray[np.float64],
    near: Row,
    first: int,
    scale: float,
    three: bool,
    depth: NDArray[np.float64],
    quality: Row,
    reasons: NDArray[np.uint8],
) -> None:
    """`fit_peaks`, tile by tile: per slot weights, then sums, then the parabola of each pixel."""
    height, _, width = slots.shape
    residue = np.empty(_TILE, np.int32)
    distance = np.empty(_TILE, np.int32)
    origin = np.empty(_TILE, np.float32)
    t = np.empty(_TILE, np.float32)
    weights = np.empty(_TILE, np.float32)
    logs = np.empty(_TILE, np.float32)
    sums = np.empty(10 * _TILE, np.float32)
    for row in range(height):
        for start in range(0, width, _TILE):
            tile = slice(start, min(start + _TILE, width))
            centres, peaks = centre[row, tile], peak[row, tile]
            for x in range(centres.size):
                residue[x] = centres[x] % SLOTS
                origin[x] = near[centres[x] - first + REACH]
            sums[:] = 0
            # in the order of the places, so that rounding does not depend on which place came first
            for place in range(first, first + SLOTS):
                slot = place % SLOTS
                if _weigh(slots[row, slot, tile], slot, residue, peaks, three, distance, weights, logs):
                    for x in range(centres.size):
                        t[x] = near[centres[x] + distance[x] - first + REACH] - origin[x]
                    _accumulate(centres.size, t, weights, logs, sums)
            _solve(centres.size, sums)
            for x in range(centres.size):
                place = centres[x] - first
                offset, deviation = sums[x], sums[_TILE + x]
                reason = 0
                if place == 0 or place == z.size - 1:
                    reason = 2
                elif not deviation < 1.0:
                    reason = 1
                depth[row, start + x] = z[place] + offset * scale if reason == 0 else np.nan
                quality[row, start + x] = 1 / (1 + 4 * deviation) if reason == 0 else np.float32(0)
                reasons[row, start + x] = reason


@kernel
def _weigh(
    codes: Codes,
    slot: int,
    residue: NDArray[np.int32],
    peaks: Codes,
    three: bool,
    distance: NDArray[np.int32],
    weights: Row,
    logs: Row,
) -> bool:
    """Of one slot: how many places it is from the centre, its ln(F / F_peak), its weight; whether any has one."""
    for x in range(codes.size):
        places = np.int32(slot) - residue[x]
        places += SLOTS if places < -REACH else 0
        distance[x] = places - (SLOTS if places > REACH else 0)
    reach = 1 if three else _USED
    slope, least = (np.float32(0), np.float32(1)) if three else (np.float32(1), np.float32(_NEAREST))
    some = False
    for x in range(codes.size):
        log = np.float32(np.int32(codes[x]) - np.int32(peaks[x])) * np.float32(_PER_CODE)
        above = max(np.float32(1) + slope * log, np.float32(0))
        far = abs(distance[x])
        weight = max(above * above, least if far <= 1 else np.float32(0))
        logs[x] = log
        weights[x] = weight if (far <= reach) & (codes[x] > 0) else np.float32(0)
    for x in range(codes.size):
        some |= weights[x] > 0
    return some


@kernel
def _accumulate(size: int, t: Row, weights: Row, logs: Row, sums: Row) -> None:
    """Add one slot to the sums w t^0..4, w y t^0..2, w y² and the count."""
    for x in range(size):
        w, wy = weights[x], weights[x] * logs[x]
        wt = w * t[x]
        wtt = wt * t[x]
        sums[x] += w
        sums[_TILE + x] += wt
        sums[2 * _TILE + x] += wtt
        sums[3 * _TILE + x] += wtt * t[x]
        sums[4 * _TILE + x] += wtt * t[x] * t[x]
        sums[5 * _TILE + x] += wy
        sums[6 * _TILE + x] += wy * t[x]
        sums[7 * _TILE + x] += wy * t[x] * t[x]
        sums[8 * _TILE + x] += wy * logs[x]
        sums[9 * _TILE + x] += np.float32(1) if w > 0 else np.float32(0)


@kernel
def _solve(size: int, sums: Row) -> None:
    """From the sums to the parabola: its peak in place of the first sum, the peak's deviation in place of the second.

    Both in typical steps; NaN where the parabola has no peak.
    """
    for x in range(size):
        s0 = sums[x]
        m1, m2, my = sums[_TILE + x] / s0, sums[2 * _TILE + x] / s0, sums[5 * _TILE + x] / s0
        a11 = sums[2 * _TILE + x] - m1 * sums[_TILE + x]
        a12 = sums[3 * _TILE + x] - m1 * sums[2 * _TILE + x]
        a22 = sums[4 * _TILE + x] - m2 * sums[2 * _TILE + x]
        b1 = sums[6 * _TILE + x] - m1 * sums[5 * _TILE + x]
        b2 = sums[7 * _TILE + x] - m2 * sums[5 * _TILE + x]
        yy = sums[8 * _TILE + x] - my * sums[5 * _TILE + x]
        det = a11 * a22 - a12 * a12
        slope = (b1 * a22 - b2 * a12) / det
        curvature = (b2 * a11 - b1 * a12) / det
        offset = -slope / (2 * curvature)
        residual = max(yy - slope * b1 - curvature * b2, np.float32(0))
        variance = (residual + np.float32(0.002)) / max(sums[9 * _TILE + x] - 1, np.float32(1))
        spread = (a22 - 4 * offset * a12 + 4 * offset * offset * a11) / det
        ok = (curvature < 0) & (det > 0)
        sums[x] = offset if ok else np.float32(np.nan)
        sums[_TILE + x] = math.sqrt(variance * spread) / (-2 * curvature) if ok else np.float32(np.nan)
