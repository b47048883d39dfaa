# SPDX-License-Identifier: Apache-2.0
"""Each baseline against its slow reference, and what holds for all of them."""

import numpy as np
import pytest
from baselines.clouds import clouds, rough
from hypothesis import given
from hypothesis import strategies as st
from naive import baselines as naive

from socialcircle_ros.baselines import median_filter, radius_filter, statistical_filter, window_median
from socialcircle_ros.baselines.settings import MedianSettings, RadiusSettings, StatisticalSettings
from socialcircle_ros.errors import CloudError, SettingError

FILTERS = [radius_filter, statistical_filter, median_filter]


@given(clouds(), st.sampled_from([3, 5, 7]), st.sampled_from([0.5, 1.25, 2.5, 4.0]), st.integers(1, 8))
def test_radius_filter_is_exact(xyz, window, radius, min_neighbours):
    settings = RadiusSettings(window=window, radius=radius, min_neighbours=min_neighbours)
    result = radius_filter(xyz, settings)
    expected = naive.radius_outliers(xyz, window, radius, min_neighbours)
    np.testing.assert_array_equal(result.outliers, expected)
    np.testing.assert_array_equal(result.inliers, naive.measured(xyz) & ~expected)


@given(clouds(), st.sampled_from([(3, 1), (3, 8), (5, 1), (5, 7), (5, 24), (7, 20)]), st.sampled_from([0, 1.5]))
def test_statistical_filter_is_exact(xyz, window_and_count, std_factor):
    window, count = window_and_count
    result = statistical_filter(xyz, StatisticalSettings(window=window, neighbours=count, std_factor=std_factor))
    mean = naive.mean_distances(xyz, window, count)
    threshold = naive.statistical_threshold(mean, std_factor)
    np.testing.assert_array_equal(result.score, mean)
    assert result.threshold == threshold
    np.testing.assert_array_equal(result.outliers, mean > threshold)
    np.testing.assert_array_equal(result.inliers, mean <= threshold)


@given(clouds(), st.sampled_from([3, 5, 7, 9, 11, 13]))
def test_window_median_is_exact(xyz, window):
    np.testing.assert_array_equal(window_median(xyz, window), naive.window_median(xyz, window))


@pytest.mark.parametrize('window', range(3, 32, 2))
def test_window_median_takes_every_window(window):
    xyz, _ = rough(20, 37)
    np.testing.assert_array_equal(window_median(xyz, window), naive.window_median(xyz, window))


@pytest.mark.parametrize('dtype', [np.float32, np.float64])
def test_strips_join_without_a_seam(dtype):
    # Wider than two strips, so that windows reach from one strip into the next.
    xyz, _ = rough(9, 530, dtype)
    np.testing.assert_array_equal(window_median(xyz, 11), naive.window_median(xyz, 11))
    np.testing.assert_array_equal(statistical_filter(xyz).score, naive.mean_distances(xyz, 5, 20))
    result = radius_filter(xyz, RadiusSettings(radius=2.25))
    np.testing.assert_array_equal(result.outliers, naive.radius_outliers(xyz, 5, 2.25, 10))


@given(clouds(), st.floats(0.01, 5))
def test_median_filter_compares_the_residual(xyz, threshold):
    result = median_filter(xyz, MedianSettings(window=5, threshold=threshold))
    residual = np.abs(xyz[:, :, 2] - naive.window_median(xyz, 5))
    np.testing.assert_array_equal(result.score, residual)
    # As float64: beside an array of float32, NumPy would round the threshold.
    np.testing.assert_array_equal(result.outliers, residual.astype(np.float64) > threshold)


def test_median_threshold_follows_the_roughness():
    xyz, _ = rough(60, 80, np.float64)
    result = median_filter(xyz, MedianSettings(sigmas=4.0))
    # The residuals have a normal roughness of 0.2, to which the median window adds little.
    assert result.threshold == pytest.approx(4 * 0.2, rel=0.1)


