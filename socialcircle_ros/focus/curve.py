"""What is kept of the focus curve of each pixel while the frames of a stack arrive, in any order.

A focus curve is F of one pixel over z. Each frame has a place, an integer that is its order in z: neighbours in
z are neighbours in place, in whichever order they arrive. Of each curve three things are kept:

- the frames within REACH places of the sharpest one (the centre), in a ring of SLOTS slots;
- the lowest value of all frames;
- the highest value of the frames outside the ring.

F is kept as its logarithm, on which the fit works, in 16 bits.

When the centre moves, the slots stay as they are, and the arrays `valid_from` and `valid_to` say which of them
still hold what they should. Clearing slots would take longer than everything else: before the peak, noise moves
the centres of many pixels over long distances.
"""

from dataclasses import dataclass

import numpy as np

from socialcircle_ros.kernels.compiled import kernel

from .curve_rows import (
    FROM_LOWEST,
    REACH,
    SLOTS,
    TO_HIGHEST,
    CurveArrays,
    encode,
    extend_validity,
    keep_beside_centre,
    mark_sharper,
    move_centre,
    move_validity,
    row_of,
    update_extremes,
    update_outside,
)
from .measure import Frame, MeasureParameters, measure_buffers, measure_row


@dataclass(frozen=True)
class Curves:
    """The focus curves of all pixels, 46 bytes each, and the all-in-focus image.

    Attributes:
        arrays: what is kept of the curves.
        image: (H, W), every pixel from its sharpest frame; the data type of the frames.
    """

    arrays: CurveArrays
    image: Frame

    @classmethod
    def like(cls, frame: Frame) -> 'Curves':
        """Allocate memory for the curves of frames like this one. Call `begin` before `add`."""
        height, width = frame.shape
        return cls(
            CurveArrays(
                slots=np.empty((height, SLOTS, width), np.uint16),
                centre=np.empty((height, width), np.int16),
                valid_from=np.empty((height, width), np.int16),
                valid_to=np.empty((height, width), np.int16),
                peak=np.empty((height, width), np.uint16),
                lowest=np.empty((height, width), np.uint16),
                outside=np.empty((height, width), np.uint16),
            ),
            image=np.empty_like(frame),
        )

    def begin(self, frame: Frame) -> None:
        """Forget all frames, and center all pixels on place 0, the place of this first frame.

        The slots keep their old contents: no slot is read before a frame has been written to it.
        """
        arrays = self.arrays
        arrays.centre[:] = 0
        arrays.valid_from[:] = FROM_LOWEST
        arrays.valid_to[:] = TO_HIGHEST
        arrays.peak[:] = 0
        arrays.lowest[:] = np.iinfo(np.uint16).max
        arrays.outside[:] = 0
        self.image[:] = frame

    def add(
        self, frame: Frame, place: int, places: range, parameters: MeasureParameters, *, is_known: bool
    ) -> None:
        """Add a frame.

        Args:
            frame: (H, W), like the others.
            place: of this frame.
            places: of all frames, with this one.
            parameters: of the focus measure.
            is_known: whether there is a frame at this place already; each pixel then keeps the larger F.
        """
        _add(frame, place, places[0], places[-1], is_known, parameters, self.arrays, self.image)

    def make_room(self, place: int, places: range) -> None:
        """Move the frames at this place and above up by one, for a new frame in between.

        The frame that leaves the ring is lost before it is known whether the new frame is the sharpest one, and
        the ring of the new frame reaches less far. The outermost places may therefore be missing in one order of
        the frames and not in another. The fit does not use them.

        Args:
            place: of the new frame.
            places: of all frames so far.
        """
        _make_room(place, places[0], places[-1], self.arrays)


@kernel
def _add(
    frame: Frame,
    place: int,
    first: int,
    last: int,
    is_known: bool,
    parameters: MeasureParameters,
    curves: CurveArrays,
    image: Frame,
) -> None:
    """`Curves.add` in one pass: each row is measured, encoded and added to its curves while it is in the cache."""
    height, width = frame.shape
    buffers = measure_buffers(width, parameters.half_window)
    measure = np.empty(width, np.int32)
    rounded = np.empty(width, np.float32)
    codes = np.empty(width, np.uint16)
    sharper = np.empty(width, np.bool_)
    kept = np.empty(width, np.bool_)
    for row in range(height):
        measure_row(frame, row, parameters, buffers, measure)
        encode(measure, rounded, rounded.view(np.int32), codes)
        curve = row_of(curves, row)
        low, high = mark_sharper(codes, place, curve, sharper)
        keep_beside_centre(codes, place, is_known, curve, sharper, kept)
        if first < place < last and not is_known:
            extend_validity(place, curve, kept)
        update_extremes(codes, curve, sharper, kept)
        if low > high:
            continue
        if low < place and place - 1 - REACH >= first:
            update_outside(place - 1, place - 1 - REACH, curve, sharper)
        if high > place and place + 1 + REACH <= last:
            update_outside(place + 1, place + 1 + REACH, curve, sharper)
        move_validity(place, first, last, curve, sharper, kept)
        move_centre(codes, frame[row], place, curve, image[row], sharper)


@kernel
def _make_room(place: int, first: int, last: int, curves: CurveArrays) -> None:
    """`Curves.make_room`: the codes move with their places, and one of them leaves the ring."""
    height, _, width = curves.slots.shape
    old = np.empty(SLOTS, np.uint16)
    for row in range(height):
        slots, centre, valid_from, valid_to, _, _, outside = row_of(curves, row)
        for x in range(width):
            before = centre[x]
            if before + REACH < place:
                continue
            after = before + 1 if before >= place else before
            for slot in range(SLOTS):
                old[slot] = slots[slot, x]
            for now in range(after - REACH, after + REACH + 1):
                if now == place:
                    slots[now % SLOTS, x] = 0
                else:
                    slots[now % SLOTS, x] = old[(now if now < place else now - 1) % SLOTS]
            leaving = before - REACH if before >= place else before + REACH
            is_there = max(first, valid_from[x]) <= leaving <= min(last, valid_to[x])
            if is_there and (leaving < place) == (before >= place):
                outside[x] = max(outside[x], old[leaving % SLOTS])
            centre[x] = after
            if valid_from[x] >= place:
                valid_from[x] += 1
            if place <= valid_to[x] < TO_HIGHEST:
                valid_to[x] += 1
