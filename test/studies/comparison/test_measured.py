# SPDX-License-Identifier: Apache-2.0
"""Measured clouds."""

import numpy as np
import pytest

from socialcircle_ros.studies.comparison.measured import with_z_scaled


def test_scaled_heights_differ_by_half_a_pitch_per_sigma():
    rows, columns = np.mgrid[:80, :90]
    heights = np.random.default_rng(1).normal(0, 1e-4, rows.shape)
    scaled = with_z_scaled(np.dstack([3.0 * columns, 3.0 * rows, heights]).astype(np.float32))
    assert np.diff(scaled[..., 2], axis=1).std() == pytest.approx(1.5, rel=0.05)