def test_radius_default_is_that_of_a_flat_grid():
    rows, columns = np.mgrid[:20, :30] * 0.7
    xyz = np.dstack([columns, rows, 0 * rows])
    missing = radius_filter(xyz).score
    assert missing[10, 10] == 4  # the corners of the window
    assert not radius_filter(xyz).outliers[2:-2, 2:-2].any()


@pytest.mark.parametrize('remove', FILTERS)
def test_spikes_are_found_and_the_surface_is_kept(remove):
    xyz, spikes = rough(80, 300)
    result = remove(xyz)
    assert result.outliers[spikes].mean() > 0.95
    assert result.outliers[~spikes].mean() < 0.05


@pytest.mark.parametrize('remove', FILTERS)
@given(xyz=clouds(most=8))
def test_masks_and_score_agree(remove, xyz):
    settings = {radius_filter: RadiusSettings(radius=2.0)}.get(remove)
    result = remove(xyz, settings)
    measured = naive.measured(xyz)
    np.testing.assert_array_equal(result.inliers | result.outliers, measured)
    assert not (result.inliers & result.outliers).any()
    np.testing.assert_array_equal(np.isnan(result.score), ~measured)
    np.testing.assert_array_equal(result.outliers, result.score > result.threshold)
    assert result.score.dtype == xyz.dtype


@pytest.mark.parametrize('remove', FILTERS)
def test_the_cloud_is_not_changed(remove):
    xyz, _ = rough(30, 40)
    before = xyz.tobytes()
    remove(xyz)
    assert xyz.tobytes() == before


@pytest.mark.parametrize('remove', [statistical_filter, median_filter])
def test_nothing_measured_gives_empty_masks(remove):
    result = remove(np.full((7, 9, 3), np.nan, np.float32))
    assert not result.inliers.any()
    assert not result.outliers.any()


def test_a_point_without_neighbours_is_an_outlier():
    xyz, _ = rough(30, 40)
    xyz[5:14, 5:14] = np.nan
    xyz[9, 9] = 9, 9, 0
    assert radius_filter(xyz).outliers[9, 9]
    assert statistical_filter(xyz).outliers[9, 9]
    assert np.isinf(statistical_filter(xyz).score[9, 9])


@pytest.mark.parametrize('remove', FILTERS)
def test_a_wrong_shape_is_refused(remove):
    with pytest.raises(CloudError, match=r'shape \(rows, columns, 3\)'):
        remove(np.zeros((4, 5)))


def test_radius_needs_a_pitch():
    with pytest.raises(CloudError, match='set radius'):
        radius_filter(np.full((7, 9, 3), np.nan, np.float32))


def test_settings_refuse_what_a_window_cannot_hold():
    with pytest.raises(SettingError, match=r'min_neighbours is 9.*at most 8'):
        RadiusSettings(window=3, min_neighbours=9)
    with pytest.raises(SettingError, match=r'neighbours is 25.*at most 24'):
        StatisticalSettings(window=5, neighbours=25)
    with pytest.raises(SettingError, match='radius must be above 0'):
        RadiusSettings(radius=0)
    with pytest.raises(SettingError, match='threshold must be above 0'):
        MedianSettings(threshold=0)


@pytest.mark.parametrize('window', [0, -1, 2, 4, 3.0, '3', None, True, np.timedelta64(3)])
def test_a_median_window_that_is_not_odd_is_refused(window):
    with pytest.raises(SettingError, match='The window must be an odd number of points'):
        window_median(np.zeros((5, 6, 3)), window)


def test_a_median_window_may_be_a_number_of_numpy():
    heights = np.dstack([*np.meshgrid(np.arange(6.0), np.arange(5.0)), np.arange(30.0).reshape(5, 6)])
    np.testing.assert_array_equal(window_median(heights, np.int64(3)), window_median(heights, 3))
