"""Measured surfaces as surfaces of outliers."""

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


def test_the_unit_is_the_noise_of_the_surface(cloud):
    assert measured_surface(cloud).unit == pytest.approx(NOISE, rel=0.1)


def test_what_stands_out_is_not_plausible(cloud):
    bare = measured_surface(cloud)
    assert bare.spikes[20:23, 50:53].all()
    assert bare.spikes.sum() == 9
    assert np.array_equal(bare.plausible | bare.spikes, np.isfinite(cloud.points[..., 2]))


def test_a_surface_without_noise_counts_in_its_standard_deviation(cloud):
    cloud.points[..., 2] = 0.0
    cloud.points[40, 60, 2] = 5.0
    assert measured_surface(cloud).unit == pytest.approx(cloud.points[..., 2].std(), rel=0.01)


@pytest.mark.parametrize('share', [0.01, 0.3])
def test_as_many_outliers_are_put_in_as_asked_and_each_is_far_off(cloud, share):
    bare = measured_surface(cloud)
    contaminated = insert_outliers(bare, share, 5)
    assert contaminated.outlier.sum() == round(share * np.isfinite(cloud.points[..., 2]).sum())
    moved = np.abs(contaminated.points[..., 2] - cloud.points[..., 2])
    assert moved[contaminated.outlier].min() > 3.9 * bare.unit
    assert (moved[contaminated.counted & ~contaminated.outlier] == 0).all()


def test_what_was_wrong_before_does_not_count(cloud):
    bare = measured_surface(cloud)
    contaminated = insert_outliers(bare, 0.05, 5)
    assert not (contaminated.counted & bare.spikes & ~contaminated.outlier).any()


def test_the_tuned_median_does_well_on_outliers_that_stand_alone(cloud):
    assert insert_outliers(measured_surface(cloud), 0.01, 5).best_median() > 0.7
