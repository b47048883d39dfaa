"""What a measured depth map is worth against the truth: good, ambiguous or bad, and why.

An outlier is defined by physics: its depth is off by more than a bound. Between the bound of the good and
that of the bad a point is ambiguous, and belongs in no score.
"""

from dataclasses import dataclass
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.cloud import Mask
from socialcircle_ros.errors import CloudError, SettingError

from .camera import Camera
from .surfaces import Grid, HeightMap


class Cause(IntFlag):
    """Why a point may be bad; a point can have several, the first of these is its main one."""

    NONE = 0
    GLINT = 1
    SATURATED = 2
    DARK = 4
    STEEP = 8
    LOW_CONTRAST = 16


@dataclass(frozen=True)
class PixelVerdict:
    """A measured depth map, judged; each mask (H, W) bool, exactly one of the four True at each point.

    Attributes:
        good: off by at most the good bound.
        ambiguous: between.
        bad: off by more than the bad bound, with regard to what the optics resolve.
        missing: not measured.
        error: (H, W) float64, measured less true depth, µm; NaN where missing.
    """

    good: Mask
    ambiguous: Mask
    bad: Mask
    missing: Mask
    error: HeightMap


@dataclass(frozen=True)
class DepthTruth:
    """The true depth of every pixel, and the trouble that lies in wait there.

    Attributes:
        depth: (H, W) float64, µm.
        cause: (H, W) uint8, flags of `Cause`, from the optics and the specimen, whether it did harm or not.
        good_bound: µm.
        bad_bound: µm.
    """

    depth: HeightMap
    cause: NDArray[np.uint8]
    good_bound: float
    bad_bound: float

    def __post_init__(self) -> None:
        """Check the bounds.

        Raises:
            SettingError: they are not 0 < good ≤ bad.
        """
        if not 0 < self.good_bound <= self.bad_bound:
            raise SettingError(
                f'Bounds of {self.good_bound} µm for good and {self.bad_bound} µm for bad are not possible;'
                ' give 0 < good ≤ bad.'
            )

    @property
    def main_cause(self) -> NDArray[np.uint8]:
        """(H, W) uint8, one member of `Cause` for each point: the lowest of its flags."""
        lowest: NDArray[np.uint8] = self.cause & (~self.cause + np.uint8(1))
        return lowest

    def classify(self, depth: NDArray[np.floating]) -> PixelVerdict:
        """Judge a measured depth map.

        A depth that lies between the true ones of the neighbours is no outlier, however steep the wall:
        badness is the distance to the range of the true depth over 3×3 points.

        Args:
            depth: (H, W), µm, NaN where not measured.

        Raises:
            CloudError: another size than the truth.
        """
        if depth.shape != self.depth.shape:
            raise CloudError(
                f'The depth map is {depth.shape}, the truth {self.depth.shape}; they must be of one size.'
            )
        missing = ~np.isfinite(depth)
        error = np.where(missing, np.nan, depth - self.depth)
        low, high = -_highest(-self.depth, 1), _highest(self.depth, 1)
        off = np.maximum(low - depth, depth - high)
        bad = ~missing & (off > self.bad_bound)
        good = ~missing & (np.abs(error) <= self.good_bound)
        return PixelVerdict(good, ~(good | bad | missing), bad, missing, error)


def causes(
    surface: HeightMap,
    grid: Grid,
    sharp: NDArray[np.float32],
    glare: NDArray[np.float32],
    camera: Camera,
    reach: int = 3,
) -> NDArray[np.uint8]:
    """Where the physics asks for trouble.

    Args:
        surface: (H, W), µm.
        grid: of the surface.
        sharp: (H, W), the light with every pixel in focus, no glints.
        glare: (H, W), the most light that glints ever throw there.
        camera: whose noise and saturation count.
        reach: half side of the window in which a depth is found, points.

    Returns:
        (H, W) uint8, flags of `Cause`. Glint: they throw more than three times what the texture varies by.
        Saturated: a quarter of the window, without glints. Dark: below 0.15 of flat bright metal. Steep:
        above 35°. Low contrast: the fine texture varies by less than twice the noise.
    """
    mean = _box_mean(sharp, reach)
    detail = sharp - _box_mean(sharp, 1)  # what a Laplacian sees: shading is no texture
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


def _highest(field: NDArray[np.floating], reach: int) -> HeightMap:
    """The maximum over (2·reach + 1)² points round each, fewer at the border."""
    highest = field.astype(np.float64)
    for axis in (0, 1):
        moved = np.moveaxis(highest, axis, 0)
        result = moved.copy()
        for shift in range(1, min(reach, moved.shape[0] - 1) + 1):
            np.maximum(result[shift:], moved[:-shift], out=result[shift:])
            np.maximum(result[:-shift], moved[shift:], out=result[:-shift])
        highest = np.moveaxis(result, 0, axis)
    return highest


def _box_mean(field: NDArray[np.floating], reach: int) -> HeightMap:
    """The mean over (2·reach + 1)² points round each, fewer at the border."""
    mean = field.astype(np.float64)
    for axis in (0, 1):
        size = field.shape[axis]
        total = np.concatenate([np.zeros_like(mean.take([0], axis)), np.cumsum(mean, axis=axis)], axis=axis)
        high = np.minimum(np.arange(size) + reach + 1, size)
        low = np.maximum(np.arange(size) - reach, 0)
        count = (high - low).reshape((-1, 1) if axis == 0 else (1, -1))
        mean = (total.take(high, axis) - total.take(low, axis)) / count
    return mean
