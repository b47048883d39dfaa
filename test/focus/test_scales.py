# SPDX-License-Identifier: Apache-2.0
"""The scale of the focus measure is chosen from the frames, in any order of them."""

import numpy as np
import pytest
from focus.stacks import same
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import focus as naive

from socialcircle_ros.focus import FocusStack, PixelCurve, depth_from_focus, focus_measure
from socialcircle_ros.focus.scales import (
    BIN,
    DepthMaps,
    ScaleResult,
    _at_every_pixel,
    _bin,
    _lower_where_bent,
    choose,
    scales_for,
)
from socialcircle_ros.settings import FocusSettings
from socialcircle_ros.simulation import INSTRUMENTS, Optics, Stage, simulate


@pytest.fixture(scope='module')
def oversampled():
    """A camera with four pixels where the optics resolve one."""
    sharp = INSTRUMENTS['10x']
    optics = Optics(numerical_aperture=sharp.numerical_aperture, pixel=sharp.pixel / 4)
    scan = simulate(
        'flat', 98, 131, instrument=optics, z_step=optics.depth_of_field / 2, stage=Stage(jitter=0.2), seed=3
    )
    frames = list(scan.frames())
    return scan, np.stack([frame.image for frame in frames]), np.array([frame.z for frame in frames])


def test_step_4_is_chosen_where_the_camera_resolves_more_than_the_optics(oversampled):
    scan, frames, z = oversampled
    chosen, fine = depth_from_focus(frames, z), depth_from_focus(frames, z, FocusSettings(step=2))
    assert (chosen.step, fine.step) == (4, 2)
    assert np.mean(chosen.quality >= 0.9) > 0.9
    assert np.mean(fine.quality >= 0.9) < 0.5
    errors = [scan.truth.classify(result.depth).error for result in (chosen, fine)]
    assert np.nanmedian(np.abs(errors[0])) < 0.7 * np.nanmedian(np.abs(errors[1]))
    assert chosen.image.shape == frames[0].shape


def test_scan_downward_gives_the_same_where_step_4_is_chosen(oversampled):
    _, frames, z = oversampled
    downward = FocusStack()
    for k in range(len(z))[::-1]:
        downward.add(frames[k], z[k])
    found = downward.finish()
    assert found.step == 4
    assert same(found, depth_from_focus(frames, z))


