# SPDX-License-Identifier: Apache-2.0
"""What the rules found, judged by the probability of each point to be an outlier.

The rules see where a community ends, the probabilities whether it looks like an outlier or like a texture. So an
island is an outlier unless the mean of its probabilities is low. Elsewhere points of a high probability are
outliers, but not the neighbours of such an island: its border is that of the rules.
"""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask
from socialcircle_ros.kernels.compiled import kernel

from .communities import label_communities
from .heights import RelativeHeights
from .islands import Steepness

Probabilities = npt.NDArray[np.float32]
"""(H, W) float32, 0 to 1: that each point is an outlier; 0 where not measured."""
Likelihood = Callable[[RelativeHeights], Probabilities]
"""Computes the probability of each point from the heights, at least one of which is measured."""

LIKELY, LIKELY_AMONG_MANY = 0.2, 0.08
"""A community of the rules is kept if the mean of its probabilities is at most this: where outliers are `FEW`, and
where they are `MANY`. The more outliers there are, the likelier a community is one."""
FEW, MANY = 0.03, 0.13
"""Shares of the measured points, by the mean probability of all points."""
CERTAIN = 0.8
"""A point that no island touches is an outlier if its probability is above this."""


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
    of_points = probabilities.ravel()[points].astype(np.float64)
    means = np.bincount(labels, of_points, number) / np.bincount(labels, minlength=number)
    share = float(probabilities.sum(dtype=np.float64)) / np.count_nonzero(measured)
    least = float(np.interp(share, (FEW, MANY), (LIKELY, LIKELY_AMONG_MANY)))
    likely = means > least
    steepness.flat[points] = np.where(likely, np.minimum(means / CERTAIN, 1), means / least)[labels]
    islands: Mask = np.zeros(found.shape, np.bool_)
    islands.flat[points] = likely[labels]
    outliers = islands.copy()
    _add_certain(probabilities, islands, outliers, steepness)
    return outliers


@kernel
def _add_certain(probabilities: Probabilities, islands: Mask, outliers: Mask, steepness: Steepness) -> None:
    """Add the points of a high probability that no point of an island touches."""
    height, width = islands.shape
    for row in range(height):
        for column in range(width):
            if probabilities[row, column] > CERTAIN and not islands[row, column]:
                beside = False
                for y in range(max(0, row - 1), min(height, row + 2)):
                    for x in range(max(0, column - 1), min(width, column + 2)):
                        beside |= islands[y, x]
                if not beside:
                    outliers[row, column] = True
                    steepness[row, column] = probabilities[row, column]
