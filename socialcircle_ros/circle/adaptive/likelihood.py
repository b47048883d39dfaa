# SPDX-License-Identifier: Apache-2.0
"""Outliers by the probability of each point to be one, which a network gives.

Probable points that touch, directly or through others, form a community. It is one of outliers if the probability
of one of its points is high.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask
from socialcircle_ros.kernels.compiled import kernel

from .communities import Labelled, label_communities
from .heights import RelativeHeights

Probabilities = npt.NDArray[np.uint8]
"""(H, W) uint8, in 255ths: the probability of each point to be an outlier; 0 where not measured."""
Likelihood = Callable[[RelativeHeights], Probabilities]
"""Computes the probability of each point from the heights, at least one of which is measured; the result may be
changed."""

ONE = 255
"""What a probability of 1 is in `Probabilities`. A byte a point is enough for the thresholds below."""
PROBABLE, PROBABLE_AMONG_MANY = 0.5, 0.2
"""Points above this probability form communities: where outliers are `FEW`, and where they are `MANY`. The more
outliers there are, the likelier a point is one."""
CERTAIN, CERTAIN_AMONG_MANY = 0.8, 0.5
"""A community is one of outliers if one of its points is above this probability, `FEW` and `MANY` as before."""
FEW, MANY = 0.1, 0.2
"""Shares of the measured points, by the mean probability of all points."""
UNDECIDED = 0.2
"""A point between this probability and `CERTAIN` may be an outlier or not. A lesson decides about all above it."""
MANY_UNDECIDED = 0.005
"""A larger share of undecided points is many."""
SET = 6
"""Least points of a connected set above `UNDECIDED` that is no single outlier with the points beside it."""


class Sureness(NamedTuple):
    """How sure the probabilities are.

    Attributes:
        undecided: share of the measured points with a probability above `UNDECIDED` and not above `CERTAIN`.
        certain: share of the measured points with a probability above `CERTAIN`.
    """

    undecided: float
    certain: float


@dataclass(frozen=True, eq=False)
class Decided:
    """What the probabilities decide.

    Attributes:
        outliers: (H, W) bool.
        score: (H, W) float32, as in `AdaptiveResult`.
        sureness: about all points.
        communities: of the outliers.
    """

    outliers: Mask
    score: npt.NDArray[np.float32]
    sureness: Sureness
    communities: Labelled


def probable_outliers(probabilities: Probabilities, measured: Mask) -> Decided:
    """Find the communities of outliers.

    Args:
        probabilities: of the points.
        measured: (H, W) bool, one of them at least.
    """
    known = int(np.count_nonzero(measured))
    share = int(probabilities.sum(dtype=np.int64)) / ONE / known
    probable = float(np.interp(share, (FEW, MANY), (PROBABLE, PROBABLE_AMONG_MANY)))
    certain = float(np.interp(share, (FEW, MANY), (CERTAIN, CERTAIN_AMONG_MANY)))
    points, labels, number = label_communities(probabilities > round(probable * ONE))
    sure = np.bincount(labels[probabilities.flat[points] > round(certain * ONE)], minlength=number) > 0
    are_sure = sure[labels]
    communities = Labelled(points[are_sure], labels[are_sure], number)
    outliers: Mask = np.zeros(probabilities.shape, np.bool_)
    outliers.flat[communities.points] = True
    score = np.empty(probabilities.shape, np.float32)
    undecided, sure_points = _write_scores(probabilities, outliers, measured, round(certain * ONE), score)
    return Decided(outliers, score, Sureness(undecided / known, sure_points / known), communities)


def sureness_about_sets(probabilities: Probabilities, measured: Mask) -> Sureness:
    """How sure the probabilities are about points in sets, which single outliers do not raise.

    Args:
        probabilities: of the points.
        measured: (H, W) bool, one of them at least.
    """
    points, labels, number = label_communities(probabilities > round(UNDECIDED * ONE))
    in_sets = (np.bincount(labels, minlength=number) >= SET)[labels]
    certain = int(np.count_nonzero(probabilities.flat[points[in_sets]] > ONE * CERTAIN))
    known = int(np.count_nonzero(measured))
    return Sureness((int(np.count_nonzero(in_sets)) - certain) / known, certain / known)


@kernel
def _write_scores(
    probabilities: Probabilities, outliers: Mask, measured: Mask, certain: int, score: npt.NDArray[np.float32]
) -> tuple[int, int]:
    """Half of 1 + p for outliers; of others half of p over the least that is certain; NaN where not measured.

    Returns:
        The numbers of undecided and of certain points, as in `Decided`.
    """
    height, width = score.shape
    above_undecided, above_certain = 0, 0
    for row in range(height):
        for column in range(width):
            probability = np.float32(probabilities[row, column])
            if not measured[row, column]:
                score[row, column] = np.nan
            elif outliers[row, column]:
                score[row, column] = np.float32(0.5) + np.float32(0.5 / ONE) * probability
            else:
                score[row, column] = np.float32(0.5) * min(probability / np.float32(certain), np.float32(1))
            above_undecided += int(probability > ONE * UNDECIDED)
            above_certain += int(probability > ONE * CERTAIN)
    return above_undecided - above_certain, above_certain
