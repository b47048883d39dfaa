# SPDX-License-Identifier: Apache-2.0
"""The true depth of a simulated stack, and how good, ambiguous or bad a measured depth is.

An outlier is a point with a depth error above a bound. A point between the bound of good and that of bad depths is
ambiguous, and is left out of scores.
"""

from dataclasses import dataclass
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.cloud import Mask
from socialcircle_ros.errors import CloudError, SettingError

from .camera import Camera
from .surfaces import Grid, TrueHeights


class Cause(IntFlag):
    """Why a point may be bad. A point can have several causes; its main cause is the first in this order."""

    NONE = 0
    GLINT = 1
    SATURATED = 2
    DARK = 4
    STEEP = 8
    LOW_CONTRAST = 16


@dataclass(frozen=True, eq=False)
class PixelVerdict:
    """The verdict on each pixel of a measured depth map: exactly one of the four masks (H, W) is True.

    Attributes:
        good: the error is at most the good bound.
        ambiguous: neither good nor bad.
        bad: the error is above the bad bound, see `DepthTruth.classify`.
        missing: not measured.
        error: (H, W) float64, measured minus true depth, µm; NaN where missing.
    """

    good: Mask
    ambiguous: Mask
    bad: Mask
    missing: Mask
    error: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DepthTruth:
    """The true depth of each pixel, and why its measurement may fail.

    Attributes:
        depth: (H, W) float64, µm.
        cause: (H, W) uint8, flags of `Cause`: why the measurement may fail, whether it does or not.
        good_bound: largest error of a good depth, µm.
        bad_bound: error above which a depth is bad, µm.
    """

    depth: TrueHeights
    cause: NDArray[np.uint8]
    good_bound: float
    bad_bound: float

    def __post_init__(self) -> None:
        """Check the bounds.

        Raises:
            SettingError: 0 < good ≤ bad does not hold.
        """
        if not 0 < self.good_bound <= self.bad_bound:
            raise SettingError(
                f'The bounds are {self.good_bound} µm for good and {self.bad_bound} µm for bad depths;'
                ' give 0 < good ≤ bad.'
            )

    @property
    def main_cause(self) -> NDArray[np.uint8]:
        """(H, W) uint8, one member of `Cause` for each point: the lowest of its flags."""
        lowest: NDArray[np.uint8] = self.cause & (~self.cause + np.uint8(1))
        return lowest

    def classify(self, depth: NDArray[np.floating]) -> PixelVerdict:
        """Compare a measured depth map with the truth.

        A depth between the true depths of the neighbours is not an outlier, however steep the wall. A depth is
        therefore bad by its distance from the range of the true depths over 3×3 points.

        Args:
            depth: (H, W), µm, NaN where not measured.

        Raises:
            CloudError: the depth map has another size than the truth.
        """
        if depth.shape != self.depth.shape:
            raise CloudError(
                f'The depth map is {depth.shape}, the truth {self.depth.shape}; they must have the same shape.'
            )
        missing = ~np.isfinite(depth)
        error = np.where(missing, np.nan, depth - self.depth)
        low, high = -_highest(-self.depth, 1), _highest(self.depth, 1)
        off = np.maximum(low - depth, depth - high)
        bad = ~missing & (off > self.bad_bound)
        good = ~missing & (np.abs(error) <= self.good_bound)
        return PixelVerdict(good, ~(good | bad | missing), bad, missing, error)


def causes(
    surface: TrueHeights,
    grid: Grid,
    sharp: NDArray[np.float32],
    glare: NDArray[np.float32],
    camera: Camera,
    reach: int = 3,
) -> NDArray[np.uint8]:
    """Find the pixels where the depth measurement may fail, from the window of the focus measure.

    | cause        | condition                                                                      |
    |--------------|--------------------------------------------------------------------------------|
    | glint        | light of a glint above 0.02 and above three standard deviations of the texture |
    | saturated    | more than a quarter of the pixels saturated, without glints                    |
    | dark         | mean light below 0.15 of flat bright metal                                     |
    | steep        | a slope above 35°                                                              |
    | low contrast | standard deviation of the fine texture below twice the noise                   |

    Args:
        surface: (H, W), µm.
        grid: of the surface.
        sharp: (H, W), the light with every pixel in focus, without glints.
        glare: (H, W), the most light of glints over all positions of the stage.
        camera: for noise and saturation.
        reach: half-window of the focus measure, points.

    Returns:
        (H, W) uint8, flags of `Cause`.
    """
    mean = _box_mean(sharp, reach)
    detail = sharp - _box_mean(sharp, 1)  # as a Laplacian measures it: shading is not texture
    texture = np.sqrt(_box_mean(detail**2, reach))
    slope = np.zeros(grid.shape)
    for axis, step in enumerate((grid.dy, grid.dx)):
        if grid.shape[axis] > 1:
            slope += np.gradient(surface, step, axis=axis) ** 2
    found = {
        Cause.GLINT: _highest(glare, reach) > np.maximum(3 * texture, 0.02),
        Cause.SATURATED: _box_mean((sharp >= camera.saturation).astype(np.float64), reach) > 0.25,
        Cause.DARK: mean < 0.15,
        Cause.STEEP: _highest(slope, reach) > np.tan(np.deg2rad(35)) ** 2,
        Cause.LOW_CONTRAST: texture < 2 * camera.noise(mean.astype(np.float32)),
    }
    flags = np.zeros(grid.shape, dtype=np.uint8)
    for cause, where in found.items():
        flags[where] |= np.uint8(cause)
    return flags


def _highest(field: NDArray[np.floating], reach: int) -> NDArray[np.float64]:
    """The maximum over the (2·reach + 1)² points around each point, fewer at the border."""
    highest = field.astype(np.float64)
    for axis in (0, 1):
        moved = np.moveaxis(highest, axis, 0)
        result = moved.copy()
        for shift in range(1, min(reach, moved.shape[0] - 1) + 1):
            np.maximum(result[shift:], moved[:-shift], out=result[shift:])
            np.maximum(result[:-shift], moved[shift:], out=result[:-shift])
        highest = np.moveaxis(result, 0, axis)
    return highest


def _box_mean(field: NDArray[np.floating], reach: int) -> NDArray[np.float64]:
    """The mean over the (2·reach + 1)² points around each point, fewer at the border."""
    mean = field.astype(np.float64)
    for axis in (0, 1):
        size = field.shape[axis]
        total = np.concatenate([np.zeros_like(mean.take([0], axis)), np.cumsum(mean, axis=axis)], axis=axis)
        high = np.minimum(np.arange(size) + reach + 1, size)
        low = np.maximum(np.arange(size) - reach, 0)
        count = (high - low).reshape((-1, 1) if axis == 0 else (1, -1))
        mean = (total.take(high, axis) - total.take(low, axis)) / count
    return mean
