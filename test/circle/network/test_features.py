# SPDX-License-Identifier: Apache-2.0
"""What the network sees: as docs/learned.md defines it, and independent of unit, offset, tilt, parts and bands."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive.network_features import compressed, features_of

from socialcircle_ros.circle.network.features import Part, Rounding, channels_of, squares_of
from socialcircle_ros.circle.network.scales import scales_of
from socialcircle_ros.kernels import bands

ROUNDING = Rounding(0.083, 120)


def seen(heights):
    """The channels, and the scales."""
    channels, grain = channels_of(heights)
    scales = scales_of(heights)
    assert grain == scales.grain
    return channels, scales


def rounded(values):
    """Bytes as ONNX defines QuantizeLinear."""
    steps = np.rint(np.asarray(values, np.float32) / np.float32(ROUNDING.step)) + ROUNDING.zero
    return np.clip(steps, 0, 255).astype(np.uint8)


def squares_of_channels(channels, grain):
    """The squares by their definition; a square at the border of a cloud of odd size is filled with 0."""
    _, height, width = channels.shape
    padded = np.pad(channels, [(0, 0), (0, height % 2), (0, width % 2)])
    return [
        [
            [*(padded[c, 2 * y + down, 2 * x + right] for c in range(6) for down in (0, 1) for right in (0, 1))]
            + 4 * [grain]
            for x in range(padded.shape[2] // 2)
        ]
        for y in range(padded.shape[1] // 2)
    ]


def surface(shape=(50, 70), seed=4, holes=True):
    random = np.random.default_rng(seed)
    heights = random.normal(size=shape).astype(np.float32)
    if holes:
        heights[random.random(shape) < 0.1] = np.nan
        heights[10:20, 30:45] = np.nan
    return heights


@settings(max_examples=30, deadline=None)
@given(
    st.integers(1, 45), st.integers(1, 90), st.integers(0, 10**6), st.sampled_from([0, 0.05, 0.6]),
    st.sampled_from([1e-6, 1.0, -300.0]), st.sampled_from([0, 5.0, -4000.0]),
)  # fmt: skip
def test_the_kernels_equal_the_definition(height, width, seed, missing, unit, offset):
    random = np.random.default_rng(seed)
    heights = random.standard_t(3, size=(height, width))
    heights[random.random(heights.shape) < missing] = np.nan
    heights.flat[random.integers(heights.size)] = 40
    heights = ((heights + offset) * unit).astype(np.float32)
    channels, scales = seen(heights)
    expected = features_of(heights)
    np.testing.assert_allclose(scales.spread, expected.scale, rtol=1e-2)
    np.testing.assert_allclose(scales.grain, expected.grain, atol=2e-2)
    np.testing.assert_allclose(channels, expected.channels, atol=2e-2)


@settings(max_examples=30, deadline=None)
@given(
    st.integers(1, 45), st.integers(1, 90), st.integers(0, 10**6), st.sampled_from([0.1, 0.2, 0.5, 0.9, 3.0]),
    st.sampled_from([0, 0.003, 0.4]), st.sampled_from([1.0, 0.01]), st.sampled_from([0, 0.3]),
)  # fmt: skip
def test_the_kernels_equal_the_definition_of_heights_in_steps(height, width, seed, noise, tilt, unit, missing):
    random = np.random.default_rng(seed)
    heights = np.round(random.normal(0, noise, (height, width)) + tilt * np.arange(width)) * unit
    heights[random.random(heights.shape) < missing] = np.nan
    heights.flat[random.integers(heights.size)] = 40
    heights = heights.astype(np.float32)
    channels, scales = seen(heights)
    expected = features_of(heights)
    np.testing.assert_allclose(scales.spread, expected.scale, rtol=1e-2)
    np.testing.assert_allclose(scales.grain, expected.grain, atol=2e-2)
    np.testing.assert_allclose(channels, expected.channels, atol=2e-2)


def test_the_kernels_equal_the_definition_closely_without_an_offset():
    heights = surface((90, 131))
    channels, scales = seen(heights)
    expected = features_of(heights)
    assert scales.spread == pytest.approx(expected.scale, rel=1e-6)
    np.testing.assert_allclose(channels, expected.channels, atol=2e-3)


@pytest.mark.parametrize('shape', [(1, 1), (1, 40), (33, 2), (26, 31)])
def test_squares_are_the_rounded_channels_of_four_points(shape):
    heights = 300 * surface(shape)  # some channels are beyond 8 bits
    heights.flat[0] = 2e6
    channels, scales = seen(heights)
    squares = squares_of(heights, scales, Part(0, shape[0], 0, shape[1]), 20, 24, ROUNDING)
    expected = rounded(squares_of_channels(channels, scales.grain))
    rows, columns, _ = expected.shape
    np.testing.assert_array_equal(squares[:rows, :columns], expected)
    beyond = np.ones(squares.shape[:2], bool)
    beyond[:rows, :columns] = False
    assert (squares[beyond][:, :-4] == ROUNDING.zero).all()
    assert (squares[beyond][:, -4:] == rounded(scales.grain)).all()


@pytest.mark.parametrize('holes', [False, True])
def test_a_part_of_a_cloud_has_the_same_squares(holes):
    heights = surface((130, 171), holes=holes)
    scales = scales_of(heights)
    whole = squares_of(heights, scales, Part(0, 130, 0, 171), 65, 86, ROUNDING)
    part = squares_of(heights, scales, Part(38, 99, 52, 171), 40, 60, ROUNDING)
    np.testing.assert_array_equal(part[:30], whole[19:49, 26:])
    assert (part[31:, :, :-4] == ROUNDING.zero).all()


@pytest.mark.parametrize('holes', [False, True])
def test_bands_change_nothing(monkeypatch, holes):
    heights = surface((130, 171), holes=holes)
    monkeypatch.setattr(bands, 'limit', 1)
    one, scales = seen(heights)
    monkeypatch.setattr(bands, 'limit', 7)
    monkeypatch.setattr(bands, '_LEAST', 100)
    several, others = seen(heights)
    np.testing.assert_array_equal(one, several)
    assert scales == others
    squares = squares_of(heights, scales, Part(0, 130, 0, 171), 65, 86, ROUNDING)
    np.testing.assert_array_equal(squares, rounded(squares_of_channels(several, scales.grain)))


@pytest.mark.parametrize('power', [-60, -3, 1, 40])
def test_a_power_of_two_changes_nothing(power):
    channels, scales = seen(surface())
    scaled, others = seen(surface() * np.float32(2.0**power))
    np.testing.assert_array_equal(scaled, channels)
    assert others.grain == scales.grain
    assert others.spread == scales.spread * 2.0**power


def test_offset_and_tilt_change_rounding_alone():
    heights = surface()
    rows, columns = np.mgrid[: heights.shape[0], : heights.shape[1]]
    tilted = (heights + 100 + 0.5 * columns - 2 * rows).astype(np.float32)
    np.testing.assert_allclose(seen(tilted)[0], seen(heights)[0], atol=2e-3)


def test_points_that_are_not_measured_have_no_features():
    heights = surface()
    channels, _ = seen(heights)
    assert not channels[:, np.isnan(heights)].any()
    np.testing.assert_array_equal(channels[5] == 1, np.isfinite(heights))


def test_a_plane_has_no_residuals():
    rows, columns = np.mgrid[:40, :60]
    assert not seen((3 * rows - columns).astype(np.float32))[0][:5].any()


def test_a_single_point_measured_alone():
    heights = np.full((9, 9), np.nan, np.float32)
    heights[4, 4] = -7.0
    assert seen(heights)[0].sum() == 1


@pytest.mark.parametrize('largest', [3e38, 1e-38])
def test_extreme_heights_have_finite_features(largest):
    heights = surface() * np.float32(largest / 8)
    channels, scales = seen(heights)
    assert np.isfinite(channels).all()
    assert np.isfinite(scales.grain)


def test_compression_is_nearly_a_logarithm_and_keeps_the_order():
    values = np.linspace(-1000, 1000, 40001, dtype=np.float32)
    found = compressed(values)
    np.testing.assert_allclose(found, np.sign(values) * np.log2(1 + np.abs(values)), atol=0.09)
    assert (np.diff(found) > 0).all()
