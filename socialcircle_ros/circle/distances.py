# SPDX-License-Identifier: Apache-2.0
"""Distances between the points of a cloud, as the radius and the expansion compare them (eq. 6).

Squared distances are compared, in the cloud's own dtype and with a fixed order of operations:
(dx·dx + dy·dy) + dz·dz. No root is rounded, so that all implementations agree on each point to the last bit.
"""

import numpy as np

from socialcircle_ros.kernels.compiled import kernel

from .arrays import Real


@kernel
def within_radius(x: Real, y: Real, z: Real, u: Real, v: Real, w: Real, limit: Real) -> np.bool_:
    """Return whether (x, y, z) and (u, v, w) are less than R apart; `limit` is R². False if one is not finite."""
    dx, dy, dz = u - x, v - y, w - z
    return (dx * dx + dy * dy) + dz * dz < limit
