# SPDX-License-Identifier: Apache-2.0
"""Large writes past the system's cache."""

import errno
import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from socialcircle_ros.storage import ALIGNMENT, DirectFile, direct

UNIT = ALIGNMENT


@pytest.fixture
def file(tmp_path, monkeypatch):
    """A file to write, and pieces of two units; the test is skipped where the disk of the tests cannot do it."""
    monkeypatch.setattr(direct, '_PIECE', 2 * UNIT)
    with (tmp_path / 'file').open('wb') as file:
        trial = DirectFile(file.fileno())
        able = trial.write(memoryview(bytes(UNIT)), 0) == UNIT
        trial.close()
        if not able:
            pytest.skip('the file system of the tests keeps everything in the cache')
        os.ftruncate(file.fileno(), 0)
        yield file


def content(file):
    return Path(file.name).read_bytes()


@settings(deadline=None, max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(size=st.integers(0, 7 * UNIT), start=st.integers(0, 3), offset=st.integers(0, 70))
def test_whole_units_are_written_where_they_belong_and_the_rest_is_left(file, size, start, offset):
    os.ftruncate(file.fileno(), 0)
    data = os.urandom(offset + size)
    writer = DirectFile(file.fileno())
    written = writer.write(memoryview(data)[offset:], start * UNIT)
    writer.close()
    assert written == size // UNIT * UNIT
    assert content(file) == (bytes(start * UNIT) + data[offset : offset + written] if written else b'')


@pytest.mark.parametrize('number', [errno.ENOSPC, errno.EINVAL, errno.EIO])
def test_what_fails_is_left_to_the_usual_way_from_then_on(file, number, monkeypatch):
    write, calls = os.pwrite, []

    def fail_at_the_second(*given):
        calls.append(given)
        if len(calls) == 2:
            raise OSError(number, os.strerror(number))
        return write(*given)

    monkeypatch.setattr(os, 'pwrite', fail_at_the_second)
    data = os.urandom(6 * UNIT)
    writer = DirectFile(file.fileno())
    assert writer.write(memoryview(data), 0) == 2 * UNIT
    assert writer.write(memoryview(data), 2 * UNIT) == 0
    assert content(file) == data[: 2 * UNIT]


def test_what_is_written_in_part_counts_up_to_its_last_whole_unit(file, monkeypatch):
    write = os.pwrite
    monkeypatch.setattr(os, 'pwrite', lambda descriptor, data, at: write(descriptor, data[:UNIT], at) - 100)
    writer = DirectFile(file.fileno())
    assert writer.write(memoryview(os.urandom(4 * UNIT)), UNIT) == 0
    monkeypatch.setattr(os, 'pwrite', lambda descriptor, data, at: write(descriptor, data[:UNIT], at))
    assert writer.write(memoryview(os.urandom(4 * UNIT)), UNIT) == UNIT
    writer.close()


@pytest.mark.parametrize('missing', ['flag', 'file system'])
def test_where_the_cache_cannot_be_passed_nothing_is_written(tmp_path, missing, monkeypatch):
    def refuse(*_):
        raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))

    with (tmp_path / 'file').open('wb') as file:
        if missing == 'flag':
            monkeypatch.delattr(os, 'O_DIRECT', raising=False)
        else:
            monkeypatch.setattr(os, 'open', refuse)
        writer = DirectFile(file.fileno())
        assert writer.write(memoryview(bytes(UNIT)), 0) == 0
        writer.close()
