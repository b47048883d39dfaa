# SPDX-License-Identifier: Apache-2.0
"""The radius filter: a point with few neighbours within a radius is an outlier."""

import numpy as np
import numpy.typing as npt

from socialcircle_ros.arguments import settings_or_default
from socialcircle_ros.cloud import Cloud, organized
from socialcircle_ros.errors import CloudError
from socialcircle_ros.kernels.compiled import kernel

from .result import FilterResult, Score, judge
from .settings import RadiusSettings
from .window import STRIP, load_strip_row

_PITCHES = 2.5  # 20 of the 24 neighbours in a 5×5 window of a flat grid lie within √5 pitches


def radius_filter(xyz: npt.ArrayLike, settings: RadiusSettings | None = None) -> FilterResult:
    """Remove the points with fewer than `min_neighbours` measured points of their window within `radius`.

    This is PCL's RadiusOutlierRemoval with a window instead of the k-d tree. A neighbour at exactly the radius
    counts; the point itself does not. Distances are squared, `(dx*dx + dy*dy) + dz*dz`, in the cloud's own data
    type.

    Args:
        xyz: (H, W, 3) float32 or float64 organized cloud; a point with a NaN or Inf is not measured.
        settings: the parameters; None: their defaults.

    Returns:
        Masks, and as the score the number of places in the window that hold no neighbour.

    Raises:
        CloudError: not an organized cloud, or no radius is given and the cloud has no two measured points side by
            side to estimate it from.
    """
    settings = settings_or_default(RadiusSettings, settings)
    cloud = organized(xyz)
    radius = cloud.dtype.type(radius_of(cloud, settings))
    with np.errstate(over='ignore'):
        limit = radius * radius
    score: Score = np.empty(cloud.shape[:2], cloud.dtype)
    _count_missing(cloud, settings.window // 2, limit, score)
    return judge(score, float(settings.window**2 - 1 - settings.min_neighbours))


def radius_of(xyz: Cloud, settings: RadiusSettings) -> float:
    """The radius in use: that of the settings, or 2.5 times the pitch.

    Raises:
        CloudError: the settings give no radius, and the pitch cannot be estimated.
    """
    return _PITCHES * _pitch(xyz) if settings.radius is None else settings.radius


def _pitch(xyz: Cloud) -> float:
    """Median distance in x and y of points side by side, from about a hundred rows and columns of the cloud."""
    row_stride, column_stride = xyz.shape[0] // 64 + 1, xyz.shape[1] // 64 + 1
    with np.errstate(invalid='ignore', over='ignore'):
        along = np.diff(xyz[::row_stride, :, :2].astype(np.float64), axis=1)
        down = np.diff(xyz[:, ::column_stride, :2].astype(np.float64), axis=0)
    steps = np.concatenate([np.hypot(s[..., 0], s[..., 1]).ravel() for s in (along, down)])
    steps = steps[np.isfinite(steps)]
    pitch = float(np.median(steps)) if len(steps) else 0.0
    if pitch == 0.0:
        raise CloudError(
            'The pitch of the cloud cannot be estimated: no two measured points lie side by side; set radius.'
        )
    return pitch


@kernel
def _count_missing(xyz: Cloud, reach: int, limit: np.float32 | np.float64, score: Score) -> None:
    """Fill `score`: window places without a point within √limit; NaN where not measured."""
    height, width = xyz.shape[:2]
    window = 2 * reach + 1
    # The rows of the window, in a ring: row r of the cloud lies in slot r % window.
    rows = np.empty((window, 3, STRIP + 2 * reach), xyz.dtype)
    one = xyz.dtype.type(1)
    for left in range(0, width, STRIP):
        count = min(STRIP, width - left)
        for row in range(-reach, reach):
            load_strip_row(xyz, row, left - reach, rows[row % window])
        for row in range(height):
            load_strip_row(xyz, row + reach, left - reach, rows[(row + reach) % window])
            here = rows[row % window, :, reach : reach + count]
            x, y, z = here[0], here[1], here[2]
            missing = score[row, left : left + count]
            for column in range(count):
                # The point itself is a place of the window, but not a neighbour of itself.
                missing[column] = x[column] * 0 + (window * window - 1)
            for near_row in range(row - reach, row + reach + 1):
                for shift in range(window):
                    if near_row == row and shift == reach:
                        continue
                    near = rows[near_row % window, :, shift : shift + count]
                    near_x, near_y, near_z = near[0], near[1], near[2]
                    for column in range(count):
                        dx, dy, dz = (
                            near_x[column] - x[column],
                            near_y[column] - y[column],
                            near_z[column] - z[column],
                        )
                        within = (dx * dx + dy * dy) + dz * dz <= limit
                        missing[column] -= one if within else 0 * one
