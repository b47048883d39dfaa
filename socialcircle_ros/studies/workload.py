# SPDX-License-Identifier: Apache-2.0
"""How long the parts of the experiments take, relative to each other, and how fast this machine is.

The constants are seconds of processor time, measured once on one machine, for a million points. A small search at
the start of an experiment measures how this machine compares, which gives the estimate before the first step.
"""

import time

from .comparison.labelled_clouds import synthetic_cloud
from .comparison.methods import SETTINGS_TYPES
from .comparison.search import best_settings

SYNTHETIC, SCAN = 0.3, 4.5
"""A synthetic cloud, and a cloud from a rendered focus stack."""
SEARCH, METHODS = 10.4, 1.5
"""The search for the best settings of all filters, and all filters once at default and at best settings."""
PEERS = 15.0
"""The filters of PCL and Open3D."""
REPAIRS = 0.5
"""Both repairs of a filtered cloud."""
ELECTION = 0.13
"""The choice of a vote region, and the election of a seed."""
DETECTION, INSERTION, TUNED_MEDIAN = 0.4, 0.5, 0.25
"""The adaptive mode; outliers that are put in; the median residual with its best threshold."""
NETWORK = 0.4
"""The adaptive mode by the network."""
DRAWING = 1.2
"""A picture of maps; this one does not depend on the points."""

_PILOT_SIZES = ((60, 80), (160, 200))


def million_points(shape: tuple[int, ...]) -> float:
    """Number of points of a cloud (H, W, ...), in millions."""
    return shape[0] * shape[1] / 1e6


def seconds_per_work() -> float:
    """Measure how many seconds a unit of work takes on this machine, by a search on a small cloud."""
    for size in _PILOT_SIZES:  # the first one loads or compiles the kernels
        cloud = synthetic_cloud('metal_groove', size, seed=1)
        began_s = time.monotonic()
        for settings_type in SETTINGS_TYPES:
            best_settings(settings_type, [cloud])
        took_s = time.monotonic() - began_s
    return took_s / (SEARCH * million_points(_PILOT_SIZES[-1]))