@pytest.mark.parametrize('place', [(50, 61), (0, 0), (97, 130)])
def test_the_curve_of_a_pixel_is_that_of_the_chosen_scale(oversampled, place):
    _, frames, z = oversampled
    stack = PixelCurve(FocusSettings(normalize=False), place)
    for frame, position in zip(frames, z, strict=True):
        stack.add(frame, position)
    assert stack.finish().step == 4
    binned = frames[:, :96, :128].reshape(-1, 24, BIN, 32, BIN).sum((2, 4)).astype(np.uint16)
    coarse = FocusSettings(step=1, half_window=2)
    row, column = min(place[0] // BIN, 23), min(place[1] // BIN, 31)
    expected = [focus_measure(frame, coarse)[row, column] / BIN**2 for frame in binned]
    np.testing.assert_allclose(stack.curve.measure, np.array(expected)[np.argsort(z)])


@pytest.mark.parametrize('name', ['clean', 'noisy'])
def test_step_2_is_chosen_where_the_texture_is_as_fine_as_the_pixels(name, request):
    stack = request.getfixturevalue(name)
    chosen = depth_from_focus(stack.frames, stack.z)
    assert chosen.step == 2
    assert same(chosen, depth_from_focus(stack.frames, stack.z, FocusSettings(step=2)))


def test_small_frames_are_measured_at_one_scale():
    frames = np.random.default_rng(0).integers(0, 255, (5, 31, 90), np.uint8)
    assert depth_from_focus(frames, np.arange(5)).step == 2


@pytest.mark.parametrize(
    ('dtype', 'most', 'shift'), [(np.uint8, 255, 0), (np.uint16, 4095, 0), (np.uint16, 65535, 4)]
)
def test_binned_pixels_are_sums(dtype, most, shift):
    frame = np.random.default_rng(1).integers(0, most + 1, (BIN * 5 + 3, BIN * 7 + 1)).astype(dtype)
    frame[:BIN, :BIN] = most
    binned = np.empty((5, 7), np.uint16)
    _bin(frame, shift, binned)
    sums = frame[: BIN * 5, : BIN * 7].reshape(5, BIN, 7, BIN).sum((1, 3), dtype=np.int64)
    assert np.array_equal(binned, (sums + (1 << shift) // 2) >> shift)


def test_brighter_pixels_than_the_saturation_do_not_overflow():
    binned = np.empty((1, 1), np.uint16)
    _bin(np.full((BIN, BIN), 65535, np.uint16), 0, binned)
    assert binned[0, 0] == 65535


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 999),
    height=st.integers(1, 12),
    width=st.integers(1, 15),
    half=st.integers(0, 3),
    offset=st.sampled_from([0.0, -3e3, 1e5]),
)
def test_quality_on_bent_parts_equals_the_reference(seed, height, width, half, offset):
    rng = np.random.default_rng(seed)
    depth = offset + rng.normal(0, 3, (height, width))
    quality = rng.random((height, width)).astype(np.float32)
    missing = rng.random((height, width)) < 0.1
    depth[missing], quality[missing] = np.nan, 0
    found = quality.copy()
    _lower_where_bent(depth, found, half, width=1.5)
    np.testing.assert_allclose(found, naive.quality_where_bent(depth, quality, half, 0.2 * 1.5), rtol=1e-4)


def test_a_tilted_plane_keeps_its_quality_inside_and_an_edge_does_not():
    row, column = np.mgrid[:20, :30]
    quality = np.full(row.shape, 0.9, np.float32)
    plane = quality.copy()
    _lower_where_bent(0.5 * row - 0.3 * column, plane, 2, 1.0)
    np.testing.assert_allclose(plane[2:-2, 2:-2], 0.9, rtol=1e-5)
    _lower_where_bent(np.where(column < 15, 0.0, 4.0), quality, 2, 1.0)
    assert quality[:, 14:16].max() < 0.3
    np.testing.assert_allclose(quality[:, :13], 0.9, rtol=1e-5)


class TestDepthAtEveryPixel:
    @staticmethod
    def spread(depth, shape):
        quality = np.linspace(0, 1, depth.size, dtype=np.float32).reshape(depth.shape)
        reasons = np.arange(depth.size, dtype=np.uint8).reshape(depth.shape)
        return _at_every_pixel(DepthMaps(depth, quality, reasons), np.arange(-50.0, 51), shape), quality, reasons

    def test_a_plane_stays_a_plane_up_to_the_edge(self):
        row, column = np.mgrid[:35, :46]
        plane = 0.1 * (row - 1.5) - 0.2 * (column - 1.5) + 3
        middles = 0.1 * BIN * np.arange(8)[:, None] - 0.2 * BIN * np.arange(11) + 3
        found, _, _ = self.spread(middles, plane.shape)
        np.testing.assert_allclose(found.depth, plane, atol=1e-9)

    def test_quality_and_reasons_are_those_of_the_nearest_binned_pixel(self):
        found, quality, reasons = self.spread(np.zeros((8, 9)), (34, 39))
        assert np.array_equal(found.quality[:32, :36], np.kron(quality, np.ones((BIN, BIN))))
        assert np.array_equal(found.reasons[33, 38], reasons[-1, -1])

    def test_edges_and_missing_depths_are_not_blurred(self):
        depth = np.where(np.arange(9) < 5, 0.0, 7.0) * np.ones((8, 1))
        depth[3, 2] = np.nan
        found, _, _ = self.spread(depth, (32, 36))
        assert set(np.unique(found.depth[np.isfinite(found.depth)])) == {0.0, 7.0}
        assert np.isnan(found.depth).sum() == BIN * BIN


@pytest.mark.parametrize(('fine', 'coarse', 'expected', 'measured'), [
    (0.5, 0.6, 1, [1, 4]), (0.5, 0.7, 4, [1, 4]), (0.87, 1.0, 4, [1, 4]), (0.875, 1.0, 1, [1]), (1.0, 1.0, 1, [1]),
])  # fmt: skip
def test_the_coarse_scale_is_measured_only_where_it_could_be_chosen(fine, coarse, expected, measured):
    shape, asked = (40, 48), []
    scales = scales_for(np.zeros(shape, np.uint8), FocusSettings(step=0))

    def measure(scale):
        asked.append(scale.image.shape)
        quality = np.full(scale.image.shape, fine if scale is scales[0] else coarse, np.float32)
        maps = DepthMaps(np.zeros(quality.shape), quality, np.zeros(quality.shape, np.uint8))
        return ScaleResult(maps, 1.0, 1 if scale is scales[0] else 4, 2)

    assert choose(scales, np.arange(3.0), measure).step == expected
    assert asked == [(shape[0] // side, shape[1] // side) for side in measured]
