"""What is kept of the focus curve of each pixel while the frames of a stack arrive, in any order.

Frames are known by their place: neighbours in z are neighbours in place, whichever came first. Of each
pixel's curve the frames within ±REACH places of its sharpest are kept, in a ring (place p in slot p modulo
SLOTS), and of all frames the lowest value, of those outside the ring the highest. F is kept as its
logarithm, in which the fit works, in 16 bits.

Rows are worked on in plain loops over few arrays: each becomes vector instructions, and more arrays in one
loop would not, as the compiler gives up proving that they do not overlap.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.compiled import kernel

from .measure import Frame, measure_buffers, measure_row

REACH = 8
"""Frames kept on either side of the sharpest."""

SLOTS = 2 * REACH + 1
OCTAVE = 2048
"""Codes per doubling of F: half of one is 0.017 % of F, far below the noise of any camera."""

Codes = NDArray[np.uint16]


@dataclass(frozen=True)
class Curves:
    """The curves of all pixels, 42 bytes each, and the all-in-focus image.

    A code is 0 where F is 0 or the frame is not there, else 1 + OCTAVE log2 F, rounded.

    Attributes:
        slots: (H, SLOTS, W) uint16, codes round the sharpest frame.
        centre: (H, W) int16, place of the sharpest frame.
        peak: (H, W) uint16, its code.
        lowest: (H, W) uint16, lowest code of all frames.
        outside: (H, W) uint16, highest code of the frames that are not in the slots.
        image: (H, W), every pixel from its sharpest frame.
    """

    slots: Codes
    centre: NDArray[np.int16]
    peak: Codes
    lowest: Codes
    outside: Codes
    image: Frame

    @classmethod
    def empty(cls, frame: Frame) -> 'Curves':
        """Curves before any frame, for frames like this one; all pixels are centred on place 0."""
        height, width = frame.shape
        return cls(
            slots=np.zeros((height, SLOTS, width), np.uint16),
            centre=np.zeros((height, width), np.int16),
            peak=np.zeros((height, width), np.uint16),
            lowest=np.full((height, width), np.iinfo(np.uint16).max, np.uint16),
            outside=np.zeros((height, width), np.uint16),
            image=frame.copy(),
        )

    def add(self, frame: Frame, place: int, step: int, half: int, threshold: int) -> None:
        """Take in a frame at a place; once more at the same place, each pixel keeps the larger F."""
        _add(
            frame,
            place,
            step,
            half,
            threshold,
            self.slots,
            self.centre,
            self.peak,
            self.lowest,
            self.outside,
            self.image,
        )

    def make_room(self, place: int) -> None:
        """Move the frames at this place and above one place up, for a frame that belongs in between.

        What leaves the window is lost before it is known whether the new frame is the sharpest, and its
        window reaches less far. So the outermost places may be missing in one order of the frames and not
        in another; the fit does not use them.
        """
        _make_room(place, self.slots, self.centre, self.outside)


@kernel
def _add(
    frame: Frame,
    place: int,
    step: int,
    half: int,
    threshold: int,
    slots: Codes,
    centre: NDArray[np.int16],
    peak: Codes,
    lowest: Codes,
    outside: Codes,
    image: Frame,
) -> None:
    """`Curves.add` in one pass: F of a row, its code, what is kept of it, while the row is in the cache."""
    height, width = frame.shape
    laplacians, columns = measure_buffers(width, half)
    measure = np.empty(width, np.int32)
    rounded = np.empty(width, np.float32)
    codes = np.empty(width, np.uint16)
    sharper = np.empty(width, np.bool_)
    jumped = np.zeros((width + 7) // 8 * 8, np.bool_)
    for row in range(height):
        measure_row(frame, row, step, half, threshold, laplacians, columns, measure)
        _encode(measure, rounded, rounded.view(np.int32), codes)
        low, high = _compare(codes, place, centre[row], peak[row], sharper)
        _keep(codes, place, slots[row, place % SLOTS], centre[row], lowest[row], outside[row], sharper)
        if low > high:
            continue
        if low < place - 1 or high > place + 1:
            _empty_passed(place, slots[row], centre[row], outside[row], sharper, jumped)
        if low < place:
            _empty(slots[row, (place + REACH) % SLOTS], place - 1, centre[row], outside[row], sharper)
        if high > place:
            _empty(slots[row, (place - REACH) % SLOTS], place + 1, centre[row], outside[row], sharper)
        _recentre(
            codes,
            frame[row],
            place,
            slots[row, place % SLOTS],
            centre[row],
            peak[row],
            image[row],
            sharper,
        )


@kernel
def _encode(
    measure: NDArray[np.int32], rounded: NDArray[np.float32], bits: NDArray[np.int32], codes: Codes
) -> None:
    """Codes of a row of F; `bits` are those of `rounded`.

    A float32 is 2^e (1 + t), and log2(1 + t) = t + t (1 - t) q(t), exact at both ends so that codes rise
    with F. The cubic q, by least squares over [0, 1], leaves 2e-5 octaves, a twentieth of a level.
    """
    for x in range(measure.size):
        rounded[x] = measure[x]
    for x in range(measure.size):
        exponent = (bits[x] >> 23) - 127
        t = np.float32(bits[x] & 0x7FFFFF) * np.float32(2**-23)
        q = np.float32(-0.04400469) * t + np.float32(0.14631434)
        q = q * t + np.float32(-0.26602988)
        q = q * t + np.float32(0.4417403)
        octaves = np.float32(exponent) + (t + t * (np.float32(1) - t) * q)
        code = np.int32(octaves * np.float32(OCTAVE) + np.float32(1.5))
        codes[x] = max(code, np.int32(0))


@kernel
def _compare(
    codes: Codes, place: int, centre: NDArray[np.int16], peak: Codes, sharper: NDArray[np.bool_]
) -> tuple[int, int]:
    """Mark in `sharper` the pixels of a row of which this frame is the sharpest yet.

    Of two frames equally sharp the lower one wins, whichever came first.

    Returns:
        The lowest and the highest centre that these pixels have so far; the other way round if there are
        none.
    """
    here = np.int16(place)
    lowest, highest = np.int16(32767), np.int16(-32768)
    for x in range(codes.size):
        marked = (codes[x] > peak[x]) | ((codes[x] == peak[x]) & (here < centre[x]))
        sharper[x] = marked
        lowest = min(lowest, centre[x] if marked else np.int16(32767))
        highest = max(highest, centre[x] if marked else np.int16(-32768))
    return int(lowest), int(highest)


@kernel
def _keep(
    codes: Codes,
    place: int,
    slot: Codes,
    centre: NDArray[np.int16],
    lowest: Codes,
    outside: Codes,
    sharper: NDArray[np.bool_],
) -> None:
    """Keep a row's codes of one frame, where it is not the sharpest."""
    first, last = np.int16(place - REACH), np.int16(place + REACH)
    for x in range(codes.size):
        lowest[x] = min(lowest[x], codes[x])
    for x in range(codes.size):
        far = (centre[x] < first) | (centre[x] > last) | sharper[x]
        slot[x] = max(slot[x], np.uint16(0) if far else codes[x])
    for x in range(codes.size):
        near = ((centre[x] >= first) & (centre[x] <= last)) | sharper[x]
        outside[x] = max(outside[x], np.uint16(0) if near else codes[x])


