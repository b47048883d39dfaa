"""How well a mask of outliers agrees with the truth, and how well a surface does."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask


@dataclass(frozen=True)
class Scores:
    """Shares between 0 and 1; NaN where there is nothing to divide by."""

    precision: float
    """Of the points called outliers, how many are."""
    recall: float
    """Of the outliers, how many were called so."""
    f1: float
    """The harmonic mean of precision and recall."""
    false_positive_rate: float
    """Of the good points, how many were called outliers."""


@dataclass(frozen=True)
class Tally:
    """Counts of points; those of several clouds add up to those of all."""

    right: int = 0
    """Outliers that were called so."""
    called: int = 0
    """Points that were called outliers."""
    there: int = 0
    """Outliers."""
    counted: int = 0
    """Points whose truth is certain."""

    def __add__(self, other: 'Tally') -> 'Tally':
        return Tally(
            self.right + other.right,
            self.called + other.called,
            self.there + other.there,
            self.counted + other.counted,
        )

    @property
    def scores(self) -> Scores:
        """What the counts say."""
        return Scores(
            precision=_share(self.right, self.called),
            recall=_share(self.right, self.there),
            f1=_share(2 * self.right, self.called + self.there),
            false_positive_rate=_share(self.called - self.right, self.counted - self.there),
        )


def tally(found: Mask, truth: Mask, counted: Mask) -> Tally:
    """Count what a mask has in common with the truth.

    Args:
        found: (H, W) what the filter called outliers.
        truth: (H, W) the outliers.
        counted: (H, W) the points whose truth is certain; the others do not count.
    """
    masks = (found & truth & counted, found & counted, truth & counted, counted)
    return Tally(*(int(np.count_nonzero(mask)) for mask in masks))


def score(found: Mask, truth: Mask, counted: Mask) -> Scores:
    """Compare a mask with the truth; as `tally`, for one cloud."""
    return tally(found, truth, counted).scores


def roc_area(values: npt.NDArray[Any], truth: Mask, counted: Mask) -> float:
    """Area under the receiver operating characteristic: 1 for a perfect order of the points, 0.5 for chance.

    It is the share of all pairs of an outlier and a good point in which the outlier has the higher value; equal
    values are half a pair.

    Args:
        values: (H, W) higher for a worse point; no NaN where `counted`.
        truth: (H, W) the outliers.
        counted: (H, W) the points whose truth is certain.

    Returns:
        NaN without an outlier or without a good point.
    """
    good = np.sort(values[counted & ~truth])
    bad = values[counted & truth]
    if len(good) == 0 or len(bad) == 0:
        return float('nan')
    won = np.searchsorted(good, bad, 'left').sum() + np.searchsorted(good, bad, 'right').sum()
    return float(won) / (2 * len(good) * len(bad))


def f1_at(values: npt.NDArray[Any], truth: Mask, counted: Mask, thresholds: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """F1 of calling a point an outlier where its value is above a threshold, for many thresholds at once.

    Args:
        values: (H, W) higher for a worse point; no NaN where `counted`.
        truth: (H, W) the outliers, at least one of which counts.
        counted: (H, W) the points whose truth is certain.
        thresholds: (T,) in any order.

    Returns:
        (T,) float64.
    """
    bad = np.sort(values[counted & truth])
    good = np.sort(values[counted & ~truth])
    right = len(bad) - np.searchsorted(bad, thresholds, 'right')
    wrong = len(good) - np.searchsorted(good, thresholds, 'right')
    f1: npt.NDArray[np.float64] = 2 * right / (right + wrong + len(bad))
    return f1


def recall_by(found: Mask, truth: Mask, counted: Mask, groups: Mapping[str, Mask]) -> dict[str, float]:
    """Recall within each group of points, such as those of one cause; NaN for a group without an outlier."""
    return {name: score(found, truth, counted & group).recall for name, group in groups.items()}


def cluster_sizes(cluster: npt.NDArray[np.int32], outlier: Mask) -> npt.NDArray[np.int64]:
    """How many outliers the cluster of each outlier has.

    Args:
        cluster: (H, W) 0 not moved, -1 isolated, from 1 the number of the cluster.
        outlier: (H, W) the outliers.

    Returns:
        (H, W) int64: 0 where no outlier is, 1 where it is isolated.
    """
    numbers = np.where(outlier, cluster, 0)
    sizes = np.bincount(np.maximum(numbers, 0).ravel())
    result: npt.NDArray[np.int64] = np.where(numbers > 0, sizes[np.maximum(numbers, 0)], np.abs(numbers))
    return result


def rmse(heights: npt.NDArray[Any], true: npt.NDArray[Any]) -> float:
    """Root mean square difference in the unit of the heights, where both are finite; NaN if nowhere."""
    error = np.subtract(heights, true, dtype=np.float64)
    error = error[np.isfinite(error)]
    return float(np.sqrt(np.mean(error**2))) if error.size else float('nan')


def _share(part: int, whole: int) -> float:
    return part / whole if whole else float('nan')
