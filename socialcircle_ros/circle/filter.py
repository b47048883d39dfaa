"""The filter: seed, radius, expansion (section 3.2), composed."""

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from socialcircle_ros.cloud import Mask, organized
from socialcircle_ros.settings import CircleSettings

from .expansion import divide
from .radius import circle_limit
from .voting import elect_seed


@dataclass(frozen=True)
class CircleResult:
    """What the filter found; every mask is (H, W) bool.

    A point that is not measured is neither an inlier nor an outlier.
    """

    inliers: Mask
    outliers: Mask
    seed: tuple[int, int]
    """Row and column of the initial point."""
    radius: float
    """Radius in force, in the unit of the cloud."""
    times: dict[str, float]
    """Seconds that each step took: vote, radius, expansion."""


def remove_outliers(xyz: Any, settings: CircleSettings | None = None) -> CircleResult:
    """Tell the outliers of an organized cloud from its surface, by the social circle; nothing is altered.

    Args:
        xyz: (H, W, 3) float32 or float64; rows are y, columns are x. A point with a NaN or an infinite
            coordinate is not measured.
        settings: the method's parameters; the default is the paper's method.

    Returns:
        The masks, the seed and the radius.

    Raises:
        CloudError: not an organized cloud of float32 or float64.
        NoSeedError: nothing is measured in the vote region, or at all.
        NoRadiusError: nothing is measured on the ring round the seed.

    Example:
        >>> import numpy as np
        >>> from socialcircle_ros import remove_outliers
        >>> y, x = np.mgrid[:70, :80].astype(np.float32)
        >>> z = np.zeros_like(x)
        >>> z[20, 30] = 9.0
        >>> result = remove_outliers(np.dstack([x, y, z]))
        >>> np.argwhere(result.outliers).tolist()
        [[20, 30]]
    """
    settings = settings or CircleSettings()
    cloud = organized(xyz)
    started = time.perf_counter()
    seed = elect_seed(cloud, settings.vote_region)
    voted = time.perf_counter()
    limit = circle_limit(cloud, seed, settings.window, settings.radius, settings.radius_scale)
    measured_radius = time.perf_counter()
    inliers, outliers = divide(cloud, seed, limit, settings.window)
    done = time.perf_counter()
    return CircleResult(
        inliers=inliers,
        outliers=outliers,
        seed=seed,
        radius=float(np.sqrt(limit)),
        times={
            'vote': voted - started,
            'radius': measured_radius - voted,
            'expansion': done - measured_radius,
        },
    )
