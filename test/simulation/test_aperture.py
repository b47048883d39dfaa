# SPDX-License-Identifier: Apache-2.0
"""Walls block a part of the light cone."""

import numpy as np
import pytest

from socialcircle_ros.simulation.aperture import aperture_openness
from socialcircle_ros.simulation.optics import INSTRUMENTS
from socialcircle_ros.simulation.surfaces import Grid, steps

OPTICS = INSTRUMENTS['10x']


@pytest.mark.parametrize('distance', [2.0, 5.0, 9.0])
def test_wall_blocks_a_segment_of_the_light_cone(distance):
    surface = steps(Grid(81, 120), [40.0, 0.0])
    radius = 40 * OPTICS.cone
    share = aperture_openness(surface, OPTICS)[40, 60 + int(distance) - 1]
    t = (distance - 0.5) / radius
    blocked = (np.arccos(t) - t * np.sqrt(1 - t**2)) / np.pi
    assert share == pytest.approx(1 - blocked, abs=0.06)
    assert aperture_openness(surface, OPTICS)[40, 30] == 1.0