@kernel
def _empty(
    slot: Codes, neighbour: int, centre: NDArray[np.int16], outside: Codes, sharper: NDArray[np.bool_]
) -> None:
    """Empty the slot that goes to another place where the centre moves on from the neighbouring place."""
    before = np.int16(neighbour)
    for x in range(slot.size):
        moves = sharper[x] & (centre[x] == before)
        outside[x] = max(outside[x], slot[x] if moves else np.uint16(0))
        slot[x] = np.uint16(0) if moves else slot[x]


@kernel
def _empty_passed(
    place: int,
    slots: Codes,
    centre: NDArray[np.int16],
    outside: Codes,
    sharper: NDArray[np.bool_],
    jumped: NDArray[np.bool_],
) -> None:
    """Empty the slots that go to other places where the centre moves by more than one place.

    These pixels are few, mostly noise before the peak: eight at a time are passed over where there are none.
    """
    before, after = np.int16(place - 1), np.int16(place + 1)
    for x in range(sharper.size):
        jumped[x] = sharper[x] & ((centre[x] < before) | (centre[x] > after))
    eights = jumped.view(np.uint64)
    for eight in range(eights.size):
        if eights[eight] == 0:
            continue
        for x in range(8 * eight, 8 * eight + 8):
            if not jumped[x]:
                continue
            moved = place - centre[x]
            # the first of the places that are left behind
            left = centre[x] - REACH if moved > 0 else place + REACH + 1
            slot = left % SLOTS
            for _ in range(min(abs(moved), SLOTS)):
                outside[x] = max(outside[x], slots[slot, x])
                slots[slot, x] = 0
                slot = slot + 1 if slot + 1 < SLOTS else 0


@kernel
def _recentre(
    codes: Codes,
    pixels: Frame,
    place: int,
    slot: Codes,
    centre: NDArray[np.int16],
    peak: Codes,
    image: Frame,
    sharper: NDArray[np.bool_],
) -> None:
    """Make this frame the centre where it is the sharpest."""
    here = np.int16(place)
    for x in range(codes.size):
        slot[x] = codes[x] if sharper[x] else slot[x]
    for x in range(codes.size):
        peak[x] = max(peak[x], codes[x])
    for x in range(codes.size):
        centre[x] = here if sharper[x] else centre[x]
    for x in range(codes.size):
        image[x] = pixels[x] if sharper[x] else image[x]


@kernel
def _make_room(place: int, slots: Codes, centre: NDArray[np.int16], outside: Codes) -> None:
    """`Curves.make_room`: codes move with their places, one is pushed out of the window."""
    height, _, width = slots.shape
    old = np.empty(SLOTS, np.uint16)
    for row in range(height):
        for x in range(width):
            before = centre[row, x]
            if before + REACH < place:
                continue
            after = before + 1 if before >= place else before
            for slot in range(SLOTS):
                old[slot] = slots[row, slot, x]
            for now in range(after - REACH, after + REACH + 1):
                if now == place:
                    slots[row, now % SLOTS, x] = 0
                else:
                    slots[row, now % SLOTS, x] = old[(now if now < place else now - 1) % SLOTS]
            pushed_out = before - REACH if before >= place else before + REACH
            if (pushed_out < place) == (before >= place):
                outside[row, x] = max(outside[row, x], old[pushed_out % SLOTS])
            centre[row, x] = after
