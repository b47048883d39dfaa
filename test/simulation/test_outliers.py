# SPDX-License-Identifier: Apache-2.0
"""Outliers have the requested number, size and place, and their truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from socialcircle_ros.errors import CloudError, SettingError
from socialcircle_ros.simulation.outliers import Contamination, add_outliers

FLAT = np.zeros((120, 160))


@pytest.mark.parametrize('share', [0.0, 0.01, 0.1, 0.45])
@pytest.mark.parametrize('flank', ['sharp', 'blurred', 'mixed'])
def test_share_is_met_exactly(share, flank):
    result = add_outliers(FLAT, Contamination(share=share, flank=flank), 0)
    assert result.outlier.sum() == round(share * FLAT.size)


def test_same_seed_gives_the_same_bytes():
    first, again = (add_outliers(FLAT, Contamination(), 7) for _ in range(2))
    assert first.heights.tobytes() == again.heights.tobytes()
    assert first.cluster.tobytes() == again.cluster.tobytes()
    assert add_outliers(FLAT, Contamination(), 8).heights.tobytes() != first.heights.tobytes()


def test_half_of_the_outliers_are_in_clusters_of_several_points():
    result = add_outliers(FLAT, Contamination(share=0.1, clustered=0.5), 0)
    assert (result.outlier & (result.cluster > 0)).sum() == round(0.05 * FLAT.size)
    sizes = np.bincount(result.cluster[result.cluster > 0])[1:]
    assert sizes.min() >= 1
    assert np.median(sizes) >= 10


def test_points_of_a_cluster_are_displaced_together():
    result = add_outliers(FLAT, Contamination(share=0.1, flank='sharp', clustered=1.0), 0)
    for number in range(1, result.cluster.max() + 1):
        moved = result.displacement[result.cluster == number]
        assert np.ptp(moved) <= 0.25 * np.abs(moved).max()


def test_displacements_are_known():
    result = add_outliers(FLAT, Contamination(unit=0.5, bound=4.0, flank='blurred'), 0)
    np.testing.assert_array_equal(result.heights, result.displacement)
    np.testing.assert_array_equal(result.outlier, np.abs(result.displacement) >= 2.0)
    np.testing.assert_array_equal(result.cluster != 0, result.displacement != 0)
    assert result.ambiguous.any()
    assert not (result.ambiguous & result.outlier).any()


def test_sharp_clusters_have_no_ambiguous_points():
    assert not add_outliers(FLAT, Contamination(flank='sharp'), 0).ambiguous.any()


def test_outliers_are_where_the_weight_is():
    weight = np.where(np.arange(160) < 80, 9.0, 1.0) * np.ones_like(FLAT)
    result = add_outliers(FLAT, Contamination(share=0.05), 0, weight)
    assert result.outlier[:, :80].sum() > 5 * result.outlier[:, 80:].sum()
    nowhere = np.where(np.arange(160) < 80, 1.0, 0.0) * np.ones_like(FLAT)
    assert not add_outliers(FLAT, Contamination(), 0, nowhere).outlier[:, 80:].any()


def test_share_of_an_area_is_limited():
    weight = np.where(np.arange(160) < 40, 50.0, 1.0) * np.ones_like(FLAT)
    result = add_outliers(FLAT, Contamination(share=0.3, densest=0.6), 0, weight)
    assert 0.45 < result.outlier[:, :36].mean() < 0.61
    assert result.outlier.mean() == pytest.approx(0.3, abs=1e-4)


def test_points_that_are_not_measured_stay_so():
    holes = FLAT.copy()
    holes[::3] = np.nan
    result = add_outliers(holes, Contamination(share=0.1), 0)
    np.testing.assert_array_equal(np.isnan(result.heights), np.isnan(holes))
    assert result.outlier.sum() == round(0.1 * np.isfinite(holes).sum())


def test_more_outliers_than_points_with_a_weight_are_refused():
    weight = np.zeros_like(FLAT)
    weight[0, :5] = 1.0
    with pytest.raises(CloudError, match='only 5 have a weight'):
        add_outliers(FLAT, Contamination(), 0, weight)


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'share': 1.0}, 'share of outliers is 1.0'),
        ({'densest': 0.0}, 'densest share is 0.0'),
        ({'clustered': 1.5}, 'clustered share is 1.5'),
        ({'amplitude': (3.0, 9.0)}, 'both above the bound'),
        ({'radius': (4.0, 2.0)}, 'cluster radii are'),
    ],
)
def test_values_out_of_range_are_refused(change, message):
    with pytest.raises(SettingError, match=message):
        replace(Contamination(), **change)
