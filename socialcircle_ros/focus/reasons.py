# SPDX-License-Identifier: Apache-2.0
"""Why the depth of a pixel from a focus stack is not to be trusted."""

from enum import IntFlag

import numpy as np
from numpy.typing import NDArray


class Reason(IntFlag):
    """Why a pixel is bad: the bits of `FocusResult.reasons`, 0 where there is no reason."""

    NO_PEAK = 1
    """The curve has no peak, or only one that noise makes too (quality below 0.1): the depth is NaN."""

    SCAN_END = 2
    """The sharpest frame is the first or the last in z, so that the peak may lie beyond: the depth is NaN."""

    SATURATED = 4
    """More than one pixel in eight of the window is saturated in its sharpest frame: the quality is 0."""

    TWO_PEAKS = 8
    """A frame away from the peak is at least half as sharp: another surface, or its reflection."""

    LOW_CONTRAST = 16
    """The sharpest frame is less than e^0.5 = 1.65 times as sharp as the least sharp one, or as the noise."""

    INCOMPLETE = 32
    """Frames near the sharpest one came too far out of order to be kept: the fit has fewer frames."""

    FEW_PIXELS = 64
    """A few pixels have most of the texture near: the depth is theirs, and may be that of a reflection."""

    OUT_OF_PICTURE = 128
    """The pixel, or a part of its window, leaves the picture in some registered frame: the depth is NaN."""


def count_reasons(reasons: NDArray[np.uint8]) -> dict[str, int]:
    """Count the pixels of each reason, by its name in lower case. A pixel may have several reasons.

    Args:
        reasons: (H, W), bits of `Reason`.
    """
    return {reason.name.lower(): int(np.count_nonzero(reasons & reason)) for reason in Reason if reason.name}


# Kernels know plain integers only.
NO_PEAK, SCAN_END, SATURATED = int(Reason.NO_PEAK), int(Reason.SCAN_END), int(Reason.SATURATED)
TWO_PEAKS, LOW_CONTRAST, INCOMPLETE = int(Reason.TWO_PEAKS), int(Reason.LOW_CONTRAST), int(Reason.INCOMPLETE)
FEW_PIXELS, OUT_OF_PICTURE = int(Reason.FEW_PIXELS), int(Reason.OUT_OF_PICTURE)
