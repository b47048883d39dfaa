# SPDX-License-Identifier: Apache-2.0
"""The correction of the depth from the centroid of the texture in a window to the pixel."""

import numpy as np
from focus.stacks import make_stack
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import focus as naive

from socialcircle_ros.focus import depth_from_focus
from socialcircle_ros.focus.centroid import correct_for_centroid
from socialcircle_ros.focus.measure import MeasureParameters
from socialcircle_ros.settings import FocusSettings


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 999),
    height=st.integers(1, 19),
    width=st.integers(1, 23),
    half=st.integers(0, 4),
    step=st.integers(1, 2),
    threshold=st.sampled_from([0, 30, 1000]),
    roughness=st.sampled_from([0.05, 0.5]),
    dtype=st.sampled_from([np.uint8, np.uint16]),
)
def test_correction_equals_the_reference(seed, height, width, half, step, threshold, roughness, dtype):
    rng = np.random.default_rng(seed)
    z = 3.0 + np.sort(rng.random(20)) * 10
    rows, columns = np.mgrid[:height, :width]
    depth = 7 + rng.normal(0, 0.1) * rows + rng.normal(0, 0.1) * columns
    depth = np.clip(depth + roughness * rng.standard_normal(depth.shape), z[0], z[-1])
    quality = np.where(rng.random(depth.shape) < 0.8, 0.9, 0.4).astype(np.float32)
    missing = rng.random(depth.shape) < 0.1
    depth[missing], quality[missing] = np.nan, 0
    image = rng.integers(0, 250, depth.shape).astype(dtype)
    given = depth.copy()
    found = correct_for_centroid(depth, quality, image, z, MeasureParameters(step, half, threshold))
    expected = naive.correct_for_centroid(depth, quality, image, z, step, half, threshold)
    # Rounding decides where the difference of two halves is close to its limit.
    off = ~np.isclose(found, expected, rtol=0, atol=1e-3, equal_nan=True)
    assert off.sum() <= 0.02 * off.size
    np.testing.assert_array_equal(depth, given)


def test_level_surface_is_unchanged():
    image = np.random.default_rng(0).integers(0, 250, (20, 30)).astype(np.uint8)
    depth = np.full(image.shape, 4.25)
    quality = np.ones(image.shape, np.float32)
    found = correct_for_centroid(depth, quality, image, np.arange(9.0), MeasureParameters(2, 4, 0))
    np.testing.assert_array_equal(found, depth)


def test_correction_halves_the_error_of_a_slope_at_the_edge_of_the_frame():
    stack = make_stack(dtype=np.uint16, tilt=0.15)
    # The three-point fit is not corrected: its windows at the edge cover only pixels farther in.
    found, reference = (
        depth_from_focus(stack.frames, stack.z, FocusSettings(fit=fit)).depth - stack.truth
        for fit in ('gauss', 'gauss3')
    )
    for column, sign in ((1, 1), (-2, -1)):
        expected = sign * np.nanmean(reference[10:-10, column])
        assert expected > 0.2
        assert abs(np.nanmean(found[10:-10, column])) < expected / 2
