# SPDX-License-Identifier: Apache-2.0
"""Numbers that stand for not measured."""

from dataclasses import astuple

import numpy as np
import pytest

from socialcircle_ros import CircleSettings, remove_outliers
from socialcircle_ros.circle.not_measured import recognise
from socialcircle_ros.errors import NoRadiusError, NoSeedError, SettingError

ROWS, COLUMNS = 120, 160


def surface(kind=np.float32, offset=0.5, seed=0):
    """A rough plane at a distance from the sensor, in m."""
    y, x = np.mgrid[:ROWS, :COLUMNS].astype(float) * 1e-4
    z = offset + np.random.default_rng(seed).normal(0, 1e-5, (ROWS, COLUMNS))
    return np.dstack([x + 0.01, y + 0.01, z]).astype(kind)


MARKS = {
    'the origin': (0.0, 0.0, 0.0),
    'a constant point': (-1.0, -1.0, -1.0),
    'height zero': (None, None, 0.0),
    'a height far below': (None, None, -9999.0),
    'a height far above': (None, None, 1e6),
}


def marked(mark, share, **options):
    xyz = surface(**options)
    points = np.zeros((ROWS, COLUMNS), bool)
    points[:, : round(share * COLUMNS)] = True
    for axis, value in enumerate(mark):
        if value is not None:
            xyz[points, axis] = value
    return xyz, points


@pytest.mark.parametrize('mode', ['paper', 'adaptive'])
@pytest.mark.parametrize('kind', [np.float32, np.float64])
@pytest.mark.parametrize('mark', MARKS.values(), ids=MARKS)
@pytest.mark.parametrize('share', [0.05, 0.4])
def test_marked_points_count_as_not_measured(mode, kind, mark, share):
    xyz, points = marked(mark, share, kind=kind)
    with_nan = np.where(points[..., None], np.nan, xyz).astype(kind)
    result, expected = (remove_outliers(cloud, CircleSettings(mode=mode)) for cloud in (xyz, with_nan))
    np.testing.assert_array_equal(result.inliers, expected.inliers)
    np.testing.assert_array_equal(result.outliers, expected.outliers)
    assert (result.seed, result.radius) == (expected.seed, expected.radius)
    assert f'{np.count_nonzero(points)} points' in result.notes[0]
    assert not expected.notes


def test_the_input_is_not_altered():
    xyz, _ = marked(MARKS['the origin'], 0.3)
    before = xyz.tobytes()
    remove_outliers(xyz)
    assert xyz.tobytes() == before


def test_most_of_a_cloud_may_be_at_the_origin():
    xyz, points = marked(MARKS['the origin'], 0.9)
    np.testing.assert_array_equal(recognise(xyz, 'auto').points, points)


@pytest.mark.parametrize('mark', MARKS.values(), ids=MARKS)
def test_nan_switches_the_recognition_off(mark):
    xyz, _ = marked(mark, 0.3)
    assert astuple(recognise(xyz, 'nan')) == (None, '', '')


def test_a_number_names_the_height():
    xyz = surface(offset=0.0)
    xyz[:10, :10, 2] = 7e-6  # within the surface, so it is not recognised by itself
    assert recognise(xyz, 'auto').points is None
    assert np.count_nonzero(recognise(xyz, '7e-06').points) == 100


def test_a_quantised_surface_is_measured_and_a_far_height_in_it_is_doubtful():
    xyz = surface()
    xyz[..., 2] = np.round(xyz[..., 2] / 5e-6) * 5e-6
    assert astuple(recognise(xyz, 'auto')) == (None, '', '')
    xyz[:, :30, 2] = 0
    found = recognise(xyz, 'auto')
    assert found.points is None
    assert "set circle.not_measured to '0'" in found.doubt
    assert any('exactly the height 0' in warning for warning in remove_outliers(xyz).warnings)


@pytest.mark.parametrize('height', [0.0, -3.5])
def test_an_ideal_plane_with_spikes_is_measured(height):
    xyz = surface()
    xyz[..., 2] = height
    spikes = np.random.default_rng(0).random((ROWS, COLUMNS)) < 0.05
    xyz[spikes, 2] += np.random.default_rng(1).random(np.count_nonzero(spikes)) + 1
    assert recognise(xyz, 'auto').points is None


def test_a_flat_cluster_of_outliers_is_measured():
    xyz = surface(offset=0.0)
    xyz[20:35, 30:50, 2] = 8e-4  # 1.6 % of the points, 20 times as high as the surface is rough
    assert astuple(recognise(xyz, 'auto')) == (None, '', '')
    assert remove_outliers(xyz, CircleSettings(judge='rules')).outliers[20:35, 30:50].all()


def test_a_large_flat_part_that_stands_apart_is_doubtful():
    xyz = surface(offset=0.0)
    xyz[:, :40, 2] = 8e-4
    found = recognise(xyz, 'auto')
    assert found.points is None
    assert 'exactly the height 0.0008' in found.doubt


def test_few_equal_points_are_measured():
    xyz = surface()
    xyz[0, :20] = 0
    assert astuple(recognise(xyz, 'auto')) == (None, '', '')


@pytest.mark.parametrize('mode', ['paper', 'adaptive'])
def test_a_cloud_of_zeros_is_refused_and_the_mark_is_named(mode):
    with pytest.raises(NoSeedError, match='No point of the cloud is measured') as refusal:
        remove_outliers(np.zeros((ROWS, COLUMNS, 3)), CircleSettings(mode=mode))
    assert str(refusal.value).endswith(
        f'counts as not measured. {ROWS * COLUMNS} points are exactly at (0, 0, 0) and count as not measured; set'
        " circle.not_measured to 'nan' if they are measured."
    )


def test_a_refusal_without_a_mark_names_none():
    with pytest.raises(NoSeedError, match='counts as not measured.$'):
        remove_outliers(np.full((ROWS, COLUMNS, 3), np.nan))


def test_radius_zero_is_refused_with_what_to_do():
    xyz = surface()
    xyz[:, :60] = 0
    settings = CircleSettings(mode='paper', not_measured='nan', vote_region=(0, 0, 60, 50))
    with pytest.raises(NoRadiusError, match='the radius 0.*circle.not_measured'):
        remove_outliers(xyz, settings)


@pytest.mark.parametrize('text', ['', 'zero', 'inf', 'NaN'])
def test_another_rule_is_refused(text):
    with pytest.raises(SettingError, match="use 'auto', 'nan', or the height"):
        CircleSettings(not_measured=text)


@pytest.mark.filterwarnings('error::RuntimeWarning')
@pytest.mark.parametrize('kind', [np.float32, np.float64])
def test_a_height_that_the_data_type_does_not_hold_is_that_of_no_point(kind):
    xyz = surface(kind)
    xyz[0, 0, 2] = np.inf
    assert astuple(recognise(xyz, '1e300')) == (None, '', '')
