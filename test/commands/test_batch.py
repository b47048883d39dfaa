# SPDX-License-Identifier: Apache-2.0
"""`socialcircle batch`."""

import pytest
from archive.archives import recorded

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
    again = run('batch', 'cell7', '-o', 'out', *names)
    assert again.code == 0, again.err
    assert '1 input: 0 filtered with 0 clouds, 1 done before; 0 failed, 0 damaged.' in again.out


def test_what_cannot_start_is_told_and_leaves_nothing(run, tmp_path):
    missing = run('batch', 'nights', '-o', 'out/new')
    assert missing.code == 1
    assert missing.err.strip() == 'Error: nights does not exist: check the name.'
    recorded(tmp_path / 'a.mcap', clouds=1)
    alone = run('batch', 'a.mcap', '-o', 'out/new', '--scheduler', 'none.json')
    assert alone.code == 1
    assert 'Error: No Dask scheduler answers at none.json' in alone.err
    assert list(tmp_path.iterdir()) == [tmp_path / 'a.mcap']
