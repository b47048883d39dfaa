# SPDX-License-Identifier: Apache-2.0
"""`socialcircle experiment`."""

import csv
import re

import numpy as np
import pytest

pytest.importorskip('matplotlib')


def rows_of(path):
    with path.open(encoding='utf-8') as file:
        return list(csv.DictReader(file))


@pytest.mark.long
def test_all_experiments_write_one_page_its_tables_and_its_pictures(run, tmp_path):
    heights = np.random.default_rng(1).normal(0, 0.1, (70, 90))
    heights[30:33, 40:43] += 20
    np.savez(tmp_path / 'plate.npz', z=heights, dx=1.0, dy=1.0)
    np.savez(tmp_path / 'a_stack.npz', frames=np.zeros((3, 4, 5), np.uint8), z=np.arange(3))
    done = run('experiment', 'all', '--quick', '--seeds', '4', '--data', tmp_path, timeout=300)
    assert done.code == 0, done.err
    folder = tmp_path / 'out' / 'experiments'
    table = rows_of(folder / 'table1_metal_groove.csv')
    assert table[0]['filter'] == 'Social circle, default'
    assert {'Radius, best', 'Statistical, default', 'Median residual, best'} <= {row['filter'] for row in table}
    assert float(table[0]['raw points']) == 144 * 192 - 7
    assert {row['surface'] for row in rows_of(folder / 'real.csv')} == {'plate'}
    pictures = {path.stem for path in folder.glob('*.png')}
    assert {
        'contamination',
        'figure4',
        'figure8_metal_groove_best',
        'repaired_composite',
        'real_plate',
    } <= pictures
    page = (folder / 'all.html').read_text(encoding='utf-8')
    assert page.count('<img ') == len(pictures) + 1  # the last one shows a picture enlarged
    assert 'socialcircle experiment all --seeds 4 --quick' in page
    assert str(tmp_path) not in page
    findings = [line for line in done.out.splitlines() if line.startswith('- ')]
    assert len(findings) > 8
    states = [line for line in done.err.splitlines() if ' steps finished' in line]
    assert re.search(r' 0 of (\d+) steps finished, about .+ left$', states[0])
    assert re.search(r' (\d+) of \1 steps finished$', states[-1])
    assert not (folder / 'all.steps').exists()


def test_the_goals_of_the_adaptive_mode_are_evaluated(run, tmp_path):
    heights = np.random.default_rng(1).normal(0, 0.1, (70, 90))
    heights[30:33, 40:43] += 20
    np.savez(tmp_path / 'plate.npz', z=heights, dx=1.0, dy=1.0)
    done = run('experiment', 'adaptive', '--quick', '--data', tmp_path, timeout=300)
    assert done.code == 0, done.err
    folder = tmp_path / 'out' / 'experiments'
    assert {row['inserted'] for row in rows_of(folder / 'adaptive_real.csv')} == {'0.01', '0.05', '0.15', '0.3'}
    (plate,) = rows_of(folder / 'adaptive_untouched.csv')
    assert (plate['beyond 10 σ'], plate['of those removed']) == ('9', '1.0')
    goals = rows_of(folder / 'adaptive_goals.csv')
    page = (folder / 'adaptive.html').read_text(encoding='utf-8')
    assert all(goal['quantity'] in done.out and goal['quantity'] in page for goal in goals)
    assert (folder / 'adaptive_spikes_plate.png').exists()


def test_without_measured_surfaces_the_page_of_the_adaptive_mode_has_a_warning(run, tmp_path, monkeypatch):
    monkeypatch.delenv('SOCIALCIRCLE_DATA', raising=False)
    done = run('experiment', 'adaptive', '--quick', timeout=300)
    assert done.code == 0, done.err
    page = (tmp_path / 'out' / 'experiments' / 'adaptive.html').read_text(encoding='utf-8')
    assert 'No measured surfaces were given' in page


def test_seeds_that_are_not_numbers_are_an_error(run):
    assert 'give whole numbers from 0' in run('experiment', 'table1', '--seeds', '1;2').err


def test_a_folder_that_cannot_be_written_is_an_error(run, tmp_path):
    (tmp_path / 'file').write_text('')
    done = run('experiment', 'figure8', '--quick', '-o', 'file/inside')
    assert done.code == 1
    assert 'cannot be written' in done.err
    assert 'Traceback' not in done.err


def test_the_network_is_compared_on_measured_surfaces_alone(run, monkeypatch):
    monkeypatch.delenv('SOCIALCIRCLE_DATA', raising=False)
    done = run('experiment', 'learned')
    assert done.code == 2
    assert 'learned needs measured surfaces' in done.err
