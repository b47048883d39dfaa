# SPDX-License-Identifier: Apache-2.0
"""What callers hand over."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros import CircleSettings, RepairSettings, make_report, remove_outliers, repair_holes, run_batch
from socialcircle_ros.arguments import settings_of, settings_or_default, several
from socialcircle_ros.baselines import median_filter, radius_filter, statistical_filter
from socialcircle_ros.errors import SettingError
from socialcircle_ros.pipeline.clouds import filter_cloud
from socialcircle_ros.recording.export import filter_to_file
from socialcircle_ros.recording.offline import filter_recording, measure_recording
from socialcircle_ros.teaching.clouds import read_good_clouds
from socialcircle_ros.teaching.teach import teach

PARTS = Path(__file__).parents[1] / 'bags' / 'parts.mcap'

names = st.text() | st.text(st.characters(exclude_categories=['Cs', 'Cc'])).map(Path)


@given(names)
def test_a_single_name_is_a_list_of_one(name):
    assert several(name) == (name,) == several([name])


@given(st.lists(names))
def test_several_names_stay_as_they_are(given_names):
    assert several(given_names) == several(iter(given_names)) == tuple(given_names)


def test_nothing_is_no_name():
    assert several(None) == several(()) == ()


def test_what_is_no_name_is_refused():
    with pytest.raises(SettingError, match='A name or several names must be given, not 5'):
        several(5)
    with pytest.raises(SettingError, match=r"A name or several names must be given, not b'a\.npz'"):
        several(b'a.npz')


@pytest.mark.parametrize('found', ['paper', 0, {}, CircleSettings, RepairSettings(), np.zeros((40, 50, 3))])
def test_settings_of_another_class_are_refused_with_the_one_that_is_wanted(found):
    for check in (settings_of, settings_or_default):
        with pytest.raises(SettingError, match=r'The settings must be a CircleSettings\(\.\.\.\),') as refusal:
            check(CircleSettings, found)
        assert '\n' not in str(refusal.value)


def test_none_stands_for_the_defaults_where_there_are_any():
    assert settings_or_default(CircleSettings, None) == CircleSettings()
    with pytest.raises(SettingError, match='not None'):
        settings_of(CircleSettings, None)


XYZ = np.dstack([*np.meshgrid(np.arange(6.0), np.arange(5.0)), np.zeros((5, 6))])


@pytest.mark.parametrize(
    ('call', 'wanted'),
    [
        (lambda path: remove_outliers(XYZ, 'paper'), 'CircleSettings'),
        (lambda path: remove_outliers(XYZ, 0), 'CircleSettings'),
        (lambda path: repair_holes(XYZ, np.zeros((5, 6), bool), 'x'), 'RepairSettings'),
        (lambda path: radius_filter(XYZ, 0), 'RadiusSettings'),
        (lambda path: statistical_filter(XYZ, 0), 'StatisticalSettings'),
        (lambda path: median_filter(XYZ, 0), 'MedianSettings'),
        (lambda path: filter_recording(PARTS, path, CircleSettings()), 'PipelineSettings'),
        (lambda path: filter_recording(PARTS, path, None), 'PipelineSettings'),
        (lambda path: measure_recording(PARTS, CircleSettings(), print), 'PipelineSettings'),
        (lambda path: filter_to_file(PARTS, path.with_suffix('.npz'), CircleSettings()), 'PipelineSettings'),
        (lambda path: make_report(PARTS, path.with_suffix('.html'), CircleSettings()), 'PipelineSettings'),
        (lambda path: run_batch(PARTS, path, CircleSettings()), 'PipelineSettings'),
        (lambda path: read_good_clouds(PARTS, CircleSettings()), 'PipelineSettings'),
        (lambda path: teach([], settings='rules'), 'CircleSettings'),
        (lambda path: filter_cloud(b'', CircleSettings()), 'PipelineSettings'),
    ],
)
def test_every_public_function_checks_its_settings(tmp_path, call, wanted):
    with pytest.raises(SettingError, match=rf'The settings must be a {wanted}\(\.\.\.\), not '):
        call(tmp_path / 'out.mcap')
    assert not list(tmp_path.iterdir())
