# SPDX-License-Identifier: Apache-2.0
"""Large, irregular and blurred outliers."""

import numpy as np
import pytest

from socialcircle_ros.studies.adaptive.irregular_outliers import add_irregular_outliers

UNIT = 0.3


@pytest.fixture
def heights():
    heights = np.random.default_rng(3).normal(-50, UNIT, (160, 210))
    heights[30:50, 60:80] = np.nan
    return heights


@pytest.mark.parametrize('share', [0.0, 0.02, 0.15])
def test_the_share_of_outliers_is_met_but_for_the_last_patch(heights, share):
    made = add_irregular_outliers(heights, share, UNIT, 4)
    number, wanted = made.outlier.sum(), round(share * np.isfinite(heights).sum())
    assert wanted <= number <= wanted + 2000 * (share > 0)


def test_outliers_are_displaced_measured_points_of_at_least_four_sigma(heights):
    made = add_irregular_outliers(heights, 0.1, UNIT, 5)
    np.testing.assert_array_equal(np.isnan(made.heights), np.isnan(heights))
    moved = np.abs(made.heights - heights)
    measured = np.isfinite(heights)
    np.testing.assert_array_equal(made.outlier[measured], (np.abs(made.displacement) >= 4 * UNIT)[measured])
    assert not made.outlier[~measured].any()
    assert (moved[made.outlier] > 3.9 * UNIT).all()
    assert (moved[measured & (made.cluster == 0)] == 0).all()


def test_patches_are_large_and_some_are_blurred(heights):
    made = add_irregular_outliers(heights, 0.3, UNIT, 6)
    sizes = np.bincount(made.cluster[made.outlier & (made.cluster > 0)])
    assert sizes.max() > 320
    assert made.ambiguous.any()
    assert (made.cluster == -1).any()


def test_the_same_seed_gives_the_same_outliers(heights):
    one, other = (add_irregular_outliers(heights, 0.05, UNIT, 7) for _ in range(2))
    np.testing.assert_array_equal(one.heights, other.heights)
