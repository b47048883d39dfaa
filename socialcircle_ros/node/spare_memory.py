# SPDX-License-Identifier: Apache-2.0
"""Memory that clouds have left which piled up, as where the machine paused: it is given back if it stays free."""

import math

from socialcircle_ros.kernels.memory import freed_bytes, give_back_all_but

LOOKS = 10
"""What is free at so many looks is spare. A look each second sees a stream at all of its moments."""

MARGIN = 2
"""Clouds for which spare memory is kept, as many as are on the way at once: the next one waits for no memory."""

WORTH = 16 << 20
"""Less is not given back."""

SMALLEST = 1 << 20
"""Size of a cloud from which on memory is given back; smaller ones do not pile up to much."""

PLANES_HELD = 6
"""Planes of a byte per point that the exact mode and the mask need at once."""


class SpareMemory:
    """Looks at what is free, and gives back what stays free; to be asked once a second."""

    def __init__(self) -> None:
        self._looks, self._spare = 0, 0
        self._given_back = 0  # of what is free

    def use(self) -> None:
        """Begin to look anew: what is free will be used, as by a stack."""
        self._looks = 0

    def look(self, size: int, plane: int) -> None:
        """Look once.

        Args:
            size: of a cloud in bytes, above 0.
            plane: of a mask in bytes. What masks need is kept apart from what clouds need.
        """
        free = freed_bytes()
        self._spare = free if self._looks == 0 else min(self._spare, free)
        self._looks += 1
        if self._looks < LOOKS:
            return
        self._looks = 0
        if size < SMALLEST or self._spare - self._given_back <= MARGIN * size + max(size, WORTH):
            self._given_back = min(self._given_back, self._spare)  # the rest is used again
        else:
            kept = math.ceil((free - self._spare) / size) + MARGIN
            self._given_back = self._spare - MARGIN * size
            give_back_all_but([plane] * PLANES_HELD + [size] * kept)
