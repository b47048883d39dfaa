# SPDX-License-Identifier: Apache-2.0
"""The leaves of the k-d tree."""

import numpy as np
import pytest
from point_sets import hard_point_sets

from socialcircle_ros.circle.kd_tree import LEAF_SIZE, build_leaves


def slots_of(leaves):
    """The slots that hold a point, leaf after leaf."""
    return np.concatenate([leaf * LEAF_SIZE + np.arange(size) for leaf, size in enumerate(leaves.sizes)])


@pytest.mark.parametrize('points', list(hard_point_sets()))
def test_each_point_is_in_one_leaf_with_its_own_coordinates(points):
    with np.errstate(over='ignore'):
        leaves = build_leaves(points)

    assert sorted(leaves.order) == list(range(points.shape[1]))
    assert leaves.sizes.sum() == points.shape[1]
    assert leaves.sizes.min() > 0
    assert leaves.sizes.max() <= LEAF_SIZE
    np.testing.assert_array_equal(leaves.starts, np.cumsum(leaves.sizes) - leaves.sizes)
    np.testing.assert_array_equal(leaves.exact[slots_of(leaves)], points[:, leaves.order].T)


@pytest.mark.parametrize('points', list(hard_point_sets()))
def test_boxes_hold_the_scaled_points_and_empty_slots_are_nan(points):
    with np.errstate(over='ignore'):
        leaves = build_leaves(points)
    if np.isinf(leaves.extent):
        return
    rounding = np.spacing(abs(points)).max() / leaves.extent  # of the centre

    for leaf, size in enumerate(leaves.sizes):
        scaled = leaves.scaled[:, leaf * LEAF_SIZE : (leaf + 1) * LEAF_SIZE]
        assert np.isnan(scaled[:, size:]).all()
        assert (abs(scaled[:, :size]) <= 1 + rounding).all()
        np.testing.assert_array_equal(leaves.boxes[:3, leaf], scaled[:, :size].min(axis=1))
        np.testing.assert_array_equal(leaves.boxes[3:, leaf], scaled[:, :size].max(axis=1))


@pytest.mark.parametrize('unit', [1e-120, 1e120])
def test_an_extent_whose_squares_lose_digits_counts_as_infinite(unit):
    points = np.random.default_rng(0).random((3, 50)) * unit

    assert build_leaves(points).extent == np.inf
