"""Measured surfaces as surfaces of outliers: what is put in is known, what was wrong before does not count."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.baselines.median import window_median
from socialcircle_ros.cloud import Mask
from socialcircle_ros.metrics.scores import f1_at
from socialcircle_ros.simulation import Contamination, add_outliers
from socialcircle_ros.studies.comparison.measured import MeasuredCloud

_SIGMA = 1.4826
"""Standard deviations in a median absolute deviation, for a normal distribution."""
_FINE, _COARSE = 5, 11
"""Sides of the windows whose median gives the surface's own noise, and of the one that spikes stand out from."""
_PLAUSIBLE = 10.0
"""Points further from the coarse median, in its robust σ, are wrong already, or may be."""
_THRESHOLDS = np.geomspace(0.3, 60, 400)


@dataclass(frozen=True, eq=False)
class MeasuredSurface:
    """A measured surface.

    Attributes:
        cloud: it.
        unit: the surface's own noise, in its unit: the robust σ of what is left of a 5×5 median.
        plausible: (H, W) bool, measured, and within 10 robust σ of the 11×11 median.
        spikes: (H, W) bool, measured, and not plausible.
    """

    cloud: MeasuredCloud
    unit: float
    plausible: Mask
    spikes: Mask


@dataclass(frozen=True, eq=False)
class ContaminatedSurface:
    """A carrier with outliers put in.

    Attributes:
        points: (H, W, 3).
        outlier: (H, W) bool, what was put in.
        counted: (H, W) bool, the points whose truth is certain.
        unit: the carrier's.
    """

    points: npt.NDArray[Any]
    outlier: Mask
    counted: Mask
    unit: float

    def best_median(self) -> float:
        """The highest F1 that |z − median 11×11| can have, its threshold tuned on the answer."""
        residual = _residual(self.points, _COARSE)
        return float(f1_at(residual, self.outlier, self.counted, _THRESHOLDS * self.unit).max())


def measured_surface(cloud: MeasuredCloud) -> MeasuredSurface:
    """A measured surface as a carrier; one that is smooth to the last digit counts in its standard deviation."""
    fine, coarse = (_residual(cloud.points, window) for window in (_FINE, _COARSE))
    measured = np.isfinite(coarse)
    unit = _SIGMA * float(np.median(fine[measured]))
    plausible: Mask = coarse <= _PLAUSIBLE * _SIGMA * float(np.median(coarse[measured]))
    return MeasuredSurface(
        cloud, unit if unit > 0 else float(fine[measured].std()), plausible, measured & ~plausible
    )


def insert_outliers(bare: MeasuredSurface, share: float, seed: int) -> ContaminatedSurface:
    """Put in outliers of 8 to 40 σ: half alone, half in clusters of 2 to 8 points radius, sharp or blurred.

    Args:
        bare: the surface.
        share: of its measured points that become outliers.
        seed: of everything random.
    """
    points = bare.cloud.points.copy()
    heights = points[..., 2].astype(np.float64)
    heights[~(bare.plausible | bare.spikes)] = np.nan
    made = add_outliers(heights, replace(_KIND, share=share, unit=bare.unit), seed)
    points[..., 2] = made.heights
    # What was wrong before can be removed or kept, unless an outlier was put on it.
    counted: Mask = (bare.plausible & ~made.ambiguous) | made.outlier
    return ContaminatedSurface(points, made.outlier, counted, bare.unit)


_KIND = Contamination(clustered=0.5, amplitude=(8.0, 40.0), radius=(2.0, 8.0), flank='mixed')


def _residual(points: npt.NDArray[Any], window: int) -> npt.NDArray[Any]:
    residual: npt.NDArray[Any] = np.abs(points[..., 2] - window_median(points, window))
    return residual
