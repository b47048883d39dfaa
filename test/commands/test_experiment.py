"""`socialcircle experiment`."""

import csv

import pytest

pytest.importorskip('matplotlib')


def test_quick_experiments_leave_a_page_tables_and_pictures(run, tmp_path):
    done = run('experiment', 'table1', '--quick', '--seeds', '4')
    assert done.code == 0, done.err
    folder = tmp_path / 'out' / 'experiments'
    page = (folder / 'table1.html').read_text(encoding='utf-8')
    assert 'What was found' in page
    assert 'socialcircle experiment table1 --seeds 4 --quick' in page
    assert str(tmp_path) not in page
    assert 'the whole claim holds' in done.out
    with (folder / 'table1_metal_groove.csv').open(encoding='utf-8') as file:
        rows = list(csv.DictReader(file))
    assert rows[0]['filter'] == 'Social circle, default'
    assert {'Radius, best', 'Statistical, default', 'Median residual, best'} <= {row['filter'] for row in rows}
    assert float(rows[0]['raw points']) == 144 * 192 - 7
    assert (folder / 'contamination.png').read_bytes().startswith(b'\x89PNG')


def test_seeds_that_are_no_numbers_are_told(run):
    assert 'give whole numbers from 0' in run('experiment', 'table1', '--seeds', '1;2').err


def test_a_place_that_cannot_be_written_is_told(run, tmp_path):
    (tmp_path / 'file').write_text('')
    done = run('experiment', 'figure8', '--quick', '-o', 'file/inside')
    assert done.code == 1
    assert 'cannot be written' in done.err
    assert 'Traceback' not in done.err
