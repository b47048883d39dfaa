# SPDX-License-Identifier: Apache-2.0
"""PCL and Open3D: the masks are the same where the window contains all neighbours."""

import numpy as np
import pytest
from baselines.clouds import rough
from naive import baselines as naive

from socialcircle_ros.baselines import peers, radius_filter, statistical_filter
from socialcircle_ros.baselines.settings import RadiusSettings, StatisticalSettings
from socialcircle_ros.errors import SocialCircleError

RADIUS = [
    pytest.param(
        peers.pcl_radius_filter,
        marks=pytest.mark.skipif(not peers.pcl_is_installed(), reason='pcl-tools is not installed'),
    ),
    pytest.param(
        peers.open3d_radius_filter,
        marks=pytest.mark.skipif(not peers.open3d_is_installed(), reason='open3d is not installed'),
    ),
]
STATISTICAL = [
    pytest.param(peers.pcl_statistical_filter, marks=RADIUS[0].marks),
    pytest.param(peers.open3d_statistical_filter, marks=RADIUS[1].marks),
]


@pytest.mark.parametrize('peer', RADIUS)
def test_radius_filters_agree_where_the_window_contains_the_sphere(peer):
    xyz, _ = rough(60, 70)
    # A radius of 2.1 pitches reaches no point outside of a 5×5 window.
    settings = RadiusSettings(radius=2.1, min_neighbours=9)
    theirs, ours = peer(xyz, settings), radius_filter(xyz, settings)
    np.testing.assert_array_equal(theirs.outliers, ours.outliers)
    np.testing.assert_array_equal(theirs.inliers, ours.inliers)
    assert theirs.milliseconds > 0
    assert theirs.score is None


@pytest.mark.parametrize('peer', STATISTICAL)
def test_statistical_filters_agree_where_the_window_contains_the_nearest(peer):
    random = np.random.default_rng(4)
    rows, columns = np.mgrid[:60, :70]
    xyz = np.dstack([columns, rows, random.normal(0, 0.02, (60, 70))]).astype(np.float32)
    settings = StatisticalSettings(neighbours=3, std_factor=1.5)
    theirs, ours = peer(xyz, settings), statistical_filter(xyz, settings)
    # They sum in another order, so that a point at the threshold may lie on its other side.
    away = abs(ours.score - ours.threshold) > 1e-6
    np.testing.assert_array_equal(theirs.outliers[away], ours.outliers[away])


@pytest.mark.parametrize('peer', [*RADIUS, *STATISTICAL])
def test_points_that_are_not_measured_are_in_neither_mask(peer):
    xyz, _ = rough(40, 50)
    result = peer(xyz)
    np.testing.assert_array_equal(result.inliers | result.outliers, naive.measured(xyz))
    assert not (result.inliers & result.outliers).any()


def test_a_missing_peer_says_how_to_install_it(monkeypatch):
    xyz, _ = rough(10, 10)
    monkeypatch.setattr(peers.shutil, 'which', lambda _: None)
    monkeypatch.setattr(peers.importlib.util, 'find_spec', lambda _: None)
    with pytest.raises(SocialCircleError, match='pcl-tools'):
        peers.pcl_radius_filter(xyz)
    with pytest.raises(SocialCircleError, match='pip install open3d'):
        peers.open3d_statistical_filter(xyz)
