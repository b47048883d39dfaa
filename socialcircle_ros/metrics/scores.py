# SPDX-License-Identifier: Apache-2.0
"""How well a mask of outliers agrees with the truth, and how well a surface does."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import HeightMap, Mask

PointScores = npt.NDArray[np.float32 | np.float64]
"""A score for each point, (H, W); higher where a point is more likely an outlier."""


@dataclass(frozen=True)
class Scores:
    """Scores of a binary classification, between 0 and 1; NaN where the denominator is 0."""

    precision: float
    """Share of the points called outliers that are outliers."""
    recall: float
    """Share of the outliers that were called outliers."""
    f1: float
    """Harmonic mean of precision and recall."""
    false_positive_rate: float
    """Share of the good points that were called outliers."""


@dataclass(frozen=True)
class Tally:
    """Counts of points; the counts of several clouds can be added."""

    true_positives: int = 0
    """Outliers that were called outliers."""
    found: int = 0
    """Points that were called outliers."""
    outliers: int = 0
    """Outliers, found or not."""
    counted: int = 0
    """Points with a certain truth."""

    def __add__(self, other: 'Tally') -> 'Tally':
        return Tally(
            self.true_positives + other.true_positives,
            self.found + other.found,
            self.outliers + other.outliers,
            self.counted + other.counted,
        )

    @property
    def scores(self) -> Scores:
        """The scores that follow from the counts."""
        return Scores(
            precision=_share(self.true_positives, self.found),
            recall=_share(self.true_positives, self.outliers),
            f1=_share(2 * self.true_positives, self.found + self.outliers),
            false_positive_rate=_share(self.found - self.true_positives, self.counted - self.outliers),
        )


def tally(found: Mask, truth: Mask, counted: Mask) -> Tally:
    """Count how a mask agrees with the truth.

    Args:
        found: (H, W) points that the filter called outliers.
        truth: (H, W) outliers.
        counted: (H, W) points with a certain truth; other points are ignored.
    """
    masks = (found & truth & counted, found & counted, truth & counted, counted)
    return Tally(*(int(np.count_nonzero(mask)) for mask in masks))


def score(found: Mask, truth: Mask, counted: Mask) -> Scores:
    """Score the mask of one cloud against the truth.

    Args:
        found: (H, W) points that the filter called outliers.
        truth: (H, W) outliers.
        counted: (H, W) points with a certain truth; other points are ignored.

    Example:
        >>> found, truth = np.array([[True, True, False]]), np.array([[True, False, False]])
        >>> score(found, truth, np.ones_like(truth)).precision
        0.5
    """
    return tally(found, truth, counted).scores


def roc_area(values: PointScores, truth: Mask, counted: Mask) -> float:
    """Compute the area under the receiver operating characteristic.

    The area is the share of all pairs of an outlier and a good point in which the outlier has the higher value.
    A pair with equal values counts as half. 1 is a perfect ranking, 0.5 is chance.

    Args:
        values: (H, W) higher for a point that is more likely an outlier; no NaN where `counted`.
        truth: (H, W) outliers.
        counted: (H, W) points with a certain truth.

    Returns:
        The area; NaN without an outlier or without a good point.
    """
    good = np.sort(values[counted & ~truth])
    bad = values[counted & truth]
    if len(good) == 0 or len(bad) == 0:
        return float('nan')
    doubled_ranks = np.searchsorted(good, bad, 'left').sum() + np.searchsorted(good, bad, 'right').sum()
    return float(doubled_ranks) / (2 * len(good) * len(bad))


def f1_at(
    values: PointScores, truth: Mask, counted: Mask, thresholds: npt.NDArray[np.number]
) -> npt.NDArray[np.float64]:
    """Compute F1 for many thresholds at once; a point above the threshold is called an outlier.

    Args:
        values: (H, W) higher for a point that is more likely an outlier; no NaN where `counted`.
        truth: (H, W) outliers; at least one of them must be `counted`.
        counted: (H, W) points with a certain truth.
        thresholds: (T,) in any order.

    Returns:
        (T,) F1 at each threshold.
    """
    bad = np.sort(values[counted & truth])
    good = np.sort(values[counted & ~truth])
    true_positives = len(bad) - np.searchsorted(bad, thresholds, 'right')
    false_positives = len(good) - np.searchsorted(good, thresholds, 'right')
    f1: npt.NDArray[np.float64] = 2 * true_positives / (true_positives + false_positives + len(bad))
    return f1


def recall_by(found: Mask, truth: Mask, counted: Mask, groups: Mapping[str, Mask]) -> dict[str, float]:
    """Compute the recall in each group of points, such as the outliers of one cause.

    Args:
        found: (H, W) points that the filter called outliers.
        truth: (H, W) outliers.
        counted: (H, W) points with a certain truth.
        groups: (H, W) points of each group, by name.

    Returns:
        The recall by name; NaN for a group without an outlier.
    """
    return {name: score(found, truth, counted & group).recall for name, group in groups.items()}


def cluster_sizes(cluster: npt.NDArray[np.int32], outlier: Mask) -> npt.NDArray[np.int64]:
    """Count the outliers in the cluster of each outlier.

    Args:
        cluster: (H, W) number of the cluster, from 1; 0 not displaced, -1 isolated.
        outlier: (H, W) outliers.

    Returns:
        (H, W) size of the cluster; 1 for an isolated outlier, 0 where there is no outlier.
    """
    numbers = np.where(outlier, cluster, 0)
    sizes = np.bincount(np.maximum(numbers, 0).ravel())
    result: npt.NDArray[np.int64] = np.where(numbers > 0, sizes[np.maximum(numbers, 0)], np.abs(numbers))
    return result


def rmse(heights: HeightMap, true: HeightMap) -> float:
    """Compute the root mean square difference of two height maps.

    Args:
        heights: (H, W) measured heights.
        true: (H, W) true heights.

    Returns:
        The difference over the points where both are finite, in the unit of the heights; NaN if there are none.
    """
    error = np.subtract(heights, true, dtype=np.float64)
    error = error[np.isfinite(error)]
    return float(np.sqrt(np.mean(error**2))) if error.size else float('nan')


def _share(part: int, whole: int) -> float:
    return part / whole if whole else float('nan')
