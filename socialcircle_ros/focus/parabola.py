# SPDX-License-Identifier: Apache-2.0
"""Weighted least squares: the parabola through ln F of each pixel, for a tile of pixels at a time.

With t, the distance of a frame from the centre in typical steps, y = ln(F / F_peak) and w, the weight of a frame,
the parabola needs the sums of w t^k for k = 0 to 4, w y t^k for k = 0 to 2, and w y². `accumulate` adds the slots
to these sums, `solve` finds the parabola from them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.kernels.compiled import kernel

from .curve_rows import CODES_PER_OCTAVE, REACH, SLOTS, Codes, Places

USED_REACH = REACH - 1
"""Frames used on either side of the sharpest one: one fewer than are kept, see `open_place`."""

TILE = 256
"""Pixels fitted side by side. Their sums stay in the first-level cache, at offsets that the compiler knows."""

BATCH = 4
"""Slots summed at once: the sums of a tile are read and written only once for this many slots."""

SUMS = 10
"""The nine sums of the module's description, and the number of frames that weigh anything."""

NATURAL_LOG_PER_CODE = np.float32(np.log(2) / CODES_PER_OCTAVE)

_WEIGHTLESS = int(np.ceil(CODES_PER_OCTAVE / np.log(2)))
"""A frame with a code this far below that of the peak, at F_peak / e, weighs nothing."""

_LEAST_WEIGHT = 0.01
"""Least weight of the frames next to the sharpest one, so that the fit always has three frames."""

_NOISE, _NOISE_FRAMES = 4e-5, 2
"""Prior of the variance of ln F, and how many frames it counts for."""


class Tile(NamedTuple):
    """Which frames of each pixel of a tile are used, (TILE,) each; work arrays.

    A pixel of the last tile of a row that is outside the image has the centre of the first pixel of its tile.
    """

    centre: NDArray[np.int32]
    """Index in z of the sharpest frame."""

    residue: NDArray[np.int32]
    """`centre` modulo SLOTS."""

    nearest: NDArray[np.int32]
    """Places from the centre down to the lowest frame that is used, 0 or negative."""

    farthest: NDArray[np.int32]
    """Places from the centre up to the highest frame that is used, 0 or positive."""


@kernel
def locate(centre: Places, first: int, count: int, three_point: bool, tile: Tile) -> tuple[int, int]:
    """Find the index of each centre in z, and how far below and above it there are frames to use.

    Args:
        centre: (n,) of the pixels of the tile, n ≤ TILE.
        first: place of the lowest frame.
        count: number of frames.
        three_point: whether only the neighbours of the centre are used.
        tile: written.

    Returns:
        The lowest and the highest index.
    """
    index, residue, nearest, farthest = tile.centre, tile.residue, tile.nearest, tile.farthest
    lowest, highest = np.int32(first), np.int32(first + count - 1)
    reach = np.int32(1) if three_point else np.int32(USED_REACH)
    below = np.int32(-reach)
    index[centre.size :] = centre[0] - first
    for x in range(centre.size):
        index[x] = np.int32(centre[x]) - lowest
    for x in range(index.size):
        residue[x] = np.uint32(index[x]) % np.uint32(SLOTS)
    for x in range(centre.size):
        nearest[x] = max(np.int32(lowest - centre[x]), below)
    for x in range(centre.size):
        farthest[x] = min(np.int32(highest - centre[x]), reach)
    low, high = index[0], index[0]
    for x in range(index.size):
        low = min(low, index[x])
        high = max(high, index[x])
    return int(low), int(high)


@kernel
def find_floor(peaks: Codes, floor: Codes) -> None:
    """Write the highest code of each pixel that weighs nothing, unless its frame is next to the centre."""
    for x in range(peaks.size):
        floor[x] = max(np.int32(peaks[x]) - np.int32(_WEIGHTLESS), np.int32(0))


@kernel
def find_origin(centre: NDArray[np.int32], steps: NDArray[np.float32], origin: NDArray[np.float32]) -> None:
    """Write z of the centres in steps, (TILE,); `steps` is that of `Scan`."""
    for x in range(origin.size):
        origin[x] = steps[np.uintp(centre[x] + REACH)]


@kernel
def can_weigh(turn: int, codes: Codes, floor: Codes, low: int, high: int) -> bool:
    """Whether any frame in a slot can have a weight: it is next to a centre of the tile, or sharp enough.

    Args:
        turn: residue modulo SLOTS of the indices of the frames in the slot.
        codes: (n,) in the slot.
        floor: (TILE,), from `find_floor`.
        low: lowest index of a centre of the tile.
        high: highest index of a centre.
    """
    if (turn - low + 1) % SLOTS <= high - low + 2:
        return True
    count = np.int32(0)
    for x in range(codes.size):
        count = np.int32(count + np.int32(codes[x] > floor[x]))
    return bool(count > 0)


@kernel
def find_distance(turn: int, residue: NDArray[np.int32], distance: NDArray[np.int32]) -> None:
    """Write the distances of the frames in the slot of residue `turn` from the centres, in places."""
    slot = np.int32(turn)
    for x in range(residue.size):
        places = np.int32(slot - residue[x])
        places = np.int32(places + SLOTS) if places < -REACH else places
        distance[x] = np.int32(places - SLOTS) if places > REACH else places


