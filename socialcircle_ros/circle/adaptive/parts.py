# SPDX-License-Identifier: Apache-2.0
"""Large islands that the network takes for parts of the surface, and the search for points far off removes.

The network sees no more than the surroundings of a patch, and the search no more than that the rest of the surface
is plain. Neither can tell a pin of a connector from a flake of dirt, so that the result names these islands.
"""

import numpy as np

from socialcircle_ros.cloud import Mask

from .communities import Labelled
from .texture import Islands, islands_among

LARGE = 64
"""Points of an island that the network may take for a part. Of 41 measured surfaces, 3 have such islands
untouched."""
_LEAST_KNOWN = 0.5
"""Share of its points from which on an island is an outlier for the network, too."""


def taken_for_parts(communities: Labelled, known: Mask) -> Islands:
    """Sum up the large communities of outliers that the network does not take for outliers.

    Args:
        communities: of the outliers.
        known: (H, W) bool, the outliers by the network alone.
    """
    points, labels, number = communities
    sizes = np.bincount(labels, minlength=number)
    known_points = np.bincount(labels[known.flat[points]], minlength=number)
    return islands_among(sizes[(sizes >= LARGE) & (known_points < _LEAST_KNOWN * sizes)])
