# SPDX-License-Identifier: Apache-2.0
"""Labelled clouds."""

import numpy as np

from socialcircle_ros.studies.comparison.labelled_clouds import NOT_MEASURED, other_seeds, synthetic_cloud


def test_a_synthetic_cloud_lacks_seven_points_which_are_not_counted():
    cloud = synthetic_cloud('metal_groove', (96, 128), 1)
    missing = ~np.isfinite(cloud.points[..., 2])
    assert missing.sum() == NOT_MEASURED
    assert not (missing & (cloud.counted | cloud.outlier)).any()


def test_search_seeds_are_never_those_of_the_scores():
    assert not {3, 1, 7} & set(other_seeds((3, 1, 7), 2))
