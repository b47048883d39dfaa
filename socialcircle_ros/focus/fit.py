# SPDX-License-Identifier: Apache-2.0
"""The fit of the focus curve: where its peak is between the frames, and how far that is to be trusted.

The peak is taken for a Gaussian, so that ln F is a parabola in z. A weighted least-squares parabola through the
frames next to the sharpest one gives the position of the peak. The weight of a frame is (1 + ln(F / F_peak))²,
and 0 below F_peak / e. A narrow curve is therefore fitted through three frames, which is the fit of Nayar and
Nakagawa; a wide curve is fitted through all frames that are kept of it.

Source: S. K. Nayar, Y. Nakagawa, Shape from focus, IEEE Trans. Pattern Anal. Mach. Intell. 16 (1994) 824-831,
DOI 10.1109/34.308479.

Quality is the probability that the error of the depth is at most a quarter of the depth of field, as measured on
simulated stacks. Its odds are 0.125 (c - 0.3)^1.5 v^-0.75. Here v is the variance of the fitted peak divided by
the squared width of the curve, and c is the contrast of the curve: ln(F_peak / F_lowest), or ln(F_peak / F_floor)
if that is less, where F_floor is what noise and rounding give, see `noise`.
"""

from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.cloud import Mask
from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .curve import Curves, release_recent
from .curve_rows import (
    REACH,
    SLOTS,
    Codes,
    CurveArrays,
    count_beyond_as_outside,
    mark_incomplete,
    row_of,
)
from .measure import Frame
from .noise import TABLE, Floor
from .order import FrameOrder
from .parabola import (
    BATCH,
    NATURAL_LOG_PER_CODE,
    SUMS,
    TILE,
    USED_REACH,
    Tile,
    accumulate,
    can_weigh,
    find_distance,
    find_floor,
    find_origin,
    find_position,
    locate,
    solve,
    weigh,
)
from .reasons import INCOMPLETE, LOW_CONTRAST, NO_PEAK, SCAN_END, TWO_PEAKS

_ODDS = 0.125
_NOISE_CONTRAST = 0.3
"""The contrast c that noise alone has in a few dozen frames."""

_LEAST_QUALITY = 0.1
_LEAST_CONTRAST = 0.5
_INCOMPLETE_QUALITY = 0.5
"""Highest quality of a pixel that lacks frames next to the sharpest one."""

TRUSTED_QUALITY = 0.9
"""Quality from which a pixel is trusted, as in reports and calibrations."""

_HALF = float(np.log(0.5))


Value = TypeVar('Value', bound=np.generic)

_SAMPLES = 4
"""So many pixels of a tile keep their widths, besides the best one."""


@dataclass(frozen=True, eq=False)
class CurveWidths:
    """The widths of a sample of the focus curves."""

    columns: NDArray[np.int32]
    """(H, n): columns of the pixels in each row."""

    values: NDArray[np.float32]
    """(H, n): standard deviation of the Gaussian that the curve is taken for, in units of z; NaN: no peak."""

    def median(self, counted: Mask) -> float | None:
        """Return the median over the pixels with a peak that count; None if there is none.

        Args:
            counted: (H, n), of the pixels of the sample.
        """
        widths = self.values[counted & np.isfinite(self.values)]
        return float(np.median(widths)) if widths.size else None

    def at(self, values: NDArray[Value]) -> NDArray[Value]:
        """The values at the pixels of the sample, (H, n), from those of all pixels, (H, W)."""
        return values[np.arange(len(self.columns))[:, np.newaxis], self.columns]


class Scan(NamedTuple):
    """Where the frames of a stack are in z."""

    z: NDArray[np.float64]
    """(n,): of the frames, ascending."""

    steps: NDArray[np.float32]
    """(n + 2 · REACH,): z in typical steps from z[0], with REACH zeros at either end."""

    step: float
    """The typical step: the median distance of two frames, in the unit of z."""

    first: int
    """The place of z[0]."""

    recent: int
    """The place of the lowest frame that is held back."""

    rows: NDArray[np.int64]
    """Where the frames that are held back are, in order of z."""

    complete: bool
    """Whether no pixel can lack a frame."""


