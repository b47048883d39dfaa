"""The fit of the focus curve: where between the frames its peak lies, and how far that is to be trusted.

The peak is taken for a Gaussian (Nayar and Nakagawa 1994), so that ln F is a parabola in z, and a weighted
least-squares parabola through the frames round the sharpest gives it. A frame weighs (1 + ln(F / F_peak))²,
and nothing below F_peak / e: a narrow curve is fitted by three frames, which is Nayar's fit, and a wide one
by all that are kept of it.

Quality is the probability that the depth is good, within a quarter of the depth of field, as measured on
simulated stacks. The odds are 0.125 (c - 0.3)^1.5 v^-0.75, with two numbers of the curve: its contrast c =
ln(F_peak / F_lowest), and v, the variance of the fitted peak in squares of the curve's width.
"""

from dataclasses import dataclass
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .curve import OCTAVE, REACH, SLOTS, Codes, Curves, Places


class Reason(IntFlag):
    """Why a pixel is bad: the bits of `FocusResult.reasons`, 0 where nothing speaks against it."""

    NO_PEAK = 1
    """The curve has no peak, or none that noise would not make (quality below 0.1): the depth is NaN."""

    SCAN_END = 2
    """The sharpest frame is the first or the last in z, the peak may lie beyond: the depth is NaN."""

    SATURATED = 4
    """Of the window one pixel in eight is saturated in its sharpest frame: the quality is 0."""

    TWO_PEAKS = 8
    """Away from the peak a frame is half as sharp at least: another surface, or its reflection."""

    LOW_CONTRAST = 16
    """The sharpest frame is less than e^0.5 = 1.65 times as sharp as the least sharp one."""


@dataclass(frozen=True)
class Widths:
    """How wide focus curves are, of the most trusted pixel in each tile of a row: a sample that costs no pass."""

    columns: NDArray[np.int32]
    """(H, tiles): which pixel of the row."""

    values: NDArray[np.float32]
    """(H, tiles): standard deviation of the Gaussian that its curve is taken for, in z's unit; NaN: no peak."""

    def median(self, quality: NDArray[np.float32]) -> float | None:
        """The median over the pixels that are trusted by this quality, (H, W); None where none is."""
        rows = np.arange(len(self.values))[:, np.newaxis]
        trusted = self.values[(quality[rows, self.columns] >= _TRUSTED) & np.isfinite(self.values)]
        return float(np.median(trusted)) if trusted.size else None


def count_reasons(reasons: NDArray[np.uint8]) -> dict[str, int]:
    """How many pixels each reason speaks against, by its name in small letters; one may have several."""
    return {reason.name.lower(): int(np.count_nonzero(reasons & reason)) for reason in Reason if reason.name}


# Kernels know whole numbers only.
SATURATED = int(Reason.SATURATED)
_NO_PEAK, _SCAN_END = int(Reason.NO_PEAK), int(Reason.SCAN_END)
_TWO_PEAKS, _LOW_CONTRAST = int(Reason.TWO_PEAKS), int(Reason.LOW_CONTRAST)

_USED = REACH - 1
"""Places used on either side: one fewer than kept, see `Curves.make_room`."""

_NEAREST = 0.01
"""Least weight of the two nearest frames, so that there are always three to fit."""

_PER_CODE = np.float32(np.log(2) / OCTAVE)

_WEIGHTLESS = int(np.ceil(OCTAVE / np.log(2)))
"""A frame whose code is so far below the peak's weighs nothing, unless it is one of the two nearest."""

_NOISE, _NOISE_FRAMES = 4e-5, 2
"""What is known of the variance of ln F before the fit, and how many frames that knowledge is worth."""

_ODDS = 0.125
_NOISE_CONTRAST = 0.3
"""What noise alone makes of c in a few dozen frames."""

_LEAST_QUALITY = 0.1
_LEAST_CONTRAST = 0.5
_TRUSTED = 0.9
_HALF = float(np.log(0.5))

_TILE = 256
"""Pixels fitted side by side: their sums stay in the first cache, at distances that the compiler knows."""

