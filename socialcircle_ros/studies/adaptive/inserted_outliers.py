# SPDX-License-Identifier: Apache-2.0
"""Measured surfaces with inserted outliers.

The inserted outliers are known. Points of the surface that may be wrong before the insertion are not counted.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from socialcircle_ros.baselines.median import window_median
from socialcircle_ros.baselines.result import Score
from socialcircle_ros.cloud import Cloud, Mask
from socialcircle_ros.kernels.order_statistics import MAD_TO_SIGMA
from socialcircle_ros.metrics.scores import Scores, f1_at, score
from socialcircle_ros.simulation import Contamination, add_outliers
from socialcircle_ros.simulation.outliers import Contaminated
from socialcircle_ros.studies.comparison.measured import MeasuredCloud

from .irregular_outliers import add_irregular_outliers

OutlierShapes = Literal['ellipses', 'irregular']
"""Model of the inserted outliers: clusters of 2 to 8 points radius, or irregular patches of up to 900 points."""

_NOISE_WINDOW, _SPIKE_WINDOW = 5, 11
"""Sides of the median windows: residuals to the first give the noise, residuals to the second the spikes."""
_PLAUSIBLE = 10.0
"""Largest plausible residual to the median of the spike window, in its robust σ."""
_INSERTED = Contamination(clustered=0.5, amplitude=(8.0, 40.0), radius=(2.0, 8.0), flank='mixed')
_THRESHOLDS = np.geomspace(0.3, 60, 400)


@dataclass(frozen=True, eq=False)
class StudiedSurface:
    """A measured surface before the insertion.

    Attributes:
        cloud: the measurement.
        noise: robust σ of the residuals to a 5×5 median, in the unit of the cloud.
        plausible: (H, W) bool, measured points within 10 robust σ of the 11×11 median.
        spikes: (H, W) bool, measured points that are not plausible.
    """

    cloud: MeasuredCloud
    noise: float
    plausible: Mask
    spikes: Mask


@dataclass(frozen=True, eq=False)
class ContaminatedSurface:
    """A measured surface with inserted outliers.

    Attributes:
        points: (H, W, 3).
        outlier: (H, W) bool, the inserted outliers.
        counted: (H, W) bool, points of certain truth.
        noise: of the measured surface.
        inserted: displacements and clusters.
    """

    points: Cloud
    outlier: Mask
    counted: Mask
    noise: float
    inserted: Contaminated

    def score(self, found: Mask) -> Scores:
        """Compare a mask (H, W) of found outliers with the truth."""
        return score(found, self.outlier, self.counted)

    def best_median_f1(self) -> float:
        """F1 of |z − median 11×11| with the threshold that is best for this very cloud."""
        residuals = _residuals(self.points, _SPIKE_WINDOW)
        return float(f1_at(residuals, self.outlier, self.counted, _THRESHOLDS * self.noise).max())


def measured_surface(cloud: MeasuredCloud) -> StudiedSurface:
    """Measure the noise of a surface, and find its spikes.

    Where more than half of the residuals are 0, the noise is their standard deviation instead of the robust σ.
    """
    fine, coarse = (_residuals(cloud.points, window) for window in (_NOISE_WINDOW, _SPIKE_WINDOW))
    measured = np.isfinite(coarse)
    robust = MAD_TO_SIGMA * float(np.median(fine[measured]))
    noise = robust if robust > 0 else float(fine[measured].std())
    plausible: Mask = coarse <= _PLAUSIBLE * MAD_TO_SIGMA * float(np.median(coarse[measured]))
    return StudiedSurface(cloud, noise, plausible, measured & ~plausible)


def insert_outliers(
    surface: StudiedSurface, share: float, seed: int, shapes: OutlierShapes = 'ellipses'
) -> ContaminatedSurface:
    """Insert outliers, isolated and in clusters.

    Args:
        surface: the measured surface.
        share: of its measured points that become outliers.
        seed: of the random generator.
        shapes: 'ellipses': of 8 to 40 σ, half isolated, half in clusters of 2 to 8 points radius, sharp or
            blurred; 'irregular': as `add_irregular_outliers` makes them.
    """
    points = surface.cloud.points.copy()
    heights = points[..., 2].astype(np.float64)
    heights[~(surface.plausible | surface.spikes)] = np.nan
    if shapes == 'ellipses':
        made = add_outliers(heights, replace(_INSERTED, share=share, unit=surface.noise), seed)
    else:
        made = add_irregular_outliers(heights, share, surface.noise, seed)
    points[..., 2] = made.heights
    # Spikes of the measurement may be removed or kept; they count only where an outlier was inserted on them.
    counted: Mask = (surface.plausible & ~made.ambiguous) | made.outlier
    return ContaminatedSurface(points, made.outlier, counted, surface.noise, made)


def _residuals(points: Cloud, window: int) -> Score:
    residuals: Score = np.abs(points[..., 2] - window_median(points, window))
    return residuals
