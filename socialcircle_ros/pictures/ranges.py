# SPDX-License-Identifier: Apache-2.0
"""Which heights and differences the first and the last colour of a picture stand for."""

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import HeightMap, Mask

_OF_HEIGHTS = (0.5, 99.5)  # percentiles
_OF_DEVIATIONS = 95.0  # percentile: a few outliers far off must not take the colours of all others


def height_range(heights: HeightMap, outliers: Mask, otherwise: float) -> tuple[float, float]:
    """The kept heights without their outer 1 %; all measured ones where the kept ones are all alike.

    Args:
        heights: (H, W), NaN where not measured.
        outliers: (H, W) the removed points.
        otherwise: a length that suits the cloud, such as its pitch, for a plane at 0.

    Returns:
        The lowest and the highest height; they differ.
    """
    measured = np.isfinite(heights)
    for chosen in (measured & ~outliers, measured):
        if chosen.any():
            # In double precision, because differences of heights near the limits of float32 overflow.
            low, high = np.percentile(heights[chosen].astype(np.float64), _OF_HEIGHTS)
            if high > low:
                return float(low), float(high)
    if not measured.any():
        return 0.0, 1.0
    # One height alone has no span, and its unit may be m as well as nm: only its size says what a little is.
    height = float(heights[measured][0])
    half = abs(height) / 2 or otherwise / 2
    return height - half, height + half


def deviation_range(deviations: npt.NDArray[np.float64], otherwise: float) -> tuple[float, float]:
    """As far below the surface as above it, so that most outliers have a colour of their own.

    Args:
        deviations: (H, W) height of each outlier over the surface round it; NaN elsewhere.
        otherwise: the size of the range where no outlier is off the surface.
    """
    sizes = np.abs(deviations[np.isfinite(deviations)])
    end = float(np.percentile(sizes, _OF_DEVIATIONS)) if sizes.size else 0.0
    end = end or float(sizes.max(initial=0.0)) or otherwise / 2
    return -end, end