@kernel
def find_position(
    centre: NDArray[np.int32],
    distance: NDArray[np.int32],
    origin: NDArray[np.float32],
    steps: NDArray[np.float32],
    low: int,
    high: int,
    position: NDArray[np.float32],
) -> None:
    """Write the distances of the frames at centre + distance from the centres, in steps.

    The frames in one slot are SLOTS places apart, so that a tile of a smooth surface meets one or two of them. A
    choice between these is faster than a lookup for each pixel, which the compiler does not vectorise.

    Args:
        centre: (TILE,), index of each centre in z.
        distance: (TILE,), in places.
        origin: (TILE,), z of each centre in steps.
        steps: (n + 2 · REACH,), z of the frames in steps, see `Scan`.
        low: lowest index of a centre of the tile.
        high: highest index of a centre.
        position: (TILE,), written.
    """
    if high - low > 8 * SLOTS:
        for x in range(position.size):
            position[x] = steps[np.uintp(centre[x] + distance[x] + REACH)]
    else:
        found = centre[0] + distance[0]
        found -= (found - (low - REACH)) // SLOTS * SLOTS
        position[:] = steps[found + REACH]
        for other in range(found + SLOTS, high + REACH + 1, SLOTS):
            here, step = np.int32(other), steps[other + REACH]
            for x in range(position.size):
                lower = position[x]
                position[x] = step if np.int32(centre[x] + distance[x]) >= here else lower
    for x in range(position.size):
        position[x] -= origin[x]


@kernel
def weigh(
    codes: Codes,
    peaks: Codes,
    distance: NDArray[np.int32],
    nearest: NDArray[np.int32],
    farthest: NDArray[np.int32],
    three_point: bool,
    weights: NDArray[np.float32],
    logs: NDArray[np.float32],
) -> None:
    """Write ln(F / F_peak) and the weight of the frames in one slot; the weight of a frame not used is 0."""
    slope = np.float32(0) if three_point else np.float32(1)
    least = np.float32(1) if three_point else np.float32(_LEAST_WEIGHT)
    for x in range(codes.size):
        logs[x] = (np.float32(codes[x]) - np.float32(peaks[x])) * NATURAL_LOG_PER_CODE
    for x in range(codes.size):
        above = max(np.float32(1) + slope * logs[x], np.float32(0))
        beside = (distance[x] >= np.int32(-1)) & (distance[x] <= np.int32(1))
        used = (distance[x] >= nearest[x]) & (distance[x] <= farthest[x]) & (codes[x] > np.uint16(0))
        weight = max(above * above, least if beside else np.float32(0))
        weights[x] = weight if used else np.float32(0)


@kernel
def accumulate(
    t: NDArray[np.float32], weights: NDArray[np.float32], logs: NDArray[np.float32], sums: NDArray[np.float32]
) -> None:
    """Add a batch of slots to the sums, and its frames to their number.

    Args:
        t: (BATCH · TILE,), steps from the centre.
        weights: (BATCH · TILE,), 0 where a frame is missing or not used.
        logs: (BATCH · TILE,), ln(F / F_peak).
        sums: (SUMS · TILE,), updated.
    """
    for x in range(TILE):
        s0, s1, s2 = sums[x], sums[TILE + x], sums[2 * TILE + x]
        s3, s4 = sums[3 * TILE + x], sums[4 * TILE + x]
        y0, y1, y2 = sums[5 * TILE + x], sums[6 * TILE + x], sums[7 * TILE + x]
        yy, n = sums[8 * TILE + x], sums[9 * TILE + x]
        for k in range(BATCH):
            w, at, y = weights[k * TILE + x], t[k * TILE + x], logs[k * TILE + x]
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
        sums[x], sums[TILE + x], sums[2 * TILE + x] = s0, s1, s2
        sums[3 * TILE + x], sums[4 * TILE + x] = s3, s4
        sums[5 * TILE + x], sums[6 * TILE + x], sums[7 * TILE + x] = y0, y1, y2
        sums[8 * TILE + x], sums[9 * TILE + x] = yy, n


@kernel
def solve(sums: NDArray[np.float32]) -> None:
    """Replace the first three sums by the peak of the parabola, its variance, and the second coefficient.

    The unit is the typical step. Results are NaN or infinite where there are fewer than three frames. Moments
    are central, for precision. `np.divide` is used because `/` raises an error at 0, which keeps the compiler
    from vectorising the loop.
    """
    for x in range(TILE):
        per_weight = np.divide(np.float32(1), sums[x])
        m1, m2 = sums[TILE + x] * per_weight, sums[2 * TILE + x] * per_weight
        a11 = sums[2 * TILE + x] - m1 * sums[TILE + x]
        a12 = sums[3 * TILE + x] - m1 * sums[2 * TILE + x]
        a22 = sums[4 * TILE + x] - m2 * sums[2 * TILE + x]
        b1 = sums[6 * TILE + x] - m1 * sums[5 * TILE + x]
        b2 = sums[7 * TILE + x] - m2 * sums[5 * TILE + x]
        yy = sums[8 * TILE + x] - per_weight * sums[5 * TILE + x] * sums[5 * TILE + x]
        per_determinant = np.divide(np.float32(1), a11 * a22 - a12 * a12)
        slope = (b1 * a22 - b2 * a12) * per_determinant
        bend = (b2 * a11 - b1 * a12) * per_determinant
        peak = np.divide(np.float32(-0.5) * slope, bend)
        residual = max(yy - slope * b1 - bend * b2, np.float32(0)) + np.float32(_NOISE * _NOISE_FRAMES)
        freedom = max(sums[9 * TILE + x] + np.float32(_NOISE_FRAMES - 3), np.float32(1))
        # The variance of -slope / (2 bend), from the covariance of slope and bend.
        spread = (a22 - np.float32(4) * peak * (a12 - peak * a11)) * per_determinant
        sums[x] = peak
        sums[TILE + x] = np.divide(residual * spread, freedom * np.float32(4) * bend * bend)
        sums[2 * TILE + x] = bend
