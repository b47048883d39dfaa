# SPDX-License-Identifier: Apache-2.0
"""The folder of the results of long work."""

from pathlib import Path

import pytest

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.storage import check_folder_name, folder_of_results


def fails_after(folder, work):
    with pytest.raises(KeyboardInterrupt), folder_of_results(folder):
        work()
        raise KeyboardInterrupt


def test_it_is_there_during_the_work_and_stays_with_what_was_done(tmp_path):
    with folder_of_results(tmp_path / 'a/b'):
        (tmp_path / 'a/b/result').touch()
    assert (tmp_path / 'a/b/result').exists()


def test_one_that_is_still_empty_does_not_stay(tmp_path):
    with folder_of_results(tmp_path / 'a/b'):
        assert (tmp_path / 'a/b').is_dir()
    assert list(tmp_path.iterdir()) == []


def test_a_new_folder_does_not_get_the_name_of_a_file(tmp_path):
    with pytest.raises(SocialCircleError, match=r'x\.png has the name of a file, .* such as .*/x\.$'):
        check_folder_name(tmp_path / 'x.png')
    check_folder_name(tmp_path / 'night.2026-11-29')
    (tmp_path / 'x.png').mkdir()
    check_folder_name(tmp_path / 'x.png')


def test_what_was_created_is_removed_if_nothing_was_done(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'there').mkdir()
    fails_after(Path('there/a/b'), lambda: None)
    assert list(tmp_path.rglob('*')) == [tmp_path / 'there']
    fails_after(tmp_path / 'there', lambda: None)  # was there before
    assert (tmp_path / 'there').is_dir()


def test_what_was_done_stays(tmp_path):
    fails_after(tmp_path / 'a/b', (tmp_path / 'a/b/result').touch)
    assert (tmp_path / 'a/b/result').exists()


def test_a_folder_that_cannot_be_created_is_told(tmp_path):
    (tmp_path / 'file').touch()
    with (
        pytest.raises(SocialCircleError, match='file/b cannot be written: Not a directory; choose another folder'),
        folder_of_results(tmp_path / 'file/b'),
    ):
        pass
    assert list(tmp_path.iterdir()) == [tmp_path / 'file']
