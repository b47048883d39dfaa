# SPDX-License-Identifier: Apache-2.0
"""Outliers and walls by the depth of field."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import adaptive as naive

from socialcircle_ros.circle.adaptive import find_outliers
from socialcircle_ros.circle.adaptive.optics import TOLERANCE, WALL, beside_walls, beyond_tolerance

SHAPES = st.tuples(st.integers(1, 24), st.integers(1, 20))
DEPTH_OF_FIELD = 6.0


def scenes(shape, random, gone, removed):
    """Heights in levels that are just a wall apart or just not, slopes, holes and outliers."""
    generator = np.random.default_rng(random)
    levels = generator.choice([0.0, 1.9, 2.3, 8.9, 9.1, 40.0], shape)
    heights = np.where(generator.random(shape) < 0.7, levels[0, 0], levels) + generator.normal(0, 0.2, shape)
    heights += generator.choice([0, 9.5]) * np.arange(shape[1])
    heights[generator.random(shape) < gone] = np.nan
    return heights.astype(np.float32), (generator.random(shape) < removed) & np.isfinite(heights)


def surface(rows=60, columns=80):
    return np.random.default_rng(3).normal(0, 0.05, (rows, columns)).astype(np.float32)


@settings(max_examples=200)
@given(SHAPES, st.integers(0, 2**32), st.sampled_from([0.0, 0.1, 0.6]), st.sampled_from([0.0, 0.1, 0.6, 1.0]))
def test_outliers_and_walls_equal_the_reference(shape, random, gone, removed):
    heights, found = scenes(shape, random, gone, removed)

    beyond = beyond_tolerance(heights, found, DEPTH_OF_FIELD)
    np.testing.assert_array_equal(beyond, naive.beyond_tolerance(heights, found, TOLERANCE * DEPTH_OF_FIELD))
    beside = beside_walls(heights, found, DEPTH_OF_FIELD)
    np.testing.assert_array_equal(beside, naive.beside_walls(heights, found, WALL * DEPTH_OF_FIELD))


@pytest.mark.parametrize(('rise', 'kept'), [(1.5, True), (3.0, False), (-1.5, True), (-3.0, False)])
def test_a_patch_is_an_outlier_beyond_the_tolerance(rise, kept):
    heights = surface()
    heights[20:28, 30:38] += rise
    patch = np.zeros(heights.shape, bool)
    patch[20:28, 30:38] = True

    np.testing.assert_array_equal(find_outliers(heights, DEPTH_OF_FIELD).outliers, patch & (not kept))
    # Without a depth of field only the heights decide.
    np.testing.assert_array_equal(find_outliers(heights).outliers, patch)


def test_two_points_on_either_side_of_a_wall_are_outliers():
    heights = surface()
    heights[:, 40:] += 30

    outliers = find_outliers(heights, DEPTH_OF_FIELD).outliers

    assert outliers[:, 38:42].all()
    assert not outliers[:, :38].any()
    assert not outliers[:, 42:].any()


def test_a_slope_is_no_wall_however_steep():
    heights = surface()
    heights += np.arange(80, dtype=np.float32) * 12

    assert not find_outliers(heights, DEPTH_OF_FIELD).outliers.any()


def test_a_step_that_the_optics_resolve_is_no_wall():
    heights = surface()
    heights[:, 40:] += 0.9 * WALL * DEPTH_OF_FIELD

    assert not find_outliers(heights, DEPTH_OF_FIELD).outliers.any()


def test_the_unit_does_not_matter():
    heights = surface()
    heights[:, 40:] += 30
    heights[10, 10] += 5
    heights[30:36, 20:26] -= 3

    one = find_outliers(heights, DEPTH_OF_FIELD)
    other = find_outliers(heights * np.float32(2**-20), DEPTH_OF_FIELD * 2**-20)

    np.testing.assert_array_equal(one.outliers, other.outliers)
    assert one.outliers[10, 10]
    assert one.outliers[30:36, 20:26].all()
