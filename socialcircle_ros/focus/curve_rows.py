# SPDX-License-Identifier: Apache-2.0
"""How one frame changes what is kept of the focus curves of one row of pixels. See `curve` for what is kept.

Each function works on whole rows in plain loops over few arrays, and reads both sides of a choice before it
chooses. The compiler then vectorises each loop. It would not if it had to prove that many arrays do not
overlap, or that a value may be read although it is not chosen. What only frames out of order need works pixel by
pixel.
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

NO_FRAME = 0
"""Code in a slot without a frame."""

Codes = NDArray[np.uint16]
"""Values of F on a logarithmic scale: 1 + CODES_PER_OCTAVE log2 F, 1 where F is 0; NO_FRAME: there is no frame."""

Places = NDArray[np.int16]
"""Places of frames: their order in z, see `curve`."""


class CurveArrays(NamedTuple):
    """What is kept of the curves of all pixels, or, without the leading axis, of one row of pixels."""

    slots: Codes
    """(H, SLOTS, W): the codes of the released frames next to the sharpest one."""

    recent: Codes
    """(H, RECENT, W): the codes of the frames that are held back."""

    centre: Places
    """(H, W): the place of the sharpest frame."""

    peak: Codes
    """(H, W): the code of the sharpest frame."""

    lowest: Codes
    """(H, W): the lowest code of all frames."""

    outside: Codes
    """(H, W): the highest code of the released frames that are not in the slots."""

    def band(self, rows: slice) -> 'CurveArrays':
        """The curves of some rows of pixels, as views."""
        return CurveArrays._make(array[rows] for array in self)


class RowBuffers(NamedTuple):
    """Work arrays for one row of pixels; `row_buffers` makes them."""

    codes: Codes
    """(W,): of the new frame."""

    sharper: Mask
    """(W,): where the new frame is the sharpest one."""

    displaced: Codes
    """(W,): codes that leave the slots, or never come into them."""


@kernel
def row_buffers(width: int) -> RowBuffers:
    """Return the work arrays for rows of `width` pixels."""
    return RowBuffers(np.empty(width, np.uint16), np.empty(width, np.bool_), np.empty(width, np.uint16))


@kernel
def row_of(curves: CurveArrays, row: int) -> CurveArrays:
    """Return the curves of one row of pixels, as views."""
    return CurveArrays(
        curves.slots[row],
        curves.recent[row],
        curves.centre[row],
        curves.peak[row],
        curves.lowest[row],
        curves.outside[row],
    )


@kernel
def encode(
    measure: NDArray[np.int32],
    offset: np.float32,
    rounded: NDArray[np.float32],
    bits: NDArray[np.int32],
    codes: Codes,
) -> None:
    """Write the codes of a row of F plus an offset; `rounded` is a work array and `bits` is a view of its bits.

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
        code = np.int32(octaves * np.float32(CODES_PER_OCTAVE) + (offset + np.float32(1.5)))
        codes[x] = min(max(code, np.int32(1)), np.int32(65535))


@kernel
def mark_sharper(codes: Codes, place: int, curve: CurveArrays, sharper: Mask) -> bool:
    """Mark in `sharper` the pixels of a row that have their sharpest frame so far in this one.

    Of two equally sharp frames the lower one wins, in whichever order they come.

    Returns:
        Whether there is such a pixel.
    """
    centre, peak = curve.centre, curve.peak
    here = np.int16(place)
    count = np.int32(0)
    for x in range(codes.size):
        marked = (codes[x] > peak[x]) | ((codes[x] == peak[x]) & (here < centre[x]))
        sharper[x] = marked
        count = np.int32(count + np.int32(marked))
    return bool(count > 0)


@kernel
def update_lowest(codes: Codes, curve: CurveArrays) -> None:
    """Update the lowest code."""
    lowest = curve.lowest
    for x in range(codes.size):
        lowest[x] = min(lowest[x], codes[x])


@kernel
def move_centre(codes: Codes, pixels: Frame, place: int, curve: CurveArrays, image: Frame, sharper: Mask) -> None:
    """Make this frame the centre of the sharper pixels, and copy these pixels to the all-in-focus image."""
    centre, peak = curve.centre, curve.peak
    here = np.int16(place)
    for x in range(codes.size):
        peak[x] = max(peak[x], codes[x])
    for x in range(codes.size):
        old = centre[x]
        centre[x] = here if sharper[x] else old
    for x in range(codes.size):
        pixel, held = pixels[x], image[x]
        image[x] = pixel if sharper[x] else held


@kernel
def take_brighter(codes: Codes, pixels: Frame, place: int, curve: CurveArrays, image: Frame) -> None:
    """Of two equally sharp frames at the same z, show the brighter pixel, in whichever order they come."""
    centre, peak = curve.centre, curve.peak
    here = np.int16(place)
    for x in range(codes.size):
        pixel, shown = pixels[x], image[x]
        image[x] = max(pixel, shown) if (codes[x] == peak[x]) & (centre[x] == here) else shown


@kernel
def hold_back(codes: Codes, held: Codes, is_known: bool) -> None:
    """Write the codes of a frame to where they are held back; of two frames at the same z, the larger codes."""
    if is_known:
        for x in range(codes.size):
            held[x] = max(held[x], codes[x])
    else:
        for x in range(codes.size):
            held[x] = codes[x]


