# SPDX-License-Identifier: Apache-2.0
"""The whole focus curve of one pixel, for a person who asks why its depth is what it is."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.settings import FocusSettings

from .measure import Frame
from .reasons import Reason
from .stack import FocusResult, FocusStack


@dataclass(frozen=True, eq=False)
class FocusCurve:
    """The focus curve of a pixel, and what the fit made of it.

    Attributes:
        z: (n,) of the frames, ascending, in the unit of z.
        measure: (n,) F of the pixel in each frame at the scale that was chosen, divided by the light of the frame
            with `focus.normalize`.
        depth: z of the peak; NaN where there is none.
        quality: 0 to 1.
        reasons: names of the objections to the depth, in lower case.
    """

    z: NDArray[np.float64]
    measure: NDArray[np.float64]
    depth: float
    quality: float
    reasons: tuple[str, ...]


class PixelCurve(FocusStack):
    """A stack that also keeps the focus curve of one pixel.

    Args:
        settings: as of every stack.
        place: row and column of the pixel, within the frames.

    Attributes:
        curve: of the pixel, from the last call of `finish` on; None before it.
    """

    def __init__(self, settings: FocusSettings, place: tuple[int, int]) -> None:
        super().__init__(settings)
        self._place = place
        self._found: dict[int, dict[float, float]] = {}  # by the step of the scale, and z
        self.curve: FocusCurve | None = None

    def _measure(self, frame: Frame, z: float, colours: NDArray[np.uint8] | None) -> None:
        super()._measure(frame, z, colours)
        for scale in self._scales:
            measure = self._factor * scale.measure_at(frame, *self._place)
            found = self._found.setdefault(scale.step, {})
            found[z] = max(measure, found.get(z, 0.0))

    def reset(self) -> None:
        """Forget all frames."""
        super().reset()
        self._found = {}

    def finish(self, z: NDArray[np.float64] | None = None) -> FocusResult:
        """Measure the depth, as `FocusStack` does."""
        result = super().finish(z)
        found = self._found[result.step]
        given = sorted(found)
        reasons = int(result.reasons[self._place])
        self.curve = FocusCurve(
            z=np.array(given) if z is None else z,
            measure=np.array([found[each] for each in given]),
            depth=float(result.depth[self._place]),
            quality=float(result.quality[self._place]),
            reasons=tuple(reason.name.lower() for reason in Reason if reason.name and reasons & reason),
        )
        return result
