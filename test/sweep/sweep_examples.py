# SPDX-License-Identifier: Apache-2.0
"""Clouds with a known truth, and trials, for the tests of the sweep."""

import numpy as np
from examples import cloud, surface

from socialcircle_ros import CircleSettings, FocusSettings
from socialcircle_ros.sweep.clouds import sweep_cloud
from socialcircle_ros.sweep.trials import Trial

BASE = {**FocusSettings().to_ros(), **CircleSettings(mode='paper').to_ros()}


def truth():
    z = surface()[..., 2]
    return np.abs(z) > 20, np.isfinite(z)


def labelled(name='/points 0', **options):
    return sweep_cloud(name, cloud(**options), truth())


def scale(value):
    return {'circle.radius_scale': value}


def trial(value, score=1.0, removed=0.1, cloud_scores=()):
    return Trial(scale(value), score, 0.5, None, removed, 1.0, 2.0, 3.0, 0, list(cloud_scores))
