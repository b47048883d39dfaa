# SPDX-License-Identifier: Apache-2.0
"""Rows of live clouds, written in batches."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from measurements.row_examples import measurement, origin
from storage.disks import fill, small_disk

from socialcircle_ros.measurements import open_measurements, row_writer
from socialcircle_ros.measurements.row_writer import LiveCloud, RowWriter

pytest.importorskip('pyarrow')
pytest.importorskip('duckdb')


def refused(number):
    return LiveCloud(origin(number=number), 'It is not organized.')


def numbers(folder):
    return [
        row[0] for row in open_measurements(folder).sql('select number from measurements order by all').fetchall()
    ]


def wait_for(condition):
    until = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.01)


def test_rows_are_written_at_the_end_with_their_texture(tmp_path):
    found = []

    def keep(xyz, kept):
        found.append((xyz, kept))

    from examples import cloud

    from socialcircle_ros.pipeline.clouds import filter_cloud

    made = filter_cloud(cloud(), take_kept=keep).measurement
    writer = RowWriter(tmp_path, 'live', 3600, pytest.fail)
    writer.put(LiveCloud(origin(number=1), made, 8.5, *found[0]))
    writer.put(LiveCloud(origin(number=2), measurement(), 7.5))
    writer.close()
    writer.close()
    query = 'select number, outliers, latency_ms, sq from measurements order by all'
    ((_, _, _, sq), second) = open_measurements(tmp_path).sql(query).fetchall()
    assert 0.3 < sq < 1
    assert second == (2, 26, 7.5, None)


def test_a_batch_is_written_when_its_time_is_over(tmp_path):
    writer = RowWriter(tmp_path, 'live', 0.02, pytest.fail)
    for number in range(2):
        writer.put(refused(number))
        wait_for(lambda wanted=number + 1: len(list(tmp_path.rglob('*.parquet'))) == wanted)
    writer.close()
    assert numbers(tmp_path) == [0, 1]


def test_what_cannot_be_written_waits_and_the_oldest_rows_are_lost(tmp_path, monkeypatch):
    monkeypatch.setattr(row_writer, 'MOST_WAITING', 3)
    told = []
    (tmp_path / 'measurements').write_text('in the way')
    writer = RowWriter(tmp_path, 'live', 0.02, told.append)
    for number in range(5):
        writer.put(refused(number))
    wait_for(lambda: told and '2 rows are lost.' in told[-1])
    assert '3 rows of measurements wait, because: ' in told[-1]
    (tmp_path / 'measurements').unlink()
    wait_for(lambda: list(tmp_path.rglob('*.parquet')))
    assert writer.close() == ''
    assert numbers(tmp_path) == [2, 3, 4]


def test_a_folder_that_cannot_be_used_is_told_before_the_first_row_and_what_is_lost_at_the_end(tmp_path):
    told = []
    (tmp_path / 'measurements').write_text('in the way')
    writer = RowWriter(tmp_path, 'live', 3600, told.append)
    wait_for(lambda: told)
    (sentence,) = told
    assert sentence.startswith('Rows of measurements will wait, because: ')
    for number in range(2):
        writer.put(refused(number))
    for _ in range(2):
        assert writer.close().startswith('2 rows of measurements are lost, because: ')
    assert told == [sentence]


def test_rows_that_wait_or_are_lost_are_said_in_the_number_that_they_have(tmp_path, monkeypatch):
    monkeypatch.setattr(row_writer, 'MOST_WAITING', 1)
    told = []
    (tmp_path / 'measurements').write_text('in the way')
    writer = RowWriter(tmp_path, 'live', 0.02, told.append)
    for number in range(2):
        writer.put(refused(number))
    wait_for(lambda: told and told[-1].endswith(' 1 row is lost.'))
    assert told[-1].startswith('1 row of measurements waits, because: ')
    assert writer.close().startswith('2 rows of measurements are lost, because: ')


def test_a_folder_with_a_name_that_no_system_has_is_told_with_each_row(tmp_path):
    told = []
    writer = RowWriter(tmp_path / 'a\0b', 'live', 3600, told.append)
    writer.put(refused(0))
    writer.close()
    assert [sentence.split(', because: ')[0] for sentence in told] == [
        'Rows of measurements will wait', 'A row of measurements is lost'
    ]  # fmt: skip


def test_a_full_disk_keeps_rows_waiting_until_there_is_room(tmp_path):
    told = []
    with small_disk(tmp_path / 'disk', 1 << 20) as disk:
        writer = RowWriter(disk, 'live', 0.02, told.append)
        writer.put(refused(0))
        wait_for(lambda: list(disk.rglob('*.parquet')))
        fill(disk, left=4096)
        for number in (1, 2):
            writer.put(refused(number))
        wait_for(lambda: told)
        assert 'No space left on device' in told[0]
        assert numbers(disk) == [0]  # and no file is half written
        (disk / 'ballast').unlink()
        wait_for(lambda: len(list(disk.rglob('*.parquet'))) == 2)
        writer.close()
        assert numbers(disk) == [0, 1, 2]
        assert {path.suffix for path in disk.rglob('*') if path.is_file()} == {'.parquet'}


def test_a_cloud_never_waits_for_the_disk(tmp_path, monkeypatch):
    """While the disk hangs, rows are taken, and only the first clouds keep their points in memory."""
    hangs, works = threading.Event(), threading.Event()
    waited = []
    real = row_writer.write_rows

    def write_rows(*arguments):
        hangs.set()
        waited.append(works.wait(60))
        return real(*arguments)

    monkeypatch.setattr(row_writer, 'write_rows', write_rows)
    writer = RowWriter(tmp_path, 'live', 0.01, pytest.fail)
    for number in range(50):
        writer.put(LiveCloud(origin(number=number), 'It is not organized.', xyz=number, kept=number))
        assert hangs.wait(60)
    assert sum(each.xyz is not None for each in writer._coming) == row_writer._MOST_CLOUDS
    works.set()
    writer.close()
    assert all(waited)  # a disk that hung until its time was over would have kept a cloud waiting
    assert numbers(tmp_path) == list(range(50))


def test_a_fault_in_one_row_loses_that_row_and_no_other(tmp_path):
    told = []
    writer = RowWriter(tmp_path, 'live', 3600, told.append)
    writer.put(refused(0))
    writer.put(LiveCloud(origin(number=1), None))  # no outcome of any kind
    writer.put(refused(2))
    writer.close()
    assert numbers(tmp_path) == [0, 2]
    (sentence,) = told
    assert sentence.startswith('A row of measurements is lost, because: ')


def test_a_row_that_the_library_cannot_write_holds_up_no_other(tmp_path, monkeypatch):
    told = []
    real = row_writer.write_rows

    def write_rows(folder, name, rows):
        if any(row.number == 1 for row in rows):
            raise ValueError('a row that the library cannot write')
        return real(folder, name, rows)

    monkeypatch.setattr(row_writer, 'write_rows', write_rows)
    writer = RowWriter(tmp_path, 'live', 3600, told.append)
    for number in range(3):
        writer.put(refused(number))
    writer.close()
    assert numbers(tmp_path) == [0, 2]
    (sentence,) = told
    assert 'a row that the library cannot write' in sentence


def test_a_process_that_is_killed_loses_at_most_the_last_batch(tmp_path):
    program = f"""
import time
from pathlib import Path
from measurements.row_examples import origin
from socialcircle_ros.measurements.row_writer import MOST_ROWS, LiveCloud, RowWriter
writer = RowWriter(Path({str(tmp_path)!r}), 'live', 3600, print)
number = 0
while True:
    writer.put(LiveCloud(origin(number=number), 'It is not organized.'))
    number += 1
    time.sleep(0.0005)
"""
    here = Path(__file__).resolve().parents[1]
    path = os.pathsep.join([str(here), os.environ.get('PYTHONPATH', '')])
    process = subprocess.Popen([sys.executable, '-c', program], env={**os.environ, 'PYTHONPATH': path})
    wait_for(lambda: list(tmp_path.rglob('*.parquet')) or process.poll() is not None)
    process.send_signal(signal.SIGKILL)
    process.wait()
    found = numbers(tmp_path)
    assert len(found) >= row_writer.MOST_ROWS
    assert found == list(range(len(found)))
