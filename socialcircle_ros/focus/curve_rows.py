"""How one frame changes what is kept of the focus curves of one row of pixels. See `curve` for what is kept.

Each function works on whole rows in plain loops over few arrays, and reads both sides of a choice before it
chooses. The compiler then vectorises each loop. It would not if it had to prove that many arrays do not
overlap, or that a value may be read although it is not chosen.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.cloud import Mask
from socialcircle_ros.kernels.compiled import kernel

from .measure import Frame

REACH = 8
"""Frames kept on either side of the sharpest one."""

SLOTS = 2 * REACH + 1
"""Frames kept of each pixel. The frame at place p is in slot p modulo SLOTS."""

CODES_PER_OCTAVE = 2048
"""Codes per doubling of F: half a code is 0.017 % of F, far below the noise of any camera."""

FROM_LOWEST, TO_HIGHEST = -32768, 32767
"""Values of `valid_from` and `valid_to` where nothing is missing at that end of the scan."""

Codes = NDArray[np.uint16]
"""Values of F on a logarithmic scale: 0 where F is 0 or there is no frame, else 1 + CODES_PER_OCTAVE log2 F."""

Places = NDArray[np.int16]
"""Places of frames: their order in z, see `curve`."""


class CurveArrays(NamedTuple):
    """What is kept of the curves of all pixels, or, without the leading axis, of one row of pixels."""

    slots: Codes
    """(H, SLOTS, W): the codes of the frames next to the sharpest one."""

    centre: Places
    """(H, W): the place of the sharpest frame."""

    valid_from: Places
    """(H, W): the slots are valid from this place on; FROM_LOWEST: from the lowest frame on."""

    valid_to: Places
    """(H, W): the slots are valid up to this place; TO_HIGHEST: up to the highest frame."""

    peak: Codes
    """(H, W): the code of the sharpest frame."""

    lowest: Codes
    """(H, W): the lowest code of all frames."""

    outside: Codes
    """(H, W): the highest code of the frames that are not in the slots."""

    def band(self, rows: slice) -> 'CurveArrays':
        """The curves of some rows of pixels, as views."""
        return CurveArrays._make(array[rows] for array in self)


@kernel
def row_of(curves: CurveArrays, row: int) -> CurveArrays:
    """Return the curves of one row of pixels, as views."""
    return CurveArrays(
        curves.slots[row],
        curves.centre[row],
        curves.valid_from[row],
        curves.valid_to[row],
        curves.peak[row],
        curves.lowest[row],
        curves.outside[row],
    )


@kernel
def encode(
    measure: NDArray[np.int32], rounded: NDArray[np.float32], bits: NDArray[np.int32], codes: Codes
) -> None:
    """Write the codes of a row of F; `rounded` is a work array and `bits` is a view of its bits.

    A float32 is 2^e (1 + t), and log2(1 + t) = t + t (1 - t) q(t). This is exact at t = 0 and t = 1, so that
    codes rise with F. The cubic q is a least-squares fit over [0, 1]; its error is 2e-5 octaves, a twentieth of
    a code.
    """
    for x in range(measure.size):
        rounded[x] = measure[x]
    for x in range(measure.size):
        exponent = np.int32(np.int32(bits[x] >> 23) - np.int32(127))
        t = np.float32(np.int32(bits[x] & np.int32(0x7FFFFF))) * np.float32(2**-23)
        q = np.float32(-0.04400469) * t + np.float32(0.14631434)
        q = q * t + np.float32(-0.26602988)
        q = q * t + np.float32(0.4417403)
        octaves = np.float32(exponent) + (t + t * (np.float32(1) - t) * q)
        code = np.int32(octaves * np.float32(CODES_PER_OCTAVE) + np.float32(1.5))
        codes[x] = max(code, np.int32(0))


@kernel
def mark_sharper(codes: Codes, place: int, curve: CurveArrays, sharper: Mask) -> tuple[int, int]:
    """Mark in `sharper` the pixels of a row that have their sharpest frame so far in this one.

    Of two equally sharp frames the lower one wins, in whichever order they come.

    Returns:
        The lowest and the highest centre that these pixels have so far; the lowest is above the highest if there
        is no such pixel.
    """
    centre, peak = curve.centre, curve.peak
    here = np.int16(place)
    lowest, highest = np.int16(32767), np.int16(-32768)
    for x in range(codes.size):
        marked = (codes[x] > peak[x]) | ((codes[x] == peak[x]) & (here < centre[x]))
        sharper[x] = marked
        lowest = min(lowest, centre[x] if marked else np.int16(32767))
        highest = max(highest, centre[x] if marked else np.int16(-32768))
    return int(lowest), int(highest)


@kernel
def keep_beside_centre(
    codes: Codes, place: int, is_known: bool, curve: CurveArrays, sharper: Mask, kept: Mask
) -> None:
    """Keep the codes of a row in their slot where the frame is near the sharpest one, but is not sharper.

    `kept` marks these pixels. A new frame may also be the neighbour of those that the slots hold. A frame at a
    known place must be one of them, so that a frame that comes twice changes nothing.
    """
    slot, centre = curve.slots[place % SLOTS], curve.centre
    valid_from, valid_to = curve.valid_from, curve.valid_to
    first, last = np.int16(place - REACH), np.int16(place + REACH)
    beside = 0 if is_known else 1
    before, after = np.int16(place - beside), np.int16(place + beside)
    for x in range(codes.size):
        kept[x] = (centre[x] >= first) & (centre[x] <= last) & ~sharper[x]
    for x in range(codes.size):
        kept[x] &= (valid_from[x] <= after) & (valid_to[x] >= before)
    if is_known:
        for x in range(codes.size):
            code, held = codes[x], slot[x]
            slot[x] = max(held, code) if kept[x] else held
    else:
        for x in range(codes.size):
            code, held = codes[x], slot[x]
            slot[x] = code if kept[x] else held


@kernel
def extend_validity(place: int, curve: CurveArrays, kept: Mask) -> None:
    """Extend the valid places of the kept pixels to the place of the frame."""
    valid_from, valid_to = curve.valid_from, curve.valid_to
    here = np.int16(place)
    for x in range(kept.size):
        valid_from[x] = min(valid_from[x], here) if kept[x] else valid_from[x]
    for x in range(kept.size):
        valid_to[x] = max(valid_to[x], here) if kept[x] else valid_to[x]


@kernel
def update_extremes(codes: Codes, curve: CurveArrays, sharper: Mask, kept: Mask) -> None:
    """Update the lowest code, and the highest code outside the slots where the frame is not in them."""
    lowest, outside = curve.lowest, curve.outside
    for x in range(codes.size):
        lowest[x] = min(lowest[x], codes[x])
    for x in range(codes.size):
        code = codes[x]
        outside[x] = max(outside[x], np.uint16(0) if kept[x] | sharper[x] else code)


@kernel
def update_outside(neighbour: int, left: int, curve: CurveArrays, sharper: Mask) -> None:
    """Update the highest code outside the slots where the centre moves by one place.

    Args:
        neighbour: the centre so far.
        left: the place that the slots no longer hold once the centre has moved.
        curve: of the row.
        sharper: the pixels with a centre that moves, from `neighbour` or from elsewhere.

    A longer move needs no update: what it leaves behind is the flank of an old centre. That centre is still in
    the slots, or `move_validity` counts it.
    """
    slot, centre, outside = curve.slots[left % SLOTS], curve.centre, curve.outside
    valid_from, valid_to = curve.valid_from, curve.valid_to
    before, behind = np.int16(neighbour), np.int16(left)
    for x in range(slot.size):
        moves = sharper[x] & (centre[x] == before) & (valid_from[x] <= behind) & (valid_to[x] >= behind)
        held = slot[x]
        outside[x] = max(outside[x], held if moves else np.uint16(0))


@kernel
def move_validity(place: int, first: int, last: int, curve: CurveArrays, sharper: Mask, joined: Mask) -> None:
    """Set the places at which the slots are valid once the centre has moved to `place`.

    Where the centre moves farther than the slots reach, only the new centre is valid, and the old peak is now
    outside. `joined` is a work array: it marks the pixels where the old slots are still of use.

    Args:
        place: the new centre.
        first: the lowest place of all frames.
        last: the highest place of all frames.
        curve: of the row.
        sharper: the pixels with a centre that moves.
        joined: overwritten.
    """
    centre, peak, outside = curve.centre, curve.peak, curve.outside
    valid_from, valid_to = curve.valid_from, curve.valid_to
    here, before, after = np.int16(place), np.int16(place - 1), np.int16(place + 1)
    nearest, farthest = np.int16(place - REACH - 1), np.int16(place + REACH + 1)
    for x in range(sharper.size):
        joined[x] = (centre[x] >= nearest) & (centre[x] <= farthest)
    for x in range(sharper.size):
        joined[x] &= (valid_from[x] <= after) & (valid_to[x] >= before)
    for x in range(sharper.size):
        old_peak = peak[x]
        outside[x] = max(outside[x], old_peak if sharper[x] & ~joined[x] else np.uint16(0))
    for x in range(sharper.size):
        moved = min(max(valid_from[x], np.int16(centre[x] - REACH)), here) if centre[x] > here else valid_from[x]
        moved = moved if joined[x] else here
        valid_from[x] = moved if sharper[x] else valid_from[x]
    for x in range(sharper.size):
        moved = max(min(valid_to[x], np.int16(centre[x] + REACH)), here) if centre[x] < here else valid_to[x]
        moved = moved if joined[x] else here
        valid_to[x] = moved if sharper[x] else valid_to[x]
    if place == first:  # no frame below this one can be missing
        for x in range(sharper.size):
            valid_from[x] = np.int16(FROM_LOWEST) if sharper[x] else valid_from[x]
    if place == last:
        for x in range(sharper.size):
            valid_to[x] = np.int16(TO_HIGHEST) if sharper[x] else valid_to[x]


@kernel
def move_centre(codes: Codes, pixels: Frame, place: int, curve: CurveArrays, image: Frame, sharper: Mask) -> None:
    """Make this frame the centre of the sharper pixels, and copy these pixels to the all-in-focus image."""
    slot, centre, peak = curve.slots[place % SLOTS], curve.centre, curve.peak
    here = np.int16(place)
    for x in range(codes.size):
        code, held = codes[x], slot[x]
        slot[x] = code if sharper[x] else held
    for x in range(codes.size):
        peak[x] = max(peak[x], codes[x])
    for x in range(codes.size):
        old = centre[x]
        centre[x] = here if sharper[x] else old
    for x in range(codes.size):
        pixel, held = pixels[x], image[x]
        image[x] = pixel if sharper[x] else held
