"""Jumps: differences of neighbours in the surface's own spread."""

import numpy as np
import pytest

from socialcircle_ros.circle.adaptive.jumps import NONE, jumps_of, scale_of


@pytest.mark.parametrize('level', [0.0, 3.0, -1e-30])
def test_neighbours_on_a_plane_are_0_apart_and_what_is_off_it_is_far(level):
    heights = np.full((20, 24), level, np.float32)
    heights[9, 11] += 5

    jumps = jumps_of(heights, scale_of(heights, 16, may_foretell=True))

    assert (jumps[:, 9, 11] == -127).all()
    assert (jumps[0, :9, :-1] == 0).all()
    assert (jumps[0, :, -1] == NONE).all()
