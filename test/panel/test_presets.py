# SPDX-License-Identifier: Apache-2.0
"""Presets: files that are read back unchanged, and from which a node can start."""

import contextlib
import os
from pathlib import Path

import pytest
import yaml

from socialcircle_ros.errors import SettingError, SocialCircleError
from socialcircle_ros.panel.presets import Presets, default_folder
from socialcircle_ros.settings import OF_CELL, PARAMETERS, yaml_text


def test_a_saved_preset_is_loaded_unchanged(tmp_path):
    presets = Presets(tmp_path / 'new' / 'folder')
    assert presets.names() == []
    values = {name: row.default for name, row in PARAMETERS.items()} | {'circle.radius': 1e-6}
    path = presets.save('groove fine', values)
    assert presets.names() == ['groove fine']
    assert presets.load('groove fine') == {name: values[name] for name in values if name not in OF_CELL}
    assert yaml.safe_load(path.read_text())['/**']['ros__parameters']['circle.window'] == 3


def test_which_cell_a_node_is_and_where_its_files_go_is_neither_saved_nor_loaded(tmp_path):
    of_cell = {'measurements.cell': 'line A', 'measurements.part': 'P7', 'parameters_file': '/a.yaml'}
    presets = Presets(tmp_path)
    assert not any(name in presets.save('a', {'circle.window': 5, **of_cell}).read_text() for name in of_cell)
    old = yaml_text({'circle.window': 7, **of_cell}, whole=False)
    (tmp_path / 'old.yaml').write_text(old + '/cell/social_circle: {ros__parameters: {use_sim_time: true}}\n')
    assert presets.load('old') == {'circle.window': 7}


def test_saving_again_replaces_the_preset(tmp_path):
    presets = Presets(tmp_path)
    presets.save('a', {'circle.window': 3})
    presets.save('a', {'circle.window': 5})
    assert presets.load('a') == {'circle.window': 5}


@pytest.mark.parametrize('name', ['', '../a', 'a/b', '.hidden', ' a', 'x' * 101, 'a\nb'])
def test_a_name_that_is_not_suitable_for_a_file_is_refused(tmp_path, name):
    with pytest.raises(SettingError, match='cannot be the name of a preset'):
        Presets(tmp_path).save(name, {'circle.window': 3})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize('place', ['a.yaml', 'a.yaml.partial', '.partial'])
def test_saving_writes_to_no_file_that_a_link_or_a_pipe_in_the_folder_leads_to(tmp_path, place):
    folder, private = tmp_path / 'presets', tmp_path / 'private'
    folder.mkdir()
    private.write_text('mine')
    (folder / place).symlink_to(private)
    with contextlib.suppress(SocialCircleError):  # a link under the preset's own name is refused
        Presets(folder).save('a', {'circle.window': 5})
    (folder / place).unlink()
    os.mkfifo(folder / place)
    with contextlib.suppress(SocialCircleError):
        Presets(folder).save('a', {'circle.window': 7})
    (folder / place).unlink(missing_ok=True)
    Presets(folder).save('a', {'circle.window': 9})
    assert private.read_text() == 'mine'
    assert Presets(folder).load('a') == {'circle.window': 9}


def test_a_save_that_fails_leaves_nothing_behind(tmp_path):
    (tmp_path / 'a.yaml').mkdir()
    with pytest.raises(SocialCircleError, match='is a directory, and is not overwritten'):
        Presets(tmp_path).save('a', {'circle.window': 3})
    assert [path.name for path in tmp_path.iterdir()] == ['a.yaml']


def test_what_is_no_regular_file_is_not_read(tmp_path):
    os.mkfifo(tmp_path / 'a.yaml')
    assert Presets(tmp_path).names() == []
    with pytest.raises(SocialCircleError, match='not a regular file'):
        Presets(tmp_path).load('a')


def test_files_with_names_that_no_preset_can_have_are_not_offered(tmp_path):
    Presets(tmp_path).save('a', {'circle.window': 3})
    for name in (b'\xff\xfe', b'.hidden', b'a\nb', b'b' * 150):
        Path(os.fsdecode(os.fsencode(tmp_path) + b'/' + name + b'.yaml')).write_text('')
    assert Presets(tmp_path).names() == ['a']


def test_a_missing_preset_is_reported(tmp_path):
    with pytest.raises(SocialCircleError, match=r'nowhere\.yaml cannot be read'):
        Presets(tmp_path).load('nowhere')


def test_a_folder_that_cannot_be_created_is_reported(tmp_path):
    (tmp_path / 'file').write_text('')
    with pytest.raises(SocialCircleError, match='cannot be written'):
        Presets(tmp_path / 'file').save('a', {'circle.window': 3})


def test_a_preset_is_not_written_through_a_link(tmp_path):
    (tmp_path / 'presets').mkdir()
    (tmp_path / 'profile').write_text('old')
    (tmp_path / 'presets' / 'a.yaml').symlink_to(tmp_path / 'profile')
    with pytest.raises(SocialCircleError, match=r'a\.yaml is a symbolic link, and is not overwritten'):
        Presets(tmp_path / 'presets').save('a', {'circle.window': 3})
    assert (tmp_path / 'profile').read_text() == 'old'


def test_the_default_folder_is_beside_the_files_that_the_node_saves(monkeypatch, tmp_path):
    monkeypatch.setenv('ROS_HOME', str(tmp_path))
    assert default_folder() == tmp_path / 'socialcircle' / 'presets'
