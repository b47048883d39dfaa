# SPDX-License-Identifier: Apache-2.0
"""The search for the best settings."""

from dataclasses import replace

import numpy as np
import pytest

from socialcircle_ros.baselines.settings import MedianSettings, RadiusSettings, StatisticalSettings
from socialcircle_ros.studies.comparison.labelled_clouds import synthetic_cloud
from socialcircle_ros.studies.comparison.methods import SETTINGS_TYPES, method
from socialcircle_ros.studies.comparison.search import best_settings

SIZE = (96, 128)


@pytest.fixture(scope='module')
def clouds():
    return [synthetic_cloud('metal_groove', SIZE, seed) for seed in (1, 2)]


def mean_f1(settings, clouds):
    return np.mean([cloud.score(method(settings, '')(cloud.points).outliers).f1 for cloud in clouds])


@pytest.mark.parametrize('settings_type', SETTINGS_TYPES)
def test_the_settings_found_are_at_least_as_good_as_the_default(settings_type, clouds):
    assert mean_f1(best_settings(settings_type, clouds), clouds) >= mean_f1(settings_type(), clouds)


@pytest.mark.parametrize(
    ('settings_type', 'steps'),
    [
        (RadiusSettings, {'min_neighbours': (-1, 1)}),
        (StatisticalSettings, {'std_factor': (-0.3, 0.3)}),
        (MedianSettings, {'threshold': (-0.5, 0.5)}),
    ],
)
def test_no_neighbouring_setting_is_better(settings_type, steps, clouds):
    best = best_settings(settings_type, clouds)
    reached = mean_f1(best, clouds)
    for name, changes in steps.items():
        for change in changes:
            changed = replace(best, **{name: getattr(best, name) + change})
            assert mean_f1(changed, clouds) <= reached + 0.01
