# SPDX-License-Identifier: Apache-2.0
"""What the network sees: independent of unit, offset and tilt, and of what lies in holes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from socialcircle_ros.studies.learned.features import compressed, features_of


def surface(shape=(50, 70), seed=4):
    random = np.random.default_rng(seed)
    heights = random.normal(size=shape).astype(np.float32)
    heights[random.random(shape) < 0.1] = np.nan
    heights[10:20, 30:45] = np.nan
    return heights


@pytest.mark.parametrize('power', [-60, -3, 1, 40])
def test_a_power_of_two_changes_nothing(power):
    heights = surface()
    scaled = features_of(heights * np.float32(2.0**power))
    assert np.array_equal(scaled.channels, features_of(heights).channels)
    assert scaled.grain == features_of(heights).grain


def test_offset_and_tilt_change_rounding_alone():
    heights = surface()
    rows, columns = np.mgrid[: heights.shape[0], : heights.shape[1]]
    tilted = (heights + 100 + 0.5 * columns - 2 * rows).astype(np.float32)
    assert np.allclose(features_of(tilted).channels, features_of(heights).channels, atol=1e-3)


def test_points_that_are_not_measured_have_no_features():
    heights = surface()
    channels = features_of(heights).channels
    assert not channels[:, np.isnan(heights)].any()
    assert np.array_equal(channels[5] == 1, np.isfinite(heights))


@pytest.mark.parametrize('shape', [(1, 1), (1, 9), (9, 1), (2, 3), (5, 200)])
def test_clouds_of_any_size_have_finite_features(shape):
    found = features_of(np.random.default_rng(1).normal(size=shape).astype(np.float32))
    assert found.channels.shape == (6, *shape)
    assert np.isfinite(found.channels).all()
    assert np.isfinite(found.grain)


def test_a_plane_has_no_residuals():
    rows, columns = np.mgrid[:40, :60]
    found = features_of((3 * rows - columns).astype(np.float32))
    assert not found.channels[:5].any()


def test_a_single_point_measured_alone():
    heights = np.full((9, 9), np.nan, np.float32)
    heights[4, 4] = -7.0
    assert features_of(heights).channels.sum() == 1


@given(arrays(np.float32, 20, elements=st.floats(-1000, 1000, width=32)))
def test_compression_is_nearly_a_logarithm(values):
    assert np.allclose(compressed(values), np.sign(values) * np.log2(1 + np.abs(values)), atol=0.09)


def test_compression_keeps_the_order():
    values = np.linspace(-100, 100, 4001, dtype=np.float32)
    assert (np.diff(compressed(values)) > 0).all()
