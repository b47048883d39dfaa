# SPDX-License-Identifier: Apache-2.0
"""The compared filters."""

from socialcircle_ros.baselines.settings import MedianSettings
from socialcircle_ros.settings import CircleSettings
from socialcircle_ros.studies.comparison.methods import describe


def test_the_description_of_settings_leaves_out_those_that_the_filter_determines():
    assert describe(CircleSettings()) == 'window 3, radius_scale 1'
    assert describe(MedianSettings(threshold=2.5)) == 'window 11, threshold 2.5'
