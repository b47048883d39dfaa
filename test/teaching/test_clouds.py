# SPDX-License-Identifier: Apache-2.0
"""Good clouds and their fields."""

from pathlib import Path

import numpy as np
import pytest
from good_parts import part, pitted

from socialcircle_ros.errors import CloudError
from socialcircle_ros.settings import CircleSettings, PipelineSettings
from socialcircle_ros.teaching.clouds import good_fields, read_good_clouds

BAGS = Path(__file__).resolve().parents[2] / 'bags'


def test_of_several_clouds_every_second_one_is_kept_back():
    clouds = [part(np.random.default_rng(seed).normal(size=(80, 90)), str(seed)) for seed in range(5)]
    taught, kept_back = good_fields(clouds)
    assert [field.name for field in taught] == ['0', '2', '4']
    assert [field.name for field in kept_back] == ['1', '3']


@pytest.mark.parametrize(('shape', 'number'), [((420, 130), 4), ((130, 421), 4), ((150, 201), 2), ((203, 150), 2)])
def test_one_cloud_is_cut_along_its_longer_side_and_no_point_is_lost(shape, number):
    heights = np.random.default_rng(2).normal(size=shape)
    heights[3, 5] = np.nan
    taught, kept_back = good_fields([part(heights, dtype=np.float64)])
    assert len(taught) == len(kept_back) == number // 2
    fields = [field for pair in zip(taught, kept_back, strict=True) for field in pair]
    whole = np.concatenate([field.heights for field in fields], axis=int(shape[1] > shape[0]))
    np.testing.assert_array_equal(whole, heights)


def test_too_few_points_are_refused():
    with pytest.raises(CloudError, match='4900 measured points to teach on, and a lesson needs at least 5000'):
        good_fields([part(np.zeros((70, 140)))])


def test_rare_points_that_stand_out_are_suspects_and_many_are_texture():
    heights = np.random.default_rng(2).normal(size=(200, 300))
    heights[::40, ::50] += 80
    fields = [field for group in good_fields([part(heights)]) for field in group]
    suspects = np.concatenate([fields[0].suspects, fields[1].suspects], axis=1)
    np.testing.assert_array_equal(suspects, heights > 40)
    heights[::8, ::10] -= 80
    many = [field for group in good_fields([part(heights)]) for field in group]
    assert not any(field.suspects.any() for field in many)
    stand_out = np.concatenate([many[0].stands_out, many[1].stands_out], axis=1)
    np.testing.assert_array_equal(stand_out, np.abs(heights) > 40)


def test_what_lies_beside_a_step_does_not_stand_out():
    heights = np.random.default_rng(2).normal(size=(200, 300))
    heights[:, 150:] += 90
    heights[100:, :] += 90
    assert not any(field.stands_out.any() for group in good_fields([part(heights)]) for field in group)


def test_the_noise_of_a_flat_field_is_above_0():
    assert all(field.noise > 0 for group in good_fields([part(np.zeros((200, 300)))]) for field in group)


def test_a_damaged_recording_is_told(tmp_path):
    content = (BAGS / 'parts.mcap').read_bytes()
    (tmp_path / 'cut.mcap').write_bytes(content[: len(content) // 2])
    clouds, _, damage = read_good_clouds([BAGS / 'parts.mcap', tmp_path / 'cut.mcap'], PipelineSettings(), most=2)
    assert len(clouds) >= 2
    assert [sentence.partition('cut.mcap is damaged')[1] for sentence in damage] == ['cut.mcap is damaged']


def test_clouds_are_read_from_recordings_and_measurement_files(tmp_path):
    heights = pitted(60, 70).astype(np.float32)
    heights[7, 9] = -99
    np.savez(tmp_path / 'good.npz', z=heights, dx=1.0, dy=2.0, unit='m')
    settings = PipelineSettings(circle=CircleSettings(not_measured='-99', depth_of_field=3.0))
    clouds, refused, damage = read_good_clouds([tmp_path / 'good.npz', BAGS / 'parts.mcap'], settings, most=2)
    assert not refused
    assert not damage
    assert [cloud.name.split()[0] for cloud in clouds] == ['good.npz', 'parts.mcap', 'parts.mcap']
    assert clouds[0].points.shape == (60, 70, 3)
    assert np.isnan(clouds[0].points[7, 9]).all()
    assert clouds[0].depth_of_field == 3.0