class PeakMaps(NamedTuple):
    """What the fit gives, all pixels or a band of rows."""

    depth: NDArray[np.float64]
    """(H, W), in the unit of z, NaN where there is no peak."""

    quality: NDArray[np.float32]
    """(H, W), 0 to 1."""

    reasons: NDArray[np.uint8]
    """(H, W), bits of `Reason`, without SATURATED."""

    best_columns: NDArray[np.int32]
    """(H, tiles): of the pixel with the best quality in each tile of a row, see `CurveWidths`."""

    best_widths: NDArray[np.float32]
    """(H, tiles), see `CurveWidths`, but in typical steps."""

    spread_columns: NDArray[np.int32]
    """(H, tiles · _SAMPLES): of pixels that are spread over each tile. Given, not written."""

    spread_widths: NDArray[np.float32]
    """(H, tiles · _SAMPLES), as `best_widths`."""

    def band(self, rows: slice) -> 'PeakMaps':
        """The maps of some rows, as views."""
        return PeakMaps._make(array[rows] for array in self)


def fit_peaks(
    curves: Curves, order: FrameOrder, z: NDArray[np.float64], floor: Floor, *, three_point: bool
) -> tuple[NDArray[np.float64], NDArray[np.float32], NDArray[np.uint8], CurveWidths, CurveWidths]:
    """Find depth, quality and reasons of all pixels, and the widths of some of their curves.

    Args:
        curves: what was kept of the focus curves.
        order: of the frames in z.
        z: (n,) of the frames, ascending, in any unit.
        floor: of the focus measure.
        three_point: whether only the sharpest frame and its two neighbours are used, with equal weights.

    Returns:
        depth (H, W) float64 in the unit of z, NaN where there is no peak; quality (H, W) float32, 0 to 1; reasons
        (H, W) uint8, bits of `Reason`, without SATURATED; the widths of the best curves, one of each tile; the
        widths of curves that are chosen without regard to their quality.
    """
    shape = curves.image.shape
    tiles = shape[0], -(-shape[1] // TILE)
    spread = _spread_columns(*shape)
    maps = PeakMaps(
        depth=np.empty(shape, np.float64),
        quality=np.empty(shape, np.float32),
        reasons=np.empty(shape, np.uint8),
        best_columns=np.empty(tiles, np.int32),
        best_widths=np.empty(tiles, np.float32),
        spread_columns=spread,
        spread_widths=np.empty(spread.shape, np.float32),
    )
    step = float(np.median(np.diff(z)))
    # Relative to the first frame, float32 resolves 1e-4 of a step over a thousand frames.
    steps = np.pad((z - z[0]) / step, REACH).astype(np.float32)
    rows = np.array(order.rows, np.int64)
    scan = Scan(z, steps, step, order.first, order.recent.start, rows, order.complete)

    def fit(rows: slice) -> None:
        _fit(curves.arrays.band(rows), curves.image[rows], floor.band(rows), scan, three_point, maps.band(rows))

    in_bands(fit, *shape)
    maps.best_widths[:] *= step
    maps.spread_widths[:] *= step
    best = CurveWidths(maps.best_columns, maps.best_widths)
    return maps.depth, maps.quality, maps.reasons, best, CurveWidths(spread, maps.spread_widths)


def _spread_columns(height: int, width: int) -> NDArray[np.int32]:
    """Columns that are spread over each tile, and over the phases of a ruling, (H, tiles · _SAMPLES) int32."""
    starts = np.arange(0, width, TILE)
    sizes = np.minimum(width - starts, TILE)
    turns = np.arange(height)[:, np.newaxis] + np.arange(_SAMPLES) * height
    # Multiples of the golden ratio are spread evenly, however many are taken.
    shares = turns * ((np.sqrt(5) - 1) / 2) % 1
    columns = starts[:, np.newaxis] + shares[:, np.newaxis] * sizes[:, np.newaxis]
    spread: NDArray[np.int32] = columns.reshape(height, -1).astype(np.int32)
    return spread


@kernel
def _fit(curves: CurveArrays, image: Frame, floors: Floor, scan: Scan, three_point: bool, maps: PeakMaps) -> None:
    """`fit_peaks`, tile by tile: the weights of each slot, their sums, and the peaks from these."""
    height, _, width = curves.slots.shape
    z, steps, first = scan.z, scan.steps, scan.first
    # Allocated here and not in a function of their own: the compiler then knows their sizes in every loop.
    centre, residue = np.empty(TILE, np.int32), np.empty(TILE, np.int32)
    nearest, farthest = np.empty(TILE, np.int32), np.empty(TILE, np.int32)
    tile = Tile(centre, residue, nearest, farthest)
    origin, distance = np.empty(TILE, np.float32), np.empty(TILE, np.int32)
    floor = np.empty(TILE, np.uint16)
    t, logs = np.zeros(BATCH * TILE, np.float32), np.zeros(BATCH * TILE, np.float32)
    weights = np.empty(BATCH * TILE, np.float32)
    sums = np.empty(SUMS * TILE, np.float32)
    bends = np.empty(TILE, np.float32)
    slots, outside = np.empty((SLOTS, width), np.uint16), np.empty(width, np.uint16)
    displaced, incomplete = np.empty(width, np.uint16), np.zeros(width, np.bool_)
    lowest = np.empty(width, np.uint16)
    last = first + z.size - 1
    for row in range(height):
        curve = row_of(curves, row)
        quality = maps.quality[row]
        slots[:] = curve.slots
        outside[:] = curve.outside
        release_recent(scan.rows, scan.recent, curve, slots, outside, displaced)
        count_beyond_as_outside(first, last, curve.centre, slots, outside)
        _raise_to_floor(curve.lowest, image[row], floors, row, lowest)
        if not scan.complete:
            mark_incomplete(first, last, 1 if three_point else USED_REACH, curve.centre, slots, incomplete)
        for start in range(0, width, TILE):
            columns = slice(start, min(start + TILE, width))
            peaks = curve.peak[columns]
            low, high = locate(
                curve.centre[columns],
                first,
                z.size,
                three_point,
                tile,
            )
            find_floor(peaks, floor)
            find_origin(centre, steps, origin)
            sums[:] = 0
            weights[:] = 0
            batched = 0
            # In the order of the places, so that rounding does not depend on the order in which frames came.
            for turn in range(SLOTS):
                codes = slots[(first + turn) % SLOTS, columns]
                if not can_weigh(turn, codes, floor, low, high):
                    continue
                part = slice(batched * TILE, (batched + 1) * TILE)
                find_distance(turn, residue, distance)
                weigh(codes, peaks, distance, nearest, farthest, three_point, weights[part], logs[part])
                find_position(centre, distance, origin, steps, low, high, t[part])
                batched += 1
                if batched == BATCH:
                    accumulate(t, weights, logs, sums)
                    weights[:] = 0
                    batched = 0
            if batched:
                accumulate(t, weights, logs, sums)
            solve(sums)
            bends[:] = sums[2 * TILE : 3 * TILE]
            _judge(sums, peaks, lowest[columns], outside[columns], incomplete[columns])
            _store(sums, centre, scan, maps.depth[row, columns], quality[columns], maps.reasons[row, columns])
            best = _best(quality[columns])
            maps.best_columns[row, start // TILE] = start + best
            maps.best_widths[row, start // TILE] = _width_of(bends[best])
            for k in range(start // TILE * _SAMPLES, (start // TILE + 1) * _SAMPLES):
                maps.spread_widths[row, k] = _width_of(bends[maps.spread_columns[row, k] - start])


@kernel
def _width_of(bend: np.float32) -> np.float32:
    """The width of a curve from its second coefficient: ln F = -z² / (2 width²)."""
    width: np.float32 = np.sqrt(np.divide(np.float32(-0.5), bend))
    return width


@kernel
def _raise_to_floor(lowest: Codes, pixels: Frame, floors: Floor, row: int, raised: Codes) -> None:
    """Write the lowest codes of a row, or the floor where they are below it."""
    table, fewer, columns = floors.table, floors.rows[row], floors.columns
    for x in range(lowest.size):
        entry = min(np.int64(np.int64(pixels[x]) >> floors.shift), np.int64(TABLE - 1))
        raised[x] = max(np.int32(lowest[x]), table[np.uintp(entry)] + fewer + columns[x])


@kernel
def _best(quality: NDArray[np.float32]) -> int:
    """Index of the highest quality; of several, the first."""
    best = 0
    for x in range(quality.size):
        best = x if quality[x] > quality[best] else best
    return best


@kernel
def _judge(sums: NDArray[np.float32], peaks: Codes, lowest: Codes, outside: Codes, incomplete: Mask) -> None:
    """Replace variance and second coefficient, the result of `solve`, by the quality and the reasons."""
    for x in range(peaks.size):
        peak, bend = sums[x], sums[2 * TILE + x]
        variance = np.float32(-2) * bend * sums[TILE + x]  # divided by the squared width of the curve
        contrast = np.float32(np.int32(peaks[x]) - np.int32(lowest[x])) * NATURAL_LOG_PER_CODE
        beyond_noise = max(contrast - np.float32(_NOISE_CONTRAST), np.float32(0))
        root = np.sqrt(max(variance, np.float32(1e-8)))
        odds = np.divide(np.float32(_ODDS) * beyond_noise * np.sqrt(beyond_noise), root * np.sqrt(root))
        quality = np.divide(odds, np.float32(1) + odds)
        other = np.float32(np.int32(outside[x]) - np.int32(peaks[x])) * NATURAL_LOG_PER_CODE
        beyond = np.float32(REACH) - abs(peak)  # steps from the peak to the end of the slots
        two_peaks = (other > np.float32(_HALF)) & (bend * beyond * beyond < np.float32(2 * _HALF))
        is_peak = (bend < np.float32(0)) & (abs(peak) <= np.float32(USED_REACH))
        is_peak &= quality >= np.float32(_LEAST_QUALITY)
        reason = np.int32(0) if is_peak else np.int32(NO_PEAK)
        reason |= np.int32(TWO_PEAKS) if two_peaks else np.int32(0)
        reason |= np.int32(LOW_CONTRAST) if contrast < np.float32(_LEAST_CONTRAST) else np.int32(0)
        reason |= np.int32(INCOMPLETE) if incomplete[x] else np.int32(0)
        sums[TILE + x] = min(quality, np.float32(_INCOMPLETE_QUALITY)) if incomplete[x] else quality
        sums[2 * TILE + x] = np.float32(reason)


@kernel
def _store(
    sums: NDArray[np.float32],
    index: NDArray[np.int32],
    scan: Scan,
    depth: NDArray[np.float64],
    quality: NDArray[np.float32],
    reasons: NDArray[np.uint8],
) -> None:
    """Write the results of `solve` and `_judge` to the maps; a pixel without a peak in the scan has no depth."""
    z, step = scan.z, scan.step
    lowest, highest, last = z[0], z[-1], np.int32(z.size - 1)
    for x in range(depth.size):
        depth[x] = z[np.uintp(index[x])] + sums[x] * step
    for x in range(depth.size):
        at_end = (index[x] == np.int32(0)) | (index[x] == last) | (depth[x] < lowest) | (depth[x] > highest)
        reason = np.int32(sums[2 * TILE + x])
        reasons[x] = reason | np.int32(SCAN_END) if at_end else reason
    for x in range(depth.size):
        found = depth[x]
        depth[x] = found if reasons[x] & np.uint8(NO_PEAK | SCAN_END) == 0 else np.nan
    for x in range(depth.size):
        likely = sums[TILE + x]
        quality[x] = likely if reasons[x] & np.uint8(NO_PEAK | SCAN_END) == 0 else np.float32(0)
