"""What is kept of the focus curve of each pixel while the frames of a stack arrive, in any order.

Frames are known by their place: neighbours in z are neighbours in place, whichever came first. Of each
pixel's curve the frames within REACH places of its sharpest, its centre, are kept in a ring (place p in
slot p modulo SLOTS); of all frames the lowest value, and of those outside the ring the highest. F is kept
as its logarithm, in which the fit works, in 16 bits.

When the centre moves, slots are left as they are, and from which place to which they hold what they should
is kept beside them. To empty them would take longer than all else: noise moves centres everywhere, far,
before the peak.

Rows are worked on in plain loops over few arrays, and both sides of a choice are read before it is made:
each loop becomes vector instructions, which it would not if the compiler had to prove of more arrays that
they do not overlap, or of a value that it may be read though it is not chosen.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.kernels.compiled import kernel

from .measure import Frame, measure_buffers, measure_row

REACH = 8
"""Frames kept on either side of the sharpest."""

SLOTS = 2 * REACH + 1
OCTAVE = 2048
"""Codes per doubling of F: half of one is 0.017 % of F, far below the noise of any camera."""

FROM_BELOW, TO_ABOVE = -32768, 32767

Codes = NDArray[np.uint16]
Places = NDArray[np.int16]


@dataclass(frozen=True)
class Curves:
    """The curves of all pixels, 46 bytes each, and the all-in-focus image.

    A code is 0 where F is 0 or the frame is not there, else 1 + OCTAVE log2 F, rounded.

    Attributes:
        slots: (H, SLOTS, W) uint16, codes round the sharpest frame.
        centre: (H, W) int16, place of the sharpest frame.
        since: (H, W) int16, the slots are right from this place on; FROM_BELOW if from the lowest.
        until: (H, W) int16, and up to this place; TO_ABOVE if to the highest.
        peak: (H, W) uint16, its code.
        lowest: (H, W) uint16, lowest code of all frames.
        outside: (H, W) uint16, highest code of the frames that are not in the slots.
        image: (H, W), every pixel from its sharpest frame.
    """

    slots: Codes
    centre: Places
    since: Places
    until: Places
    peak: Codes
    lowest: Codes
    outside: Codes
    image: Frame

    @classmethod
    def like(cls, frame: Frame) -> 'Curves':
        """Memory for the curves of frames like this one; `begin` makes it ready."""
        height, width = frame.shape
        return cls(
            slots=np.empty((height, SLOTS, width), np.uint16),
            centre=np.empty((height, width), np.int16),
            since=np.empty((height, width), np.int16),
            until=np.empty((height, width), np.int16),
            peak=np.empty((height, width), np.uint16),
            lowest=np.empty((height, width), np.uint16),
            outside=np.empty((height, width), np.uint16),
            image=np.empty_like(frame),
        )

    def begin(self, frame: Frame) -> None:
        """Forget all frames; this is the first, and goes to place 0, where all pixels are centred.

        The slots need nothing: no place is read before its frame has come.
        """
        self.centre[:] = 0
        self.since[:] = FROM_BELOW
        self.until[:] = TO_ABOVE
        self.peak[:] = 0
        self.lowest[:] = np.iinfo(np.uint16).max
        self.outside[:] = 0
        self.image[:] = frame

    def add(
        self, frame: Frame, place: int, places: range, step: int, half: int, threshold: int, *, known: bool
    ) -> None:
        """Take in a frame.

        Args:
            frame: like the others.
            place: where it belongs.
            places: of all frames, this one's included.
            step: as in `measure_row`.
            half: likewise.
            threshold: likewise.
            known: whether there is a frame at this place already; each pixel then keeps the larger F.
        """
        _add(
            frame,
            place,
            places[0],
            places[-1],
            known,
            step,
            half,
            threshold,
            self.slots,
            self.centre,
            self.since,
            self.until,
            self.peak,
            self.lowest,
            self.outside,
            self.image,
        )

    def make_room(self, place: int, places: range) -> None:
        """Move the frames at this place and above, of the places so far, one up for a frame in between.

        What leaves the window is lost before it is known whether the new frame is the sharpest, and its
        window reaches less far. So the outermost places may be missing in one order of the frames and not
        in another; the fit does not use them.
        """
        _make_room(place, places[0], places[-1], self.slots, self.centre, self.since, self.until, self.outside)


@kernel
def _add(
    frame: Frame,
    place: int,
    first: int,
    last: int,
    known: bool,
    step: int,
    half: int,
    threshold: int,
    slots: Codes,
    centre: Places,
    since: Places,
    until: Places,
    peak: Codes,
    lowest: Codes,
    outside: Codes,
    image: Frame,
) -> None:
    """`Curves.add` in one pass: F of a row, its code, what is kept of it, while it is in the cache."""
    height, width = frame.shape
    laplacians, columns = measure_buffers(width, half)
    measure = np.empty(width, np.int32)
    rounded = np.empty(width, np.float32)
    codes = np.empty(width, np.uint16)
    sharper = np.empty(width, np.bool_)
    kept = np.empty(width, np.bool_)
    for row in range(height):
        measure_row(frame, row, step, half, threshold, laplacians, columns, measure)
        _encode(measure, rounded, rounded.view(np.int32), codes)
        slot, centres = slots[row, place % SLOTS], centre[row]
        low, high = _compare(codes, place, centres, peak[row], sharper)
        _keep(codes, place, known, slot, centres, since[row], until[row], sharper, kept)
        if first < place < last and not known:
            _extend(place, since[row], until[row], kept)
        _note(codes, lowest[row], outside[row], sharper, kept)
        if low > high:
            continue
        if low < place and place - 1 - REACH >= first:
            behind = slots[row, (place + REACH) % SLOTS]
            _leave(behind, place - 1, place - 1 - REACH, centres, since[row], until[row], outside[row], sharper)
        if high > place and place + 1 + REACH <= last:
            behind = slots[row, (place - REACH) % SLOTS]
            _leave(behind, place + 1, place + 1 + REACH, centres, since[row], until[row], outside[row], sharper)
        _bound(place, first, last, centres, since[row], until[row], peak[row], outside[row], sharper, kept)
        _recentre(codes, frame[row], place, slot, centres, peak[row], image[row], sharper)


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
        exponent = np.int32(np.int32(bits[x] >> 23) - np.int32(127))
        t = np.float32(np.int32(bits[x] & np.int32(0x7FFFFF))) * np.float32(2**-23)
        q = np.float32(-0.04400469) * t + np.float32(0.14631434)
        q = q * t + np.float32(-0.26602988)
        q = q * t + np.float32(0.4417403)
        octaves = np.float32(exponent) + (t + t * (np.float32(1) - t) * q)
        code = np.int32(octaves * np.float32(OCTAVE) + np.float32(1.5))
        codes[x] = max(code, np.int32(0))


@kernel
def _compare(codes: Codes, place: int, centre: Places, peak: Codes, sharper: NDArray[np.bool_]) -> tuple[int, int]:
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
    known: bool,
    slot: Codes,
    centre: Places,
    since: Places,
    until: Places,
    sharper: NDArray[np.bool_],
    kept: NDArray[np.bool_],
) -> None:
    """Keep the codes of a row where the frame is not the sharpest, but belongs in the slots.

    A new frame may also be next to those that the slots hold. A known one may not: coming twice, it changes
    nothing.
    """
    first, last = np.int16(place - REACH), np.int16(place + REACH)
    beside = 0 if known else 1
    before, after = np.int16(place - beside), np.int16(place + beside)
    for x in range(codes.size):
        kept[x] = (centre[x] >= first) & (centre[x] <= last) & ~sharper[x]
    for x in range(codes.size):
        kept[x] &= (since[x] <= after) & (until[x] >= before)
    if known:
        for x in range(codes.size):
            code, held = codes[x], slot[x]
            slot[x] = max(held, code) if kept[x] else held
    else:
        for x in range(codes.size):
            code, held = codes[x], slot[x]
            slot[x] = code if kept[x] else held


@kernel
def _extend(place: int, since: Places, until: Places, kept: NDArray[np.bool_]) -> None:
    """Count the place of the frame among those that the slots hold."""
    here = np.int16(place)
    for x in range(kept.size):
        since[x] = min(since[x], here) if kept[x] else since[x]
    for x in range(kept.size):
        until[x] = max(until[x], here) if kept[x] else until[x]


@kernel
def _note(
    codes: Codes, lowest: Codes, outside: Codes, sharper: NDArray[np.bool_], kept: NDArray[np.bool_]
) -> None:
    """Note the extremes of the curve."""
    for x in range(codes.size):
        lowest[x] = min(lowest[x], codes[x])
    for x in range(codes.size):
        code = codes[x]
        outside[x] = max(outside[x], np.uint16(0) if kept[x] | sharper[x] else code)


@kernel
def _leave(
    slot: Codes,
    neighbour: int,
    left: int,
    centre: Places,
    since: Places,
    until: Places,
    outside: Codes,
    sharper: NDArray[np.bool_],
) -> None:
    """Note what is in the slot of the place that is left behind where the centre moves on from a neighbour.

    What a longer move leaves behind need not be noted: it is the flank of an old centre that is itself
    still in the slots, or noted by `_bound`.
    """
    before, behind = np.int16(neighbour), np.int16(left)
    for x in range(slot.size):
        moves = sharper[x] & (centre[x] == before) & (since[x] <= behind) & (until[x] >= behind)
        held = slot[x]
        outside[x] = max(outside[x], held if moves else np.uint16(0))


@kernel
def _bound(
    place: int,
    first: int,
    last: int,
    centre: Places,
    since: Places,
    until: Places,
    peak: Codes,
    outside: Codes,
    sharper: NDArray[np.bool_],
    joined: NDArray[np.bool_],
) -> None:
    """Find from where to where the slots are right once the centre has moved.

    Where it moves further than the slots reach, nothing but the new centre is.
    """
    here, before, after = np.int16(place), np.int16(place - 1), np.int16(place + 1)
    nearest, farthest = np.int16(place - REACH - 1), np.int16(place + REACH + 1)
    for x in range(sharper.size):
        joined[x] = (centre[x] >= nearest) & (centre[x] <= farthest)
    for x in range(sharper.size):
        joined[x] &= (since[x] <= after) & (until[x] >= before)
    for x in range(sharper.size):
        old_peak = peak[x]
        outside[x] = max(outside[x], old_peak if sharper[x] & ~joined[x] else np.uint16(0))
    for x in range(sharper.size):
        moved = min(max(since[x], np.int16(centre[x] - REACH)), here) if centre[x] > here else since[x]
        moved = moved if joined[x] else here
        since[x] = moved if sharper[x] else since[x]
    for x in range(sharper.size):
        moved = max(min(until[x], np.int16(centre[x] + REACH)), here) if centre[x] < here else until[x]
        moved = moved if joined[x] else here
        until[x] = moved if sharper[x] else until[x]
    if place == first:  # there is nothing below that could be missing
        for x in range(sharper.size):
            since[x] = np.int16(FROM_BELOW) if sharper[x] else since[x]
    if place == last:
        for x in range(sharper.size):
            until[x] = np.int16(TO_ABOVE) if sharper[x] else until[x]


@kernel
def _recentre(
    codes: Codes,
    pixels: Frame,
    place: int,
    slot: Codes,
    centre: Places,
    peak: Codes,
    image: Frame,
    sharper: NDArray[np.bool_],
) -> None:
    """Make this frame the centre where it is the sharpest."""
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


@kernel
def _make_room(
    place: int,
    first: int,
    last: int,
    slots: Codes,
    centre: Places,
    since: Places,
    until: Places,
    outside: Codes,
) -> None:
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
            out = before - REACH if before >= place else before + REACH
            is_there = max(first, since[row, x]) <= out <= min(last, until[row, x])
            if is_there and (out < place) == (before >= place):
                outside[row, x] = max(outside[row, x], old[out % SLOTS])
            centre[row, x] = after
            if since[row, x] >= place:
                since[row, x] += 1
            if place <= until[row, x] < TO_ABOVE:
                until[row, x] += 1
