# SPDX-License-Identifier: Apache-2.0
"""`socialcircle batch`."""

import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from archive.archives import recorded
from storage.disks import fill, small_disk

from socialcircle_ros.commands.main import main
from socialcircle_ros.kernels import compiled
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.point_cloud import encode_point_cloud

for library in ('distributed', 'fsspec', 'pyarrow', 'duckdb'):
    pytest.importorskip(library)


def test_it_filters_with_processes_of_its_own_and_tells_what_is_wrong(run, tmp_path):
    recorded(tmp_path / 'cell7/lid_1.mcap')
    (tmp_path / 'cell7/lid_2.mcap').write_bytes(b'no recording')
    names = ('--names', '{cell}/{part}_*.mcap')
    done = run('batch', 'cell7', '-o', 'out', '--workers', '1', *names, timeout=300)
    assert done.code == 1
    assert '2 inputs: 1 filtered with 2 clouds; 1 failed, 0 damaged. Results are in out.' in done.out
    assert 'Dashboard: http://127.0.0.1:' in done.err
    (failed,) = [line for line in done.err.splitlines() if line.startswith('Failed: ')]
    assert f'{tmp_path}/cell7/lid_2.mcap' in failed
    assert 'Traceback' not in done.err
    (tmp_path / 'cell7/lid_2.mcap').unlink()
    again = run('batch', 'cell7', 'out', '-o', 'out', *names)
    assert again.code == 0, again.err
    assert '1 input: 0 filtered with 0 clouds, 1 done before; 0 failed, 0 damaged.' in again.out
    assert '1 result in out left out: results are not read again.' in again.err


def test_refused_clouds_are_told_with_their_inputs_and_the_query_that_lists_them(run, tmp_path):
    empty = encode_point_cloud(Header(), np.full((9, 9, 3), np.nan, np.float32))
    for number in range(7):
        recorded(tmp_path / f'nights/{number}.mcap', clouds=number + 1, message=empty)
    recorded(tmp_path / 'nights/good.mcap')
    done = run('batch', 'nights', '-o', 'out', '--workers', '1', '--no-recordings', timeout=300)
    assert done.code == 0
    (refused,) = [line for line in done.err.splitlines() if line.startswith('Refused')]
    names = ', '.join(f'{tmp_path}/nights/{number}.mcap' for number in range(5))
    assert refused.startswith(f'Refused, 28 times, in {names}, …: No point of the cloud is measured')
    (listing,) = [line for line in done.err.splitlines() if line.startswith('The refused clouds: socialcircle ')]
    listed = run(*shlex.split(listing.partition('socialcircle ')[2]))
    assert listed.code == 0, listed.err
    assert listed.out.count('nights/6.mcap') == 7


def test_inputs_that_fail_alike_are_told_together_and_nothing_is_next_where_nothing_was_done(run, tmp_path):
    with small_disk(tmp_path / 'disk', 2 << 20) as disk:
        for number in range(8):
            recorded(tmp_path / f'nights/{number}.mcap', seed=number, clouds=10)
        fill(disk, left=800_000)  # enough for rows, but not for a recording
        done = run('batch', 'nights', '-o', 'disk/out', '--workers', '1', timeout=300)
    assert done.code == 1
    assert '8 inputs: 0 filtered with 0 clouds; 8 failed' in done.out
    told = [line for line in done.err.splitlines() if line and not line.startswith('Dashboard')]
    nights = tmp_path / 'nights'
    names = ', '.join(f'{nights}/{number}.mcap' for number in range(1, 6))
    why = 'cannot be written (No space left on device): check the space and the permissions there.'
    assert told == [
        f'Failed: {nights}/0.mcap: {disk}/out/recordings/0.mcap {why}',
        f'So failed 7 others: {names}, …',
    ]


def test_inputs_that_fail_for_other_reasons_are_told_one_by_one(run, tmp_path):
    (tmp_path / 'a.mcap').write_bytes(b'no recording')
    np.savez(tmp_path / 'b.npz', heights=1)
    done = run('batch', 'a.mcap', 'b.npz', '-o', 'out', '--workers', '1', timeout=300)
    told = [line for line in done.err.splitlines() if line and not line.startswith('Dashboard')]
    assert [line[: len(f'Failed: {tmp_path}/b')] for line in told] == [
        f'Failed: {tmp_path}/{name}' for name in 'ab'
    ]


def test_ctrl_c_in_a_terminal_ends_all_processes_and_the_same_command_continues(run, tmp_path):
    for number in range(24):
        recorded(tmp_path / f'nights/{number}.mcap', seed=number, clouds=6)
    command = ('batch', 'nights', '-o', 'out', '--no-recordings', '--workers', '2')
    client = subprocess.Popen(
        [sys.executable, '-m', 'socialcircle_ros.commands.main', *command],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    while client.poll() is None and not list(tmp_path.glob('out/inputs/*.json')):
        time.sleep(0.02)
    os.killpg(client.pid, signal.SIGINT)  # a terminal sends it to all processes of a command
    told = client.communicate(timeout=300)[1]
    assert client.returncode == 130, told
    assert 'Stopped.' in told
    assert 'Traceback' not in told
    while processes_of_session(client.pid):
        time.sleep(0.02)
    done = len(list(tmp_path.glob('out/inputs/*.json')))
    again = run(*command, timeout=300)
    assert f'24 inputs: {24 - done} filtered' in again.out
    assert f'{done} done before; 0 failed' in again.out


def processes_of_session(session):
    found = []
    for path in Path('/proc').glob('[0-9]*/stat'):
        try:
            state, _, _, its_session = path.read_text().rpartition(')')[2].split()[:4]
        except (FileNotFoundError, ProcessLookupError):
            continue
        if int(its_session) == session and state != 'Z':
            found.append(path)
    return found


def test_what_cannot_start_is_told_and_leaves_nothing(run, tmp_path):
    missing = run('batch', 'nights', '-o', 'out/new')
    assert missing.code == 1
    assert missing.err.strip() == 'Error: nights does not exist: check the name.'
    recorded(tmp_path / 'a.mcap', clouds=1)
    alone = run('batch', 'a.mcap', '-o', 'out/new', '--scheduler', 'none.json')
    assert alone.code == 1
    assert 'Error: No Dask scheduler answers at none.json' in alone.err
    named = run('batch', 'a.mcap', '-o', 'out/new.png')
    assert named.code == 1
    assert 'new.png has the name of a file' in named.err
    assert list(tmp_path.iterdir()) == [tmp_path / 'a.mcap']


def test_it_says_that_the_workers_compile(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(compiled, 'has_cached_code', lambda _: False)
    assert main(['batch', str(tmp_path / 'nights'), '-o', str(tmp_path / 'out')]) == 1
    assert capsys.readouterr().err.startswith('The first use compiles the filter, which can take half a minute.')