@kernel
def release(codes: Codes, place: int, centre: Places, slot: Codes, outside: Codes, displaced: Codes) -> None:
    """Put the codes of a frame into its slot where it is near the sharpest one; elsewhere it is outside.

    What was in the slot is outside from now on: it is SLOTS places or more away.

    Args:
        codes: (W,), of the frame.
        place: of the frame.
        centre: (W,), of the sharpest frames.
        slot: (W,), updated.
        outside: (W,), updated.
        displaced: (W,), a work array.
    """
    first, last = np.int16(place - REACH), np.int16(place + REACH)
    for x in range(codes.size):
        code, held = codes[x], slot[x]
        near = (centre[x] >= first) & (centre[x] <= last)
        slot[x] = code if near else held
        displaced[x] = held if near else code
    for x in range(codes.size):
        outside[x] = max(outside[x], displaced[x])


@kernel
def forget_lost(place: int, curve: CurveArrays, sharper: Mask, displaced: Codes) -> None:
    """Empty the slot of a released frame where the centre will move, and was too far from it to keep it."""
    slot, centre, outside = curve.slots[place % SLOTS], curve.centre, curve.outside
    first, last = np.int16(place - REACH), np.int16(place + REACH)
    for x in range(slot.size):
        held = slot[x]
        lost = ((centre[x] < first) | (centre[x] > last)) & sharper[x]
        slot[x] = np.uint16(NO_FRAME) if lost else held
        displaced[x] = held if lost else np.uint16(NO_FRAME)
    for x in range(slot.size):
        outside[x] = max(outside[x], displaced[x])


@kernel
def open_place(place: int, first: int, last: int, curve: CurveArrays, old: Codes) -> None:
    """Move the released frames at this place and above up by one, for a late frame in between.

    The frame that leaves the ring is lost before it is known whether the late frame is the sharpest one, and the
    ring of a late frame reaches less far. The fit therefore does not use the outermost places.

    Args:
        place: of the late frame.
        first: place of the lowest released frame so far.
        last: place of the highest one.
        curve: of the row.
        old: (SLOTS,), a work array.
    """
    slots, centre, outside = curve.slots, curve.centre, curve.outside
    for x in range(centre.size):
        before = np.int64(centre[x])
        if before + REACH < place:
            continue
        after = before + 1 if before >= place else before
        for slot in range(SLOTS):
            old[slot] = slots[slot, x]
            slots[slot, x] = NO_FRAME
        for was in range(before - REACH, before + REACH + 1):
            now = was + 1 if was >= place else was
            if first <= was <= last and abs(now - after) <= REACH:
                slots[now % SLOTS, x] = old[was % SLOTS]
            else:
                outside[x] = max(outside[x], old[was % SLOTS])
        centre[x] = after


@kernel
def insert_late(codes: Codes, place: int, is_known: bool, curve: CurveArrays, sharper: Mask) -> None:
    """Put the codes of a late frame into the slots, before the centre of the sharper pixels moves to it."""
    slot, centre, outside = curve.slots[place % SLOTS], curve.centre, curve.outside
    for x in range(codes.size):
        near = abs(np.int64(centre[x]) - place) <= REACH
        if sharper[x]:
            outside[x] = max(outside[x], np.uint16(NO_FRAME) if near else slot[x])
            slot[x] = codes[x]
        elif not near:
            outside[x] = max(outside[x], codes[x])
        elif not is_known or slot[x] != NO_FRAME:
            slot[x] = max(slot[x], codes[x])


@kernel
def shift_centres(from_place: int, shift: int, centre: Places) -> None:
    """Move the centres at this place and above up by one; below and at it down by one where `shift` is -1."""
    bound = np.int16(from_place)
    if shift > 0:
        for x in range(centre.size):
            centre[x] += np.int16(centre[x] >= bound)
    else:
        for x in range(centre.size):
            centre[x] -= np.int16(centre[x] <= bound)


@kernel
def count_beyond_as_outside(first: int, last: int, centre: Places, slots: Codes, outside: Codes) -> None:
    """Count what is in the slots of places beyond the scan as outside: it is left of an older centre.

    Args:
        first: place of the lowest frame of all.
        last: place of the highest one.
        centre: (W,).
        slots: (SLOTS, W).
        outside: (W,), updated.
    """
    least, most = np.int16(first + REACH), np.int16(last - REACH)
    for x in range(centre.size):
        if least <= centre[x] <= most:
            continue
        for place in range(centre[x] - REACH, centre[x] + REACH + 1):
            if not first <= place <= last:
                outside[x] = max(outside[x], slots[place % SLOTS, x])


@kernel
def mark_incomplete(first: int, last: int, reach: int, centre: Places, slots: Codes, incomplete: Mask) -> None:
    """Mark the pixels that lack a frame of the scan within `reach` places of their sharpest one.

    Args:
        first: place of the lowest frame of all.
        last: place of the highest one.
        reach: in places.
        centre: (W,).
        slots: (SLOTS, W).
        incomplete: (W,), written.
    """
    for x in range(centre.size):
        lacks = False
        for place in range(max(centre[x] - reach, first), min(centre[x] + reach, last) + 1):
            lacks |= slots[place % SLOTS, x] == NO_FRAME
        incomplete[x] = lacks
