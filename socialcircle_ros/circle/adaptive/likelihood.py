# SPDX-License-Identifier: Apache-2.0
"""What the rules found, judged by the probability of each point to be an outlier.

The rules see where a community ends, the probabilities whether it looks like an outlier or like a texture. So an
island is an outlier unless the mean of its probabilities is low. Elsewhere regions of high probability are
outliers, but not one that is an island in the main: its border is that of the rules.
"""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask

from .communities import label_communities
from .heights import RelativeHeights
from .islands import Steepness

Probabilities = npt.NDArray[np.uint8]
"""(H, W) uint8, in 255ths: the probability of each point to be an outlier; 0 where not measured."""
Likelihood = Callable[[RelativeHeights], Probabilities]
"""Computes the probability of each point from the heights, at least one of which is measured."""

ONE = 255
"""What a probability of 1 is in `Probabilities`. A byte a point is enough for the thresholds below."""
LIKELY, LIKELY_AMONG_MANY = 0.2, 0.08
"""A community of the rules is kept if the mean of its probabilities is at most this: where outliers are `FEW`, and
where they are `MANY`. The more outliers there are, the likelier a community is one."""
FEW, MANY = 0.03, 0.13
"""Shares of the measured points, by the mean probability of all points."""
PROBABLE, CERTAIN = 0.6, 0.8
"""A connected region of points above the first probability is one of outliers if a point is above the second."""
COVERED = 0.3
"""It is not added if islands have this share of its points: the rules know its border better."""


def judged_by(probabilities: Probabilities, measured: Mask, found: Mask, steepness: Steepness) -> Mask:
    """Decide about the communities that the rules found, and about the other points.

    Args:
        probabilities: of the points.
        measured: (H, W) bool.
        found: (H, W) bool, what the rules found; measured points.
        steepness: (H, W) float32, from which the score is made; what the probabilities decide is written into it.

    Returns:
        (H, W) bool, the outliers.
    """
    points, labels, number = label_communities(found)
    means = (
        np.bincount(labels, probabilities.ravel()[points], number) / np.bincount(labels, minlength=number) / ONE
    )
    share = int(probabilities.sum(dtype=np.int64)) / ONE / np.count_nonzero(measured)
    least = float(np.interp(share, (FEW, MANY), (LIKELY, LIKELY_AMONG_MANY)))
    likely = means > least
    steepness.flat[points] = np.where(likely, np.minimum(means / CERTAIN, 1), means / least)[labels]
    islands: Mask = np.zeros(found.shape, np.bool_)
    islands.flat[points] = likely[labels]
    outliers = islands.copy()
    _add_regions(probabilities, islands, outliers, steepness)
    return outliers


def _add_regions(probabilities: Probabilities, islands: Mask, outliers: Mask, steepness: Steepness) -> None:
    """Add the regions of high probability that are not mostly islands."""
    points, labels, number = label_communities(probabilities > round(PROBABLE * ONE))
    sizes = np.bincount(labels, minlength=number)
    in_islands = np.bincount(labels[islands.flat[points]], minlength=number)
    certain = np.bincount(labels[probabilities.flat[points] > round(CERTAIN * ONE)], minlength=number)
    added = points[((certain > 0) & (in_islands < COVERED * sizes))[labels]]
    steepness.flat[added] = np.maximum(steepness.flat[added], probabilities.flat[added] / np.float32(ONE))
    outliers.flat[added] = True
