# SPDX-License-Identifier: Apache-2.0
"""Locations: paths and URLs."""

import pytest

from socialcircle_ros.storage import is_below, real_location


def test_a_path_has_one_spelling(tmp_path, monkeypatch):
    (tmp_path / 'nights').mkdir()
    (tmp_path / 'link').symlink_to('nights')
    monkeypatch.chdir(tmp_path)
    real = str(tmp_path.resolve() / 'nights/out')
    for text in (
        'nights/out',
        './nights/x/../out/',
        'link/out',
        tmp_path / 'link/out',
        f'file://{tmp_path}/link/out',
    ):
        assert real_location(text) == real


def test_a_url_has_one_spelling(tmp_path):
    pytest.importorskip('fsspec')
    assert real_location('memory://plant/out/') == real_location('memory:///plant/out') == 'memory:///plant/out'
    assert real_location(f'local://{tmp_path}/out') == str(tmp_path.resolve() / 'out')


def test_what_is_below_a_folder_is_told_from_what_has_its_name_as_a_beginning():
    assert is_below('/plant/out/a.mcap', '/plant/out')
    assert is_below('/plant/out', '/plant/out')
    assert not is_below('/plant/out2', '/plant/out')
    assert not is_below('/plant', '/plant/out')
    assert is_below('/plant', '/')
