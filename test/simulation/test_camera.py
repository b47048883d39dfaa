# SPDX-License-Identifier: Apache-2.0
"""The camera follows EMVA 1288: it is linear, with shot noise, read noise, rounding and saturation."""

import numpy as np
import pytest

from socialcircle_ros.errors import SettingError
from socialcircle_ros.simulation.camera import NOISELESS, Camera

SHAPE = (200, 200)


def flat(light):
    return np.full(SHAPE, light, dtype=np.float32)


@pytest.mark.parametrize('light', [0.05, 0.5, 1.2])
def test_mean_and_variance_follow_the_photon_transfer_curve(light):
    camera = Camera(bits=12, prnu=0.0, dsnu=0.0)
    frame = camera.sensor(SHAPE, 0).expose(flat(light), 1).astype(float)
    gain = camera.top / camera.full_well
    electrons = light * camera.exposure * camera.full_well
    assert frame.mean() == pytest.approx(electrons * gain + camera.black_level * camera.top, rel=0.002)
    assert frame.var() == pytest.approx(gain**2 * (electrons + camera.read_noise**2) + 1 / 12, rel=0.03)
    assert camera.noise(flat(light))[0, 0] == pytest.approx(
        frame.std() / gain / (camera.full_well * camera.exposure), rel=0.03
    )


@pytest.mark.parametrize(
    ('bits', 'kind', 'top'), [(8, np.uint8, 255), (12, np.uint16, 4095), (16, np.uint16, 65535)]
)
def test_full_well_gives_the_largest_gray_level(bits, kind, top):
    camera = Camera(bits=bits)
    frame = camera.sensor(SHAPE, 0).expose(flat(2 * camera.saturation), 1)
    assert frame.dtype == kind
    assert (frame == top).all()


def test_pixel_keeps_its_gain_and_offset():
    sensor = Camera(bits=16, full_well=1e9, read_noise=0.0, prnu=0.01, dsnu=0.0).sensor(SHAPE, 0)
    one, two = (sensor.expose(flat(1.0), seed).astype(float) for seed in (1, 2))
    assert one.std() / (one.mean() - 0.01 * 65535) == pytest.approx(0.01, rel=0.05)
    assert np.corrcoef(one.ravel(), two.ravel())[0, 1] > 0.99


def test_noiseless_camera_only_rounds():
    frame = NOISELESS.sensor(SHAPE, 0).expose(flat(1.0), 1)
    assert np.ptp(frame) <= 1


def test_same_seed_gives_the_same_frame():
    sensor = Camera().sensor(SHAPE, 0)
    assert sensor.expose(flat(0.5), 1).tobytes() == sensor.expose(flat(0.5), 1).tobytes()
    assert sensor.expose(flat(0.5), 1).tobytes() != sensor.expose(flat(0.5), 2).tobytes()


@pytest.mark.parametrize('change', [{'bits': 10}, {'full_well': 0.0}, {'read_noise': -1.0}])
def test_camera_with_values_out_of_range_is_refused(change):
    with pytest.raises(SettingError, match='camera'):
        Camera(**change)
