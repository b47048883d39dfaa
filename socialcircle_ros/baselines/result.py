# SPDX-License-Identifier: Apache-2.0
"""The result of every baseline, and how a score becomes masks."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask
from socialcircle_ros.kernels.compiled import kernel

Score = npt.NDArray[np.float32] | npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FilterResult:
    """The result of a filter; a point that is not measured is False in both masks.

    Attributes:
        inliers: (H, W) bool.
        outliers: (H, W) bool.
        score: (H, W) in the cloud's data type, higher for a worse point, NaN where not measured; a point is
            an outlier where its score is above the threshold. None where the filter has no score.
        threshold: the limit on the score that was in use, None without a score.
    """

    inliers: Mask
    outliers: Mask
    score: Score | None
    threshold: float | None


def judge(score: Score, threshold: float) -> FilterResult:
    """Split the measured points by their score.

    Args:
        score: (H, W) float32 or float64, NaN where not measured.
        threshold: the highest score of an inlier.
    """
    inliers, outliers = _judge(score, threshold)
    return FilterResult(inliers, outliers, score, threshold)


@kernel
def _judge(score: Score, threshold: float) -> tuple[Mask, Mask]:
    inliers = np.empty(score.shape, np.bool_)
    outliers = np.empty(score.shape, np.bool_)
    for row in range(score.shape[0]):
        for column in range(score.shape[1]):
            # Both comparisons are False for a NaN.
            inliers[row, column] = score[row, column] <= threshold
            outliers[row, column] = score[row, column] > threshold
    return inliers, outliers
