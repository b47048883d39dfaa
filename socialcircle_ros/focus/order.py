# SPDX-License-Identifier: Apache-2.0
"""The order of the frames of a stack in z, and what each new frame means for it.

The last frames, RECENT at most, are held back: their codes wait, in order of z, until it is known whether they are
near the sharpest frame of a pixel. A frame is then released, the one that the stage passed first. While the stage
moves in one direction, the frames next to each sharpest frame are therefore all known when it comes, whichever
direction that is. The same holds where neighbours swap, as they do where the steps are smaller than the jitter of
the stage.
"""

from bisect import bisect_left
from dataclasses import dataclass, field
from typing import NamedTuple

from .curve_rows import REACH

RECENT = REACH
"""Frames that are held back: as many as are kept on either side of the sharpest one."""

NOWHERE = -1


class Arrival(NamedTuple):
    """What a new frame means for the curves."""

    place: int
    """Of the frame: its order in z."""

    is_known: bool
    """Whether there is a frame at this z already; each pixel then keeps the larger F."""

    is_late: bool
    """Whether frames on both sides of this one are released, so that it cannot be held back."""

    row: int
    """Where the codes of the frame are held back; NOWHERE: they are not."""

    leaving_row: int = NOWHERE
    """Where the codes of the frame are that is released; NOWHERE: none is, or it is this one."""

    leaving: int | None = None
    """Place of the frame that is released; None: none is."""

    shift_from: int = 0
    """The sharpest frames with this place and beyond move by `shift`, to make room for the new frame."""

    shift: int = 0
    """1: those above `shift_from` move up; -1: those below move down; 0: none moves."""

    released: range = range(0)
    """Places of the frames that were released before this one came."""

    turns: bool = False
    """Whether all frames that are held back must be released first."""


@dataclass
class FrameOrder:
    """The frames of a stack so far, in order of z.

    Attributes:
        z: ascending, of all frames.
        first: the place of z[0].
        rows: where the codes of the frames that are held back are, in order of z.
        low: index in z of the lowest frame that is held back.
        upward: whether the lowest frame is released next; otherwise the highest one.
        complete: whether every frame came in its turn, so that no pixel can lack one.
    """

    z: list[float] = field(default_factory=list)
    first: int = 0
    rows: list[int] = field(default_factory=list)
    low: int = 0
    upward: bool = True
    complete: bool = True

    @property
    def places(self) -> range:
        """The places of all frames."""
        return range(self.first, self.first + len(self.z))

    @property
    def recent(self) -> range:
        """The places of the frames that are held back."""
        return self.places[self.low : self.low + len(self.rows)]

    @property
    def released(self) -> range:
        """The places of the frames that are released."""
        return self.places[: self.low] if self.upward else self.places[self.low + len(self.rows) :]

    def knows(self, z: float) -> bool:
        """Whether there is a frame at this z."""
        index = bisect_left(self.z, z)
        return index < len(self.z) and self.z[index] == z

    def add(self, z: float) -> Arrival:
        """Take in the z of a new frame."""
        index = bisect_left(self.z, z)
        arrival = self._meet(index) if self.knows(z) else self._insert(index, z)
        near = range(arrival.place - REACH, arrival.place + REACH + 1)
        self.complete &= not (arrival.released and _overlap(near, arrival.released))
        return arrival

    def _meet(self, index: int) -> Arrival:
        """Meet a frame at a z that is known."""
        place = self.places[index]
        held_back = place in self.recent
        row = self.rows[index - self.low] if held_back else NOWHERE
        return Arrival(place, is_known=True, is_late=not held_back, row=row, released=self.released)

    def _insert(self, index: int, z: float) -> Arrival:
        released = self.released
        is_late = bool(released) and not self.low <= index <= self.low + len(self.rows)
        turns = is_late and index == (0 if self.upward else len(self.z))
        if turns:
            self.upward = not self.upward
            self.rows, self.low = [], index
            released = self.released
        elif is_late:
            self.z.insert(index, z)
            self.low += 1 if self.upward else 0
            return Arrival(self.places[index], is_known=False, is_late=True, row=NOWHERE, released=released)
        # Only places of frames that are held back may change: the others have their codes in slots by place.
        downward = index == 0 or (bool(released) and not self.upward)
        is_between = 0 < index < len(self.z)
        shift = (-1 if downward else 1) if is_between else 0
        shift_from = self.first + index - (1 if downward else 0)
        self.first -= 1 if downward and self.z else 0
        self.z.insert(index, z)
        place = self.places[index]
        row, leaving_row, leaving = self._hold_back(index - self.low, place)
        return Arrival(
            place,
            is_known=False,
            is_late=False,
            row=row,
            leaving_row=leaving_row,
            leaving=leaving,
            shift_from=shift_from,
            shift=shift,
            released=released,
            turns=turns,
        )

    def _hold_back(self, position: int, place: int) -> tuple[int, int, int | None]:
        """Hold a frame back at a position among the others, and release one where there is no room.

        Returns:
            Where its codes are held, where those of the released frame are, and the place of that one.
        """
        if len(self.rows) < RECENT:
            row = len(self.rows)
            self.rows.insert(position, row)
            return row, NOWHERE, None
        if len(self.z) == RECENT + 1:  # none is released yet: this frame tells the direction
            self.upward = position > RECENT // 2
        leaving = self.places[self.low + (0 if self.upward else RECENT)]
        if self.upward:
            self.low += 1
            position -= 1
        if leaving == place:
            return NOWHERE, NOWHERE, leaving
        row = self.rows.pop(0 if self.upward else -1)
        self.rows.insert(position, row)
        return row, row, leaving


def _overlap(one: range, other: range) -> bool:
    return one.start < other.stop and other.start < one.stop
