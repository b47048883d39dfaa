# SPDX-License-Identifier: Apache-2.0
"""Named scenes are reproducible, their truth is known, and the paper mode can follow the metal groove."""

import numpy as np
import pytest

from socialcircle_ros.errors import SettingError
from socialcircle_ros.simulation.scenes import SCENES, make_scene


@pytest.mark.parametrize('name', SCENES)
def test_scene_is_a_cloud_with_its_truth(name):
    scene = make_scene(name, 96, 128, seed=3)
    assert scene.points.shape == (96, 128, 3)
    assert scene.points.dtype == np.float32
    assert scene.outlier.sum() == round(0.0955 * 96 * 128)
    assert not (scene.outlier & scene.ambiguous).any()
    assert scene.points.tobytes() == make_scene(name, 96, 128, seed=3).points.tobytes()
    assert scene.points.tobytes() != make_scene(name, 96, 128, seed=4).points.tobytes()
    off = np.abs(scene.points[..., 2] - scene.z_true)
    assert np.median(off[scene.outlier]) > 10 * np.median(off[~scene.outlier & ~scene.ambiguous])


@pytest.mark.parametrize('shape', [(96, 128), (480, 640)])
def test_neighbours_in_the_metal_groove_are_within_two_pitches(shape):
    scene = make_scene('metal_groove', *shape, seed=0)
    z = np.where(scene.outlier, np.nan, scene.points[..., 2])
    assert np.nanmax(np.abs(np.diff(z, axis=0))) < 2.0
    assert np.nanmax(np.abs(np.diff(z, axis=1))) < 2.0


def test_neighbours_in_the_steep_groove_are_not_within_two_pitches():
    assert np.abs(np.diff(make_scene('steep_groove').z_true, axis=1)).max() > 2.0


def test_share_of_outliers_is_largest_in_the_groove():
    scene = make_scene('metal_groove', seed=0)
    on_land = scene.z_true > -2
    assert scene.outlier[~on_land].mean() > 4 * scene.outlier[on_land].mean()


def test_unit_scales_points_and_pitch():
    micro = make_scene('flat', 64, 64, pitch=(0.5, 0.8))
    metres = make_scene('flat', 64, 64, pitch=(0.5, 0.8), unit='m')
    np.testing.assert_allclose(metres.points, micro.points * 1e-6, rtol=1e-5, atol=1e-12)
    assert metres.pitch == pytest.approx((0.5e-6, 0.8e-6))
    assert micro.points[1, 1, :2] == pytest.approx((0.5, 0.8))


def test_share_of_outliers_can_be_given():
    assert make_scene('flat', 64, 64, share=0.3).outlier.sum() == round(0.3 * 64 * 64)
    assert not make_scene('flat', 64, 64, share=0.0).outlier.any()


def test_unknown_scene_or_unit_is_refused():
    with pytest.raises(SettingError, match="no scene 'moon'; use one of: metal_groove"):
        make_scene('moon')
    with pytest.raises(SettingError, match="'mm' is not supported"):
        make_scene('flat', unit='mm')
