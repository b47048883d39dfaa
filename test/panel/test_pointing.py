# SPDX-License-Identifier: Apache-2.0
"""From the screen to the cloud."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from panel.test_view import masked, view

from socialcircle_ros.panel.pointing import on_ground, ray, region_between
from socialcircle_ros.settings.groups import VOTERS

DOWN = (0.0, 1.0, 0.0, 0.0)  # half a turn round x: looks down, x to the right, y up


def flat(rows, columns):
    y, x = np.mgrid[:rows, :columns].astype(np.float64)
    xyz = np.dstack([x, 2 * y, np.zeros_like(x)])
    return view(xyz, masked(xyz))


def test_from_above_the_middle_of_the_screen_is_below_the_camera_and_its_right_is_right():
    camera = np.array([1.0, 2.0, 10.0])
    assert on_ground(camera, ray((0.5, 0.5), DOWN, 0.8, 1.5)) == pytest.approx((1.0, 2.0))
    right, up = on_ground(camera, ray((1.0, 0.0), DOWN, 0.8, 1.5))
    assert (right - 1, up - 2) == pytest.approx((10 * np.tan(0.4) * 1.5, 10 * np.tan(0.4)))
    assert on_ground(camera, np.array([0.0, 0.0, 1.0])) is None


@given(rows=st.integers(2, 40), columns=st.integers(2, 40), data=st.data())
def test_a_region_between_two_points_holds_both_and_nothing_beyond(rows, columns, data):
    seen = flat(rows, columns)
    one, other = ((data.draw(st.integers(0, rows - 1)), data.draw(st.integers(0, columns - 1))) for _ in range(2))
    corners = [seen.position(*place, 0.0, 1.0)[:2] for place in (one, other)]
    row, column, height, width = region_between(seen, *corners)
    assert (row, column) == (min(one[0], other[0]), min(one[1], other[1]))
    assert (height, width) == (abs(one[0] - other[0]) + 1, abs(one[1] - other[1]) + 1)


def test_a_region_outside_is_cut_to_the_cloud_and_one_with_too_many_voters_is_reduced():
    row, column, height, width = region_between(flat(300, 400), (-100, -100), (100, 100), VOTERS)
    assert height * width <= VOTERS
    assert row >= 0
    assert row + height <= 300
    assert column + width <= 400
    assert (row + height / 2, column + width / 2) == pytest.approx((150, 200), abs=1)
    assert region_between(flat(300, 400), (-100, -100), (100, 100)) == [0, 0, 300, 400]
