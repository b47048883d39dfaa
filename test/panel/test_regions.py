# SPDX-License-Identifier: Apache-2.0
"""A region of interest in numbers."""

import math

import numpy as np
import pytest
from panel.test_view import masked, view

from socialcircle_ros.metrics.areal import texture
from socialcircle_ros.panel.regions import region_numbers
from socialcircle_ros.settings import LimitSettings

ROWS, COLUMNS = 7, 9


@pytest.fixture
def drawing():
    """A rough plane with one gap, and two outliers of which one is in the region of the tests."""
    y, x = np.mgrid[:ROWS, :COLUMNS].astype(np.float64)
    z = 1e-6 * np.random.default_rng(0).normal(size=x.shape) - 3e-6 * x
    z[2, 3], z[3, 4], z[0, 0] = np.nan, 1e-3, -1e-3
    xyz = np.dstack([2e-6 * x, 5e-6 * y, z])
    mask = masked(xyz, [(3, 4), (0, 0)])
    return view(xyz, mask).drawing


def test_a_region_is_measured_as_a_cloud_of_its_own(drawing):
    found = region_numbers(drawing, (1, 2, 4, 5), LimitSettings())
    part = drawing.xyz[1:5, 2:7, 2].astype(np.float64)
    assert (found.points, found.measured, found.kept, found.outliers) == (20, 19, 18, 1)
    assert found.texture_measured == texture(part)
    part[2, 2] = np.nan
    assert found.texture_kept == texture(part)
    assert found.texture_measured.sz > 100 * found.texture_kept.sz
    assert found.verdict is None


def test_a_region_passes_the_limits_or_says_why_not(drawing):
    assert region_numbers(drawing, (1, 2, 4, 5), LimitSettings(outlier_share_max=0.1)).verdict.passed
    failed = region_numbers(drawing, (2, 3, 2, 2), LimitSettings(outlier_share_max=0.1)).verdict
    assert failed.reasons() == ('33.33 % of the measured points are outliers, more than 10 %.',)


def test_a_region_without_a_point_has_no_texture(drawing):
    found = region_numbers(drawing, (2, 3, 1, 1), LimitSettings())
    assert (found.points, found.measured, found.outliers) == (1, 0, 0)
    assert math.isnan(found.texture_kept.sa)
