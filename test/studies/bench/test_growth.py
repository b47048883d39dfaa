# SPDX-License-Identifier: Apache-2.0
"""Growth of the time with the size of the cloud."""

import numpy as np
import pytest

from socialcircle_ros.circle import remove_outliers
from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.settings import CircleSettings
from socialcircle_ros.studies.bench import growth
from socialcircle_ros.studies.bench.growth import draw_growth, large_cloud, time_growth


def test_a_large_cloud_is_the_scene_and_its_mirror_images():
    xyz = large_cloud(970, 1300)

    assert xyz.shape == (970, 1300, 3)
    np.testing.assert_array_equal(xyz[5, :4, 0], [0, 1, 2, 3])
    np.testing.assert_array_equal(xyz[:4, 5, 1], [0, 1, 2, 3])
    np.testing.assert_array_equal(xyz[960:, :, 2], xyz[950:960, :, 2][::-1])
    np.testing.assert_array_equal(xyz[:, 1280:, 2], xyz[:, 1260:1280, 2][:, ::-1])
    assert 0.05 < np.mean(remove_outliers(xyz, CircleSettings(mode='paper')).outliers) < 0.2


def test_growth_is_measured_and_drawn(monkeypatch, tmp_path):
    monkeypatch.setattr(growth, 'POINTS', (10_000, 40_000))

    points = list(time_growth(2))
    draw_growth(points, tmp_path / 'growth.png')

    assert [round(each.points, -3) for each in points] == [10_000, 40_000]
    assert all(each.vote_ms > 0 and each.circle_ms > 0 and each.ns_per_point > 0 for each in points)
    assert (tmp_path / 'growth.png').read_bytes().startswith(b'\x89PNG')
    with pytest.raises(SocialCircleError, match='cannot be written'):
        draw_growth(points, tmp_path / 'no' / 'growth.png')
