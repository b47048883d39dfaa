"""Sharing rows among threads."""

import os
import threading

import pytest

from socialcircle_ros import threads


@pytest.mark.parametrize('limit', [1, 2, 3, 8])
@pytest.mark.parametrize('rows', [0, 1, 7, 64])
def test_every_row_is_in_one_band(rows, limit, monkeypatch):
    monkeypatch.setattr(threads, 'limit', limit)
    done = []

    threads.in_bands(lambda first, last: done.extend(range(first, last)), rows, 1)

    assert sorted(done) == list(range(rows))


def test_a_band_has_at_least_the_rows_that_are_worth_a_thread(monkeypatch):
    monkeypatch.setattr(threads, 'limit', 8)
    bands = []

    threads.in_bands(lambda first, last: bands.append(last - first), 59, 20)

    assert sorted(bands) == [29, 30]


def test_bands_are_worked_on_side_by_side(monkeypatch):
    monkeypatch.setattr(threads, 'limit', 2)
    both = threading.Barrier(2, timeout=20)

    threads.in_bands(lambda first, last: both.wait(), 2, 1)  # would break, if one waited for the other


def test_what_fails_in_a_band_is_told(monkeypatch):
    monkeypatch.setattr(threads, 'limit', 2)

    def work(first, _):
        if first > 0:
            raise ValueError('no')

    with pytest.raises(ValueError, match='no'):
        threads.in_bands(work, 10, 1)


def test_a_forked_process_has_threads_of_its_own(monkeypatch):
    monkeypatch.setattr(threads, 'limit', 2)
    threads.in_bands(lambda first, last: None, 2, 1)

    child = os.fork()
    if child == 0:
        threads.in_bands(lambda first, last: None, 2, 1)
        os._exit(3)

    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 3
