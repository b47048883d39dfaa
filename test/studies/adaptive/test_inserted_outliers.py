# SPDX-License-Identifier: Apache-2.0
"""Measured surfaces with inserted outliers."""

import numpy as np
import pytest

from socialcircle_ros.studies.adaptive.inserted_outliers import insert_outliers, measured_surface
from socialcircle_ros.studies.comparison.measured import MeasuredCloud

NOISE = 0.3


@pytest.fixture
def cloud():
    rows, columns = np.mgrid[:120, :140].astype(np.float64)
    heights = 0.05 * columns + np.random.default_rng(3).normal(0, NOISE, rows.shape)
    heights[20:23, 50:53] += 40.0
    heights[70, 80] = np.nan
    return MeasuredCloud('plate', np.dstack([columns, rows, heights]).astype(np.float32), 'µm')


def test_the_noise_of_the_surface_is_found(cloud):
    assert measured_surface(cloud).noise == pytest.approx(NOISE, rel=0.1)


def test_spikes_are_not_plausible(cloud):
    surface = measured_surface(cloud)
    assert surface.spikes[20:23, 50:53].all()
    assert surface.spikes.sum() == 9
    assert np.array_equal(surface.plausible | surface.spikes, np.isfinite(cloud.points[..., 2]))


def test_the_noise_of_a_smooth_surface_is_its_standard_deviation(cloud):
    cloud.points[..., 2] = 0.0
    cloud.points[40, 60, 2] = 5.0
    assert measured_surface(cloud).noise == pytest.approx(cloud.points[..., 2].std(), rel=0.01)


@pytest.mark.parametrize('share', [0.01, 0.3])
def test_the_requested_share_of_outliers_is_inserted_far_off_the_surface(cloud, share):
    surface = measured_surface(cloud)
    contaminated = insert_outliers(surface, share, 5)
    assert contaminated.outlier.sum() == round(share * np.isfinite(cloud.points[..., 2]).sum())
    moved = np.abs(contaminated.points[..., 2] - cloud.points[..., 2])
    assert moved[contaminated.outlier].min() > 3.9 * surface.noise
    assert (moved[contaminated.counted & ~contaminated.outlier] == 0).all()


def test_spikes_of_the_measurement_are_not_counted(cloud):
    surface = measured_surface(cloud)
    contaminated = insert_outliers(surface, 0.05, 5)
    assert not (contaminated.counted & surface.spikes & ~contaminated.outlier).any()


def test_the_tuned_median_finds_isolated_outliers(cloud):
    assert insert_outliers(measured_surface(cloud), 0.01, 5).best_median_f1() > 0.7