_BATCH = 4
"""Slots summed at once: the sums of a tile are then read and written once in so many slots."""

_SUMS = 10


def fit_peaks(
    curves: Curves, z: NDArray[np.float64], first: int, *, three: bool
) -> tuple[NDArray[np.float64], NDArray[np.float32], NDArray[np.uint8], Widths]:
    """Depth, quality and reasons of all pixels, and how wide some of their curves are.

    Args:
        curves: what was kept of the focus curves.
        z: (n,) position of each place, ascending.
        first: place of z[0].
        three: whether only the sharpest frame and its two neighbours are used, all weighing the same.

    Returns:
        depth (H, W) float64 in z's unit, NaN where there is no peak; quality (H, W) float32, 0 to 1;
        reasons (H, W) uint8, bits of `Reason`, without SATURATED; the width of one curve of each tile.
    """
    shape = curves.centre.shape
    depth = np.empty(shape, np.float64)
    quality = np.empty(shape, np.float32)
    reasons = np.empty(shape, np.uint8)
    tiles = shape[0], -(-shape[1] // _TILE)
    widths = Widths(np.empty(tiles, np.int32), np.empty(tiles, np.float32))
    scale = float(np.median(np.diff(z)))
    # In typical steps from the first place: float32 then resolves 1e-4 of a step over a thousand frames.
    steps = np.pad((z - z[0]) / scale, REACH).astype(np.float32)

    def fit(band: slice) -> None:
        _fit(
            curves.slots[band],
            curves.centre[band],
            curves.since[band],
            curves.until[band],
            curves.peak[band],
            curves.lowest[band],
            curves.outside[band],
            z,
            steps,
            first,
            scale,
            three,
            depth[band],
            quality[band],
            reasons[band],
            widths.columns[band],
            widths.values[band],
        )

    in_bands(fit, *shape)
    widths.values[:] *= scale
    return depth, quality, reasons, widths


@kernel
def _fit(
    slots: Codes,
    centre: Places,
    since: Places,
    until: Places,
    peak: Codes,
    lowest: Codes,
    outside: Codes,
    z: NDArray[np.float64],
    steps: NDArray[np.float32],
    first: int,
    scale: float,
    three: bool,
    depth: NDArray[np.float64],
    quality: NDArray[np.float32],
    reasons: NDArray[np.uint8],
    columns: NDArray[np.int32],
    widths: NDArray[np.float32],
) -> None:
    """`fit_peaks`, tile by tile: weights of each slot, their sums, and from these the peaks."""
    height, _, width = slots.shape
    residue = np.empty(_TILE, np.int32)
    index = np.empty(_TILE, np.int32)
    nearest = np.empty(_TILE, np.int32)
    farthest = np.empty(_TILE, np.int32)
    origin = np.empty(_TILE, np.float32)
    distance = np.empty(_TILE, np.int32)
    floor = np.empty(_TILE, np.uint16)
    t = np.zeros(_BATCH * _TILE, np.float32)
    weights = np.empty(_BATCH * _TILE, np.float32)
    logs = np.zeros(_BATCH * _TILE, np.float32)
    sums = np.empty(_SUMS * _TILE, np.float32)
    bends = np.empty(_TILE, np.float32)
    for row in range(height):
        for start in range(0, width, _TILE):
            tile = slice(start, min(start + _TILE, width))
            centres, peaks = centre[row, tile], peak[row, tile]
            low, high = _locate(
                centres,
                since[row, tile],
                until[row, tile],
                first,
                z.size,
                three,
                index,
                residue,
                nearest,
                farthest,
            )
            for x in range(peaks.size):
                floor[x] = max(np.int32(peaks[x]) - np.int32(_WEIGHTLESS), np.int32(0))
            for x in range(_TILE):
                origin[x] = steps[np.uintp(index[x] + REACH)]
            sums[:] = 0
            weights[:] = 0
            batched = 0
            # In the order of the places, so that rounding does not depend on which frame came first.
            for turn in range(SLOTS):
                codes = slots[row, (first + turn) % SLOTS, tile]
                if not _matters(turn, codes, floor, low, high):
                    continue
                batch = slice(batched * _TILE, (batched + 1) * _TILE)
                _find_distance(turn, residue, distance)
                _weigh(codes, peaks, distance, nearest, farthest, three, weights[batch], logs[batch])
                _find_position(index, distance, origin, steps, low, high, t[batch])
                batched += 1
                if batched == _BATCH:
                    _accumulate(t, weights, logs, sums)
                    weights[:] = 0
                    batched = 0
            if batched:
                _accumulate(t, weights, logs, sums)
            _solve(sums)
            bends[:] = sums[2 * _TILE : 3 * _TILE]
            _judge(sums, peaks, lowest[row, tile], outside[row, tile])
            _store(sums, index, z, scale, depth[row, tile], quality[row, tile], reasons[row, tile])
            best = _most_trusted(quality[row, tile])
            columns[row, start // _TILE] = start + best
            # From ln F = -z² / (2 width²).
            widths[row, start // _TILE] = np.sqrt(np.divide(np.float32(-0.5), bends[best]))


@kernel
def _most_trusted(quality: NDArray[np.float32]) -> int:
    best = 0
    for x in range(quality.size):
        best = x if quality[x] > quality[best] else best
    return best


@kernel
def _locate(
    centre: Places,
    since: Places,
    until: Places,
    first: int,
    count: int,
    three: bool,
    index: NDArray[np.int32],
    residue: NDArray[np.int32],
    nearest: NDArray[np.int32],
    farthest: NDArray[np.int32],
) -> tuple[int, int]:
    """Of each pixel: index of its centre in z, that modulo SLOTS, how far below and above there are frames.

    Returns:
        The lowest and the highest index; what is left of a tile at the border has that of the first pixel.
    """
    lowest, highest = np.int32(first), np.int32(first + count - 1)
    reach = np.int32(1) if three else np.int32(_USED)
    below = np.int32(-reach)
    index[centre.size :] = centre[0] - first
    for x in range(centre.size):
        index[x] = np.int32(centre[x]) - lowest
    for x in range(index.size):
        residue[x] = np.uint32(index[x]) % np.uint32(SLOTS)
    for x in range(centre.size):
        nearest[x] = max(np.int32(max(np.int32(since[x]), lowest) - centre[x]), below)
    for x in range(centre.size):
        farthest[x] = min(np.int32(min(np.int32(until[x]), highest) - centre[x]), reach)
    low, high = index[0], index[0]
    for x in range(index.size):
        low = min(low, index[x])
        high = max(high, index[x])
    return int(low), int(high)


@kernel
def _matters(turn: int, codes: Codes, floor: Codes, low: int, high: int) -> bool:
    """Whether a slot can weigh anything: it is next to a centre of the tile, or sharp enough anywhere."""
    if (turn - low + 1) % SLOTS <= high - low + 2:
        return True
    count = np.int32(0)
    for x in range(codes.size):
        count = np.int32(count + np.int32(codes[x] > floor[x]))
    return bool(count > 0)


@kernel
def _find_distance(turn: int, residue: NDArray[np.int32], distance: NDArray[np.int32]) -> None:
    """How many places the slot whose indices leave the residue `turn` is from the centre."""
    slot = np.int32(turn)
    for x in range(residue.size):
        places = np.int32(slot - residue[x])
        places = np.int32(places + SLOTS) if places < -REACH else places
        distance[x] = np.int32(places - SLOTS) if places > REACH else places


@kernel
def _find_position(
    index: NDArray[np.int32],
    distance: NDArray[np.int32],
    origin: NDArray[np.float32],
    steps: NDArray[np.float32],
    low: int,
    high: int,
    position: NDArray[np.float32],
) -> None:
    """The steps from the centre to the frame at index + distance; indices are from low to high.

    The places of one slot are SLOTS apart, so that a tile of a smooth surface has one or two of them: to choose
    between these is quicker than to look each up, which the compiler does one by one.
    """
    if high - low > 8 * SLOTS:
        for x in range(position.size):
            position[x] = steps[np.uintp(index[x] + distance[x] + REACH)]
    else:
        found = index[0] + distance[0]
        found -= (found - (low - REACH)) // SLOTS * SLOTS
        position[:] = steps[found + REACH]
        for other in range(found + SLOTS, high + REACH + 1, SLOTS):
            here, step = np.int32(other), steps[other + REACH]
            for x in range(position.size):
                lower = position[x]
                position[x] = step if np.int32(index[x] + distance[x]) >= here else lower
    for x in range(position.size):
        position[x] -= origin[x]


@kernel
def _weigh(
    codes: Codes,
    peaks: Codes,
    distance: NDArray[np.int32],
    nearest: NDArray[np.int32],
    farthest: NDArray[np.int32],
    three: bool,
    weights: NDArray[np.float32],
    logs: NDArray[np.float32],
) -> None:
    """ln(F / F_peak) and weight of one slot, 0 outside nearest to farthest."""
    slope = np.float32(0) if three else np.float32(1)
    least = np.float32(1) if three else np.float32(_NEAREST)
    for x in range(codes.size):
        logs[x] = (np.float32(codes[x]) - np.float32(peaks[x])) * _PER_CODE
    for x in range(codes.size):
        above = max(np.float32(1) + slope * logs[x], np.float32(0))
        beside = (distance[x] >= np.int32(-1)) & (distance[x] <= np.int32(1))
        used = (distance[x] >= nearest[x]) & (distance[x] <= farthest[x]) & (codes[x] > np.uint16(0))
        weight = max(above * above, least if beside else np.float32(0))
        weights[x] = weight if used else np.float32(0)


@kernel
def _accumulate(
    t: NDArray[np.float32], weights: NDArray[np.float32], logs: NDArray[np.float32], sums: NDArray[np.float32]
) -> None:
    """Add a batch of slots to the sums w t^0..4, w y t^0..2, w y², and to the count of frames."""
    for x in range(_TILE):
        s0, s1, s2 = sums[x], sums[_TILE + x], sums[2 * _TILE + x]
        s3, s4 = sums[3 * _TILE + x], sums[4 * _TILE + x]
        y0, y1, y2 = sums[5 * _TILE + x], sums[6 * _TILE + x], sums[7 * _TILE + x]
        yy, n = sums[8 * _TILE + x], sums[9 * _TILE + x]
        for k in range(_BATCH):
            w, at, y = weights[k * _TILE + x], t[k * _TILE + x], logs[k * _TILE + x]
            wt, wy = w * at, w * y
            wtt, wyt = wt * at, wy * at
            s0 += w
            s1 += wt
            s2 += wtt
            s3 += wtt * at
            s4 += wtt * (at * at)
            y0 += wy
            y1 += wyt
            y2 += wyt * at
            yy += wy * y
            n += np.float32(1) if w > 0 else np.float32(0)
        sums[x], sums[_TILE + x], sums[2 * _TILE + x] = s0, s1, s2
        sums[3 * _TILE + x], sums[4 * _TILE + x] = s3, s4
        sums[5 * _TILE + x], sums[6 * _TILE + x], sums[7 * _TILE + x] = y0, y1, y2
        sums[8 * _TILE + x], sums[9 * _TILE + x] = yy, n


@kernel
def _solve(sums: NDArray[np.float32]) -> None:
    """From the sums to the parabola: in their place its peak, the peak's variance, its second coefficient.

    In typical steps; NaN or infinite where there are fewer than three frames. Moments are taken round their
    mean. np.divide, because `/` raises at a zero, and so keeps the compiler from making vectors.
    """
    for x in range(_TILE):
        per_weight = np.divide(np.float32(1), sums[x])
        m1, m2 = sums[_TILE + x] * per_weight, sums[2 * _TILE + x] * per_weight
        a11 = sums[2 * _TILE + x] - m1 * sums[_TILE + x]
        a12 = sums[3 * _TILE + x] - m1 * sums[2 * _TILE + x]
        a22 = sums[4 * _TILE + x] - m2 * sums[2 * _TILE + x]
        b1 = sums[6 * _TILE + x] - m1 * sums[5 * _TILE + x]
        b2 = sums[7 * _TILE + x] - m2 * sums[5 * _TILE + x]
        yy = sums[8 * _TILE + x] - per_weight * sums[5 * _TILE + x] * sums[5 * _TILE + x]
        per_determinant = np.divide(np.float32(1), a11 * a22 - a12 * a12)
        slope = (b1 * a22 - b2 * a12) * per_determinant
        bend = (b2 * a11 - b1 * a12) * per_determinant
        peak = np.divide(np.float32(-0.5) * slope, bend)
        residual = max(yy - slope * b1 - bend * b2, np.float32(0)) + np.float32(_NOISE * _NOISE_FRAMES)
        freedom = max(sums[9 * _TILE + x] + np.float32(_NOISE_FRAMES - 3), np.float32(1))
        # The variance of -slope / (2 bend), from the covariance of slope and bend.
        spread = (a22 - np.float32(4) * peak * (a12 - peak * a11)) * per_determinant
        sums[x] = peak
        sums[_TILE + x] = np.divide(residual * spread, freedom * np.float32(4) * bend * bend)
        sums[2 * _TILE + x] = bend


@kernel
def _judge(sums: NDArray[np.float32], peaks: Codes, lowest: Codes, outside: Codes) -> None:
    """In place of variance and second coefficient: quality, and the reasons that the curve gives."""
    for x in range(peaks.size):
        peak, bend = sums[x], sums[2 * _TILE + x]
        share = np.float32(-2) * bend * sums[_TILE + x]  # the variance in squares of the curve's width
        contrast = np.float32(np.int32(peaks[x]) - np.int32(lowest[x])) * _PER_CODE
        beyond_noise = max(contrast - np.float32(_NOISE_CONTRAST), np.float32(0))
        root = np.sqrt(max(share, np.float32(1e-8)))
        odds = np.divide(np.float32(_ODDS) * beyond_noise * np.sqrt(beyond_noise), root * np.sqrt(root))
        quality = np.divide(odds, np.float32(1) + odds)
        other = np.float32(np.int32(outside[x]) - np.int32(peaks[x])) * _PER_CODE
        beyond = np.float32(REACH) - abs(peak)  # from the peak to where the slots end
        two_peaks = (other > np.float32(_HALF)) & (bend * beyond * beyond < np.float32(2 * _HALF))
        is_peak = (bend < np.float32(0)) & (abs(peak) <= np.float32(_USED))
        is_peak &= quality >= np.float32(_LEAST_QUALITY)
        reason = np.int32(0) if is_peak else np.int32(_NO_PEAK)
        reason |= np.int32(_TWO_PEAKS) if two_peaks else np.int32(0)
        reason |= np.int32(_LOW_CONTRAST) if contrast < np.float32(_LEAST_CONTRAST) else np.int32(0)
        sums[_TILE + x] = quality
        sums[2 * _TILE + x] = np.float32(reason)


@kernel
def _store(
    sums: NDArray[np.float32],
    index: NDArray[np.int32],
    z: NDArray[np.float64],
    scale: float,
    depth: NDArray[np.float64],
    quality: NDArray[np.float32],
    reasons: NDArray[np.uint8],
) -> None:
    """Hand out what `_solve` and `_judge` left in `sums`; no depth without a peak, or beyond the scan."""
    lowest, highest, last = z[0], z[-1], np.int32(z.size - 1)
    for x in range(depth.size):
        depth[x] = z[np.uintp(index[x])] + sums[x] * scale
    for x in range(depth.size):
        at_end = (index[x] == np.int32(0)) | (index[x] == last) | (depth[x] < lowest) | (depth[x] > highest)
        reason = np.int32(sums[2 * _TILE + x])
        reasons[x] = reason | np.int32(_SCAN_END) if at_end else reason
    for x in range(depth.size):
        found = depth[x]
        depth[x] = found if reasons[x] & np.uint8(_NO_PEAK | _SCAN_END) == 0 else np.nan
    for x in range(depth.size):
        likely = sums[_TILE + x]
        quality[x] = likely if reasons[x] & np.uint8(_NO_PEAK | _SCAN_END) == 0 else np.float32(0)
