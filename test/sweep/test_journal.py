# SPDX-License-Identifier: Apache-2.0
"""The journal of finished trials, and processes that share it."""

import sys

import pytest
from sweep.sweep_examples import scale, trial

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.sweep.journal import TrialJournal
from socialcircle_ros.sweep.search import Search
from socialcircle_ros.sweep.search_space import Range

pytest.importorskip('optuna')


@pytest.fixture
def path(tmp_path):
    return tmp_path / 'trials.log'


def test_finished_trials_are_read_back(path):
    journal = TrialJournal(path, 'print')
    for each in (trial(0.5, cloud_scores=(1.0, 0.25)), trial(1.0)):
        journal.add(each)
    assert TrialJournal(path, 'print').trials == [trial(0.5, cloud_scores=(1.0, 0.25)), trial(1.0)]
    assert TrialJournal(path, 'print', restart=True).trials == []


@pytest.mark.parametrize('cut', [1, 2, 60])
def test_a_line_that_was_cut_short_is_dropped(path, cut):
    journal = TrialJournal(path, 'print')
    journal.add(trial(0.5))
    before = path.stat().st_size
    journal.add(trial(1.0))
    path.write_bytes(path.read_bytes()[:-cut])
    again = TrialJournal(path, 'print')
    assert again.trials == [trial(0.5)]
    assert path.stat().st_size == before
    again.add(trial(2.0))
    assert TrialJournal(path, 'print').trials == [trial(0.5), trial(2.0)]


def test_trials_on_other_clouds_are_refused(path):
    TrialJournal(path, 'print').add(trial(0.5))
    with pytest.raises(SocialCircleError, match='other clouds'):
        TrialJournal(path, 'another')
    assert not TrialJournal(path, 'another', restart=True).trials


@pytest.mark.parametrize('content', ['hello\n', '{"sweep": 1}\n{"odd": 2}\n', '[]\n', '{}\n', '3\n'])
def test_a_file_of_another_kind_is_refused_and_left_unchanged(path, content):
    path.write_text(content)
    with pytest.raises(SocialCircleError, match='is not a file of trials'):
        TrialJournal(path, 'print')
    assert path.read_text() == content


def test_a_folder_that_cannot_be_written_is_told(tmp_path):
    with pytest.raises(SocialCircleError, match='cannot be used: No such file'):
        TrialJournal(tmp_path / 'none/trials.log', 'print')


def test_what_another_process_has_tried_is_left_out(path):
    one, other = TrialJournal(path, 'print'), TrialJournal(path, 'print')
    left = one.untried([scale(1.0), scale(2.0), scale(3.0)])
    assert next(left) == scale(1.0)
    other.add(trial(2.0))
    assert list(left) == [scale(3.0)]
    one.add(trial(1.0))
    one.add(trial(2.0, score=0.5))  # both had begun it
    assert one.trials == other.trials == [trial(2.0), trial(1.0)]


def test_two_searches_share_what_they_find(path):
    space = [Range('circle.radius_scale', 0.5, 3)]

    def search():
        journal = TrialJournal(path, 'print')
        return Search(space, 6, journal.trials, journal.storage, journal.fingerprint)

    searches, tried = [search(), search()], []
    running = [iter(each) for each in searches]
    while True:
        values = next(running[len(tried) % 2], None)
        if values is None:
            break
        tried.append(values['circle.radius_scale'])
        searches[(len(tried) - 1) % 2].tell(trial(tried[-1]))
    assert len(set(tried)) == len(tried) == 6
    assert next(iter(search()), None) is None


def test_trials_of_a_grid_are_known_to_a_search(path):
    journal = TrialJournal(path, 'print')
    journal.add(trial(1.0))
    space = [Range('circle.radius_scale', 0.5, 3)]
    for count in (2, 2):  # a second start does not add them again
        study = Search(space, count, journal.trials, journal.storage, journal.fingerprint)
        assert len(study._study.trials) == 1


def test_a_sweep_without_optuna_says_how_to_install_it(path, monkeypatch):
    monkeypatch.setitem(sys.modules, 'optuna', None)
    with pytest.raises(SocialCircleError, match='A sweep needs Optuna: pip install '):
        TrialJournal(path, 'print')
