# SPDX-License-Identifier: Apache-2.0
"""What callers hand over."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros import (
    CircleSettings,
    RepairSettings,
    make_report,
    remove_outliers,
    repair_holes,
    run_batch,
    run_sweep,
)
from socialcircle_ros.arguments import check_count, settings_of, settings_or_default, several
from socialcircle_ros.baselines import median_filter, radius_filter, statistical_filter
from socialcircle_ros.errors import SettingError
from socialcircle_ros.pipeline.clouds import filter_cloud
from socialcircle_ros.recording.export import filter_to_file
from socialcircle_ros.recording.offline import filter_recording, measure_recording
from socialcircle_ros.sweep.search_space import Choice
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


@pytest.mark.parametrize('given', [0, -1, 1.5, '5', None, True, np.float64(2)])
def test_what_is_no_count_is_refused(given):
    with pytest.raises(SettingError, match='search must be a whole number above 0, not '):
        check_count('search', given)


def test_whole_numbers_above_0_are_counts():
    check_count('search', 1)
    check_count('search', np.uint8(200))


CHOICE = Choice('circle.window', [3, 5])


@pytest.mark.parametrize(
    ('wrong', 'sentence'),
    [
        (
            {'search_space': CHOICE},
            r'The search space must be a list of Choice\(...\) and Range\(...\), not Choice',
        ),
        ({'search_space': 'circle.window=3,5'}, "The search space must be a list .*, not 'circle.window=3,5'"),
        ({'search_space': ['circle.window=3,5']}, 'The search space must be a list of Choice'),
        ({'search_space': {'circle.window': [3, 5]}}, 'The search space must be a list of Choice'),
        ({'search_space': None}, 'The search space must be a list .*, not None'),
        ({'search_space': iter([CHOICE])}, 'The search space must be a list of Choice'),
        ({'search': '5'}, "search must be a whole number above 0, not '5'"),
        ({'max_clouds': 0}, 'max_clouds must be a whole number above 0, not 0'),
        ({'parameters': CircleSettings()}, 'parameters must be a mapping, .*, not CircleSettings'),
        ({'parameters': []}, r'parameters must be a mapping, .*, not \[\]'),
    ],
)
def test_a_wrong_argument_of_a_sweep_is_one_sentence(wrong, sentence, tmp_path):
    with pytest.raises(SettingError, match=sentence):
        run_sweep(**{'recording': PARTS, 'search_space': [CHOICE], 'output': tmp_path / 'sweep'} | wrong)
    assert not list(tmp_path.iterdir())


def test_a_wrong_number_of_processes_is_refused(tmp_path):
    with pytest.raises(SettingError, match="workers must be a whole number above 0, not '2'"):
        run_batch(PARTS, tmp_path / 'night', workers='2')
