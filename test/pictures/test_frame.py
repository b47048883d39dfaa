# SPDX-License-Identifier: Apache-2.0
"""Where a cloud lies in its pictures."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.pictures.frame import frame_of


def grid(rows, columns, dx, dy, x=0.0, y=0.0):
    row, column = np.mgrid[:rows, :columns]
    return np.dstack([x + dx * column, y + dy * row, np.zeros((rows, columns))])


@given(
    dx=st.sampled_from([1e-6, -2.5, 40.0]),
    dy=st.sampled_from([3e-6, -1.0, 7.0]),
    x=st.sampled_from([0.0, -9.0, 1e3]),
)
def test_the_extent_has_the_points_at_the_middle_of_their_pixels(dx, dy, x):
    xyz = grid(12, 9, dx, dy, x)
    measured = np.ones((12, 9), bool)
    measured[:3], measured[:, 7:] = False, False
    found = frame_of(xyz, measured, 'mm')
    expected = x - dx / 2, x + 8.5 * dx, 11.5 * dy, -dy / 2
    assert found.extent == pytest.approx(expected, rel=1e-6, abs=1e-6 * abs(dx))
    assert found.ratio == pytest.approx(abs(9 * dx / (12 * dy)), rel=1e-5)


@given(turn=st.floats(-3.2, 3.2), dx=st.sampled_from([0.5, 2.0]), dy=st.sampled_from([0.5, 3.0]))
def test_a_cloud_turned_about_z_keeps_its_lengths(turn, dx, dy):
    straight = grid(12, 9, dx, dy, x=40.0)
    x, y, z = np.moveaxis(straight, 2, 0)
    turned = np.dstack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn), z])
    measured = np.random.default_rng(0).random((12, 9)) < 0.7
    found = frame_of(turned, measured, 'um')
    left, right, bottom, top = found.extent
    assert (abs(right - left), abs(bottom - top)) == pytest.approx((9 * dx, 12 * dy), rel=1e-4)
    if abs(np.sin(turn)) > 0.011:
        assert found.names == ('along a row', 'along a column')
        assert (left, top) == pytest.approx((-dx / 2, -dy / 2))


@pytest.mark.parametrize('shape', [(1, 9), (9, 1)])
def test_a_single_row_or_column_is_drawn_in_points(shape):
    found = frame_of(grid(*shape, 0.5, 0.5), np.ones(shape, bool), 'um')
    assert found.scale is None
    assert found.extent == (-0.5, shape[1] - 0.5, shape[0] - 0.5, -0.5)


def test_a_very_long_cloud_is_stretched_and_has_no_scale_bar():
    long = frame_of(grid(4, 400, 1.0, 1.0), np.ones((4, 400), bool), 'um')
    assert not long.is_to_scale
    assert long.ratio_drawn == 6
