# SPDX-License-Identifier: Apache-2.0
"""What is kept of the focus curve of each pixel while the frames of a stack arrive, in any order.

A focus curve is F of one pixel over z. Each frame has a place, an integer that is its order in z: neighbours in
z are neighbours in place, in whichever order they arrive. Of each curve four things are kept:

- the frames that are held back, see `order`;
- the released frames within REACH places of the sharpest one (the centre), in a ring of SLOTS slots;
- the lowest value of all frames;
- the highest value of the released frames outside the ring.

F is kept as its logarithm, on which the fit works, in 16 bits.

A frame comes into the ring when it is released. While the stage moves in one direction, the centre is then
either the final one or at least as far away as a later one, so that the ring of the final centre is complete.
Slots are not cleared when the centre moves: a slot of a place that is not released yet may hold a frame of an
older centre, which counts as outside once it is displaced, or at the end.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .curve_rows import (
    CODES_PER_OCTAVE,
    NO_FRAME,
    REACH,
    SLOTS,
    CurveArrays,
    count_beyond_as_outside,
    encode,
    forget_lost,
    hold_back,
    insert_late,
    mark_sharper,
    move_centre,
    open_place,
    release,
    row_buffers,
    row_of,
    shift_centres,
    take_brighter,
    update_lowest,
)
from .measure import Frame, MeasureParameters, measure_buffers, measure_row
from .order import NOWHERE, RECENT, Arrival

_LEAST_BAND = 1_500_000
"""Pixels of a frame for each core: a smaller frame is done before another core would be of use."""


@dataclass(frozen=True, eq=False)
class Curves:
    """The focus curves of all pixels, 58 bytes each, and the all-in-focus image.

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
                recent=np.empty((height, RECENT, width), np.uint16),
                centre=np.empty((height, width), np.int16),
                peak=np.empty((height, width), np.uint16),
                lowest=np.empty((height, width), np.uint16),
                outside=np.empty((height, width), np.uint16),
            ),
            image=np.empty_like(frame),
        )

    def begin(self, frame: Frame) -> None:
        """Forget all frames, and center all pixels on place 0, the place of this first frame."""
        arrays = self.arrays
        arrays.centre[:] = 0
        arrays.peak[:] = 0
        arrays.lowest[:] = np.iinfo(np.uint16).max
        arrays.outside[:] = 0
        self.image[:] = frame

    def clear_slots(self, part: int) -> None:
        """Clear a part of the slots; the parts 0 to RECENT - 1 are all. To clear all at once would cost frames."""
        size = -(-SLOTS // RECENT)
        self.arrays.slots[:, part * size : (part + 1) * size] = NO_FRAME

    def add(self, frame: Frame, arrival: Arrival, scale: float, parameters: MeasureParameters) -> None:
        """Add a frame.

        Args:
            frame: (H, W), like the others.
            arrival: what it means for the curves.
            scale: factor of F, for frames that are not equally bright.
            parameters: of the focus measure.
        """
        offset = np.float32(CODES_PER_OCTAVE * math.log2(scale))
        near = range(
            max(arrival.released.start, arrival.place - REACH),
            min(arrival.released.stop, arrival.place + REACH + 1),
        )
        if arrival.is_late:
            first, last = arrival.released[0], arrival.released[-1]
            _add_late(
                frame, arrival.place, arrival.is_known, first, last, offset, parameters, self.arrays, self.image
            )
            return
        if arrival.shift:
            shift_centres(arrival.shift_from, arrival.shift, self.arrays.centre.reshape(-1))

        def add(rows: slice) -> None:
            _add(
                frame,
                rows.start,
                rows.stop,
                arrival.place,
                arrival.is_known,
                arrival.row,
                arrival.leaving_row,
                arrival.leaving is not None,
                arrival.leaving or 0,
                near.start,
                near.stop,
                offset,
                parameters,
                self.arrays,
                self.image,
            )

        height, width = frame.shape
        in_bands(add, height, width, least=_LEAST_BAND)

    def release_all(self, rows: Sequence[int], recent: range, places: range) -> None:
        """Release the frames that are held back, and count what is left of older centres as outside.

        Args:
            rows: where they are held back.
            recent: their places.
            places: of all frames.
        """
        _release_all(np.array(rows, np.int64), recent.start, places[0], places[-1], self.arrays)


@kernel
def _add(
    frame: Frame,
    first: int,
    end: int,
    place: int,
    is_known: bool,
    row_held: int,
    row_leaving: int,
    any_leaves: bool,
    leaving: int,
    lost_from: int,
    lost_end: int,
    offset: np.float32,
    parameters: MeasureParameters,
    curves: CurveArrays,
    image: Frame,
) -> None:
    """`Curves.add` for some rows: each is measured, encoded and added to its curves while it is in the cache."""
    width = frame.shape[1]
    buffers = measure_buffers(width, parameters.half_window)
    measure = np.empty(width, np.int32)
    rounded = np.empty(width, np.float32)
    codes, sharper, displaced = row_buffers(width)
    for row in range(first, end):
        measure_row(frame, row, first, parameters, buffers, measure)
        encode(measure, offset, rounded, rounded.view(np.int32), codes)
        curve = row_of(curves, row)
        update_lowest(codes, curve)
        if mark_sharper(codes, place, curve, sharper):
            for other in range(lost_from, lost_end):
                forget_lost(other, curve, sharper, displaced)
            move_centre(codes, frame[row], place, curve, image[row], sharper)
        if is_known:
            take_brighter(codes, frame[row], place, curve, image[row])
        if any_leaves:
            released = codes if row_leaving == NOWHERE else curve.recent[row_leaving]
            release(released, leaving, curve.centre, curve.slots[leaving % SLOTS], curve.outside, displaced)
        if row_held != NOWHERE:
            hold_back(codes, curve.recent[row_held], is_known)


@kernel
def _add_late(
    frame: Frame,
    place: int,
    is_known: bool,
    first: int,
    last: int,
    offset: np.float32,
    parameters: MeasureParameters,
    curves: CurveArrays,
    image: Frame,
) -> None:
    """`Curves.add` of a frame that comes too late to be held back; `first` to `last` were released before."""
    height, width = frame.shape
    buffers = measure_buffers(width, parameters.half_window)
    measure = np.empty(width, np.int32)
    rounded = np.empty(width, np.float32)
    codes, sharper, displaced = row_buffers(width)
    old = np.empty(SLOTS, np.uint16)
    end = last + 1 if is_known else last + 2
    for row in range(height):
        measure_row(frame, row, 0, parameters, buffers, measure)
        encode(measure, offset, rounded, rounded.view(np.int32), codes)
        curve = row_of(curves, row)
        update_lowest(codes, curve)
        if not is_known:
            open_place(place, first, last, curve, old)
        is_sharper = mark_sharper(codes, place, curve, sharper)
        if is_sharper:
            for other in range(max(first, place - REACH), min(end, place + REACH + 1)):
                if other != place:
                    forget_lost(other, curve, sharper, displaced)
        insert_late(codes, place, is_known, curve, sharper)
        if is_sharper:
            move_centre(codes, frame[row], place, curve, image[row], sharper)
        if is_known:
            take_brighter(codes, frame[row], place, curve, image[row])


@kernel
def _release_all(rows: NDArray[np.int64], recent: int, first: int, last: int, curves: CurveArrays) -> None:
    """`Curves.release_all`; `recent` is the place of the first of the rows."""
    height, _, width = curves.slots.shape
    displaced = row_buffers(width).displaced
    for row in range(height):
        curve = row_of(curves, row)
        release_recent(rows, recent, curve, curve.slots, curve.outside, displaced)
        count_beyond_as_outside(first, last, curve.centre, curve.slots, curve.outside)


@kernel
def release_recent(
    rows: NDArray[np.int64],
    recent: int,
    curve: CurveArrays,
    slots: NDArray[np.uint16],
    outside: NDArray[np.uint16],
    displaced: NDArray[np.uint16],
) -> None:
    """Release the frames of a row of pixels that are held back into these slots.

    Args:
        rows: where they are held back, in order of z.
        recent: place of the first of them.
        curve: of the row.
        slots: (SLOTS, W), updated; of the curve or a copy.
        outside: (W,), likewise.
        displaced: (W,), a work array.
    """
    for k in range(rows.size):
        slot = slots[(recent + k) % SLOTS]
        release(curve.recent[rows[k]], recent + k, curve.centre, slot, outside, displaced)
