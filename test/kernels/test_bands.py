# SPDX-License-Identifier: Apache-2.0
"""Sharing rows among threads."""

import os
import subprocess
import sys
import textwrap
import threading
from concurrent.futures import wait

import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.kernels import bands
from socialcircle_ros.kernels.machine import usable_cores


@given(height=st.integers(0, 50), limit=st.integers(1, 5))
def test_bands_cover_every_row_once_and_in_order(height, limit):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bands, 'limit', limit)
        parts = bands.in_bands(lambda band: list(range(height))[band], height, 10, 10)

    assert [row for part in parts for row in part] == list(range(height))
    assert len(parts) == max(1, min(limit, height))


def test_a_band_holds_at_least_the_least_items(monkeypatch):
    monkeypatch.setattr(bands, 'limit', 8)

    assert bands.in_bands(lambda band: band.stop - band.start, 59, 3, 60) == [29, 30]


def test_bands_run_in_parallel(monkeypatch):
    monkeypatch.setattr(bands, 'limit', 2)
    both = threading.Barrier(2, timeout=60)

    # The barrier would break if one band waited for the other.
    assert sorted(bands.in_bands(lambda _: both.wait(), 2, 1, 1)) == [0, 1]


def test_no_helper_works_on_when_the_caller_has_failed(monkeypatch):
    monkeypatch.setattr(bands, 'limit', 2)
    begun, failed, ended = threading.Event(), threading.Event(), threading.Event()

    def work(band):
        if band.start == 0:
            assert begun.wait(60)
            failed.set()
            raise KeyboardInterrupt
        begun.set()
        assert failed.wait(60)
        ended.set()

    with pytest.raises(KeyboardInterrupt):
        bands.in_bands(work, 2, 1, 1)
    assert ended.is_set()


def test_helpers_do_not_run_on_the_core_of_the_caller(monkeypatch):
    monkeypatch.setattr(bands, 'limit', 2)
    both = threading.Barrier(2, timeout=60)

    def look(_):
        both.wait()
        return os.sched_getaffinity(0)

    # A helper that begins later would run where its caller does.
    everyone = threading.Barrier(usable_cores(), timeout=60)
    wait([bands._helpers()._pool.submit(everyone.wait) for _ in range(everyone.parties)])
    mine, others = bands.in_bands(look, 2, 1, 1)

    assert mine == os.sched_getaffinity(0)
    assert len(others) == max(1, len(mine) - 1)
    assert others <= mine


def test_helpers_may_run_on_any_core_while_several_threads_call(monkeypatch):
    monkeypatch.setattr(bands, 'limit', 2)
    inside, done = threading.Event(), threading.Event()

    def stay(band):
        if band.start == 0:
            inside.set()
            done.wait()

    another = threading.Thread(target=bands.in_bands, args=(stay, 2, 1, 1))
    another.start()
    inside.wait()
    both = threading.Barrier(2, timeout=60)

    def look(_):
        both.wait()
        return os.sched_getaffinity(0)

    try:
        mine, others = bands.in_bands(look, 2, 1, 1)
        assert others == mine
    finally:
        done.set()
        another.join()


def test_bands_that_no_helper_has_started_run_in_the_calling_thread(monkeypatch):
    monkeypatch.setattr(bands, 'limit', 2)
    done = threading.Event()
    for _ in range(usable_cores()):
        bands._helpers()._pool.submit(done.wait)
    try:
        assert bands.in_bands(lambda _: threading.get_ident(), 2, 1, 1) == 2 * [threading.get_ident()]
    finally:
        done.set()


def test_an_error_in_a_band_is_raised(monkeypatch):
    monkeypatch.setattr(bands, 'limit', 2)

    def work(band):
        if band.start > 0:
            raise ValueError('no')

    with pytest.raises(ValueError, match='no'):
        bands.in_bands(work, 10, 1, 1)


FORK = """
    import os
    from socialcircle_ros.kernels import bands

    bands.limit = 2
    bands.in_bands(lambda _: None, 2, 1, 1)
    child = os.fork()
    if child == 0:
        bands.in_bands(lambda _: None, 2, 1, 1)
        os._exit(3)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
    """


def test_a_forked_process_has_its_own_threads():
    # In a process of its own, since a test process has threads that hold locks.
    program = [sys.executable, '-c', textwrap.dedent(FORK)]
    assert subprocess.run(program, capture_output=True, text=True, check=True).stdout == '3\n'
