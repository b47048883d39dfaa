# SPDX-License-Identifier: Apache-2.0
"""The quality of a depth that comes from a few pixels of the window."""

import numpy as np
import pytest
from focus.stacks import INNER, make_stack
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import focus as naive

from socialcircle_ros.focus import Reason, depth_from_focus
from socialcircle_ros.focus.evenness import lower_where_few_pixels_have_texture
from socialcircle_ros.focus.measure import MeasureParameters
from socialcircle_ros.kernels import bands
from socialcircle_ros.settings import FocusSettings


def lowered(image, step, half, quality, threshold=0):
    quality, reasons = quality.copy(), np.zeros(image.shape, np.uint8)
    lower_where_few_pixels_have_texture(image, MeasureParameters(step, half, threshold), quality, reasons)
    return quality, reasons


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 999),
    height=st.integers(1, 17),
    width=st.integers(1, 23),
    half=st.integers(0, 4),
    step=st.integers(1, 2),
    bright=st.integers(0, 5),
    dtype=st.sampled_from([np.uint8, np.uint16]),
)
def test_quality_equals_the_reference(seed, height, width, half, step, bright, dtype):
    rng = np.random.default_rng(seed)
    image = rng.integers(100, 110, (height, width)).astype(dtype)
    image[rng.integers(0, height, bright), rng.integers(0, width, bright)] = np.iinfo(dtype).max
    quality = rng.random(image.shape).astype(np.float32)
    found, reasons = lowered(image, step, half, quality)
    odds = (naive.effective_share(image, step, half) / 0.25) ** 6
    likely = np.where(np.isnan(odds), 1, odds / (1 + odds))
    np.testing.assert_allclose(found, quality * likely, rtol=1e-5)
    sure = np.abs(odds - 1) > 1e-9
    assert np.array_equal((reasons == Reason.FEW_PIXELS)[sure], ((odds < 1) & (found > 0))[sure])


def test_bands_change_nothing(monkeypatch):
    image = np.random.default_rng(0).integers(0, 65535, (600, 400)).astype(np.uint16)
    quality = np.ones(image.shape, np.float32)
    monkeypatch.setattr(bands, 'limit', 1)
    whole = lowered(image, 2, 4, quality)
    monkeypatch.setattr(bands, 'limit', 3)
    assert all(np.array_equal(*pair) for pair in zip(whole, lowered(image, 2, 4, quality), strict=True))


def test_the_threshold_of_the_focus_measure_does_not_matter():
    image = np.random.default_rng(0).integers(0, 255, (30, 40)).astype(np.uint8)
    quality = np.ones(image.shape, np.float32)
    assert np.array_equal(lowered(image, 2, 4, quality, 300)[0], lowered(image, 2, 4, quality)[0])


def test_random_texture_keeps_its_quality(clean):
    result = depth_from_focus(clean.frames, clean.z)
    assert np.mean(result.quality[INNER] > 0.98) > 0.9
    assert not np.any(result.reasons[INNER] & Reason.FEW_PIXELS)


@pytest.mark.parametrize('step', [0, 2])
def test_a_reflection_above_the_surface_is_not_trusted(step):
    """A bright spot, focused 6 steps above the surface, ten times as bright as the texture."""
    stack = make_stack(seed=4, tilt=0.01, electrons=6000, dtype=np.uint16)
    frames = stack.frames // 12
    row, column = 40, 60
    y, x = np.mgrid[:96, :128]
    for frame, z in zip(frames, stack.z, strict=True):
        spread = 0.4 + ((z - stack.truth[row, column] - 6) / 1.5) ** 2
        spot = 20_000 / spread * np.exp(-0.5 * ((y - row) ** 2 + (x - column) ** 2) / spread)
        frame[:] += spot.astype(np.uint16)
    result = depth_from_focus(frames, stack.z, FocusSettings(step=step))
    near = np.s_[row - 2 : row + 3, column - 2 : column + 3]
    assert np.all(np.abs(result.depth - stack.truth)[near] > 4)
    assert result.quality[near].max() < 0.3
    assert np.all(result.reasons[near] & Reason.FEW_PIXELS)
