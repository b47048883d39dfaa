# SPDX-License-Identifier: Apache-2.0
"""Each instrument is left out once, and judged by the training that never saw it."""

import csv

import pytest
from click.testing import CliRunner
from studies.learned.small import few_small_crops, write_surfaces

pytest.importorskip('scipy')
torch = pytest.importorskip('torch')
pytest.importorskip('onnx')
pytest.importorskip('matplotlib')

from socialcircle_ros.studies.learned import corpus, leave_out, training  # noqa: E402 the others need PyTorch
from socialcircle_ros.studies.learned.surfaces import instrument_of  # noqa: E402

NAMES = ('afm_icon_a', 'afm_dimv_b', 'gelsight_c', 'training/zygo_d', 'training/unheard_of')


@pytest.fixture
def data(tmp_path, monkeypatch):
    torch.set_num_threads(1)
    few_small_crops(monkeypatch, corpus, training)
    return write_surfaces(tmp_path / 'data', NAMES)


def test_each_surface_is_judged_by_a_training_that_did_not_see_its_instrument(data, tmp_path, monkeypatch):
    trained, judged = {}, []

    def train(folder, corpora, *_):
        trained[folder.name] = {path.name for path in corpora}
        return folder

    monkeypatch.setattr(leave_out, '_train', train)
    monkeypatch.setattr(leave_out, 'NetworkJudge', lambda network, threads: network.name)

    def score(surface, judge, _):
        judged.append((surface.cloud.name, judge))
        return leave_out.Scored([float(judge != 'all')] * 4, 0.25)

    monkeypatch.setattr(leave_out, '_score', score)
    out = tmp_path / 'folds.csv'
    options = ['--data', data, '--work', tmp_path / 'work', '-o', out, '--folds', 3, '--simulated', 1]
    done = CliRunner().invoke(leave_out.command, [str(each) for each in options], catch_exceptions=False)
    assert '5 surfaces: instrument known / left out' in done.output
    assert 'untouched: removed 25.000% / 25.000% (median)' in done.output
    every = {'simulated', *(f'instrument-{place}' for place in range(4))}
    assert trained['simulated'] == {'simulated'}
    assert trained['all'] == every
    left_out = [every - trained[f'without-{place}'] for place in range(3)]
    assert sorted(len(each) for each in left_out) == [1, 1, 2]
    assert set().union(*left_out) == every - {'simulated'}
    instruments = ['Bruker AFM', 'GelSight photometric', 'Zygo interferometer', 'unheard_of']
    assert sorted(name for name, judge in judged if judge == 'all') == sorted(
        name.split('/')[-1] for name in NAMES
    )
    apart = [(name, judge) for name, judge in judged if judge != 'all']
    assert len(apart) == len(NAMES)
    for name, judge in apart:
        assert f'instrument-{instruments.index(instrument_of(name))}' not in trained[judge]
    with out.open() as file:
        rows = {row['surface']: row for row in csv.DictReader(file)}
    assert rows['afm_icon_a']['instrument'] == rows['afm_dimv_b']['instrument'] == 'Bruker AFM'
    assert rows['unheard_of']['instrument'] == 'unheard_of'
    for row in rows.values():
        assert (row['F1, ellipses 5 %: known'], row['F1, ellipses 5 %: left out']) == ('0.000', '1.000')


@pytest.mark.parametrize(('number', 'folds'), [(1, 1), (3, 3), (40, 4)])
def test_each_instrument_is_in_one_fold_and_no_fold_is_empty(number, folds):
    made = leave_out.folds_of(list('abcd'), number)
    assert len(made) == folds
    assert sorted(each for fold in made for each in fold.instruments) == list('abcd')
    assert all(fold.instruments for fold in made)


def test_the_command_trains_on_the_truth_alone_and_can_go_on(data, tmp_path):
    for name in NAMES[2:]:
        (data / f'{name}.npz').unlink()
    out = tmp_path / 'folds.csv'
    options = ['--data', data, '--work', tmp_path / 'work', '-o', out, '--folds', 1, '--simulated', 1]
    arguments = [str(each) for each in (*options, '--first', 2, '--steps', 1)]
    first = CliRunner().invoke(leave_out.command, arguments, catch_exceptions=False)
    content = out.read_bytes()
    again = CliRunner().invoke(leave_out.command, arguments, catch_exceptions=False)
    assert 'simulated: step 2 of 2' in first.output
    assert 'step' not in again.output  # what was trained is used again
    assert out.read_bytes() == content
    other = CliRunner().invoke(leave_out.command, [*arguments, '--seed', '2'])
    assert 'was begun with other options or surfaces: give another --work' in str(other.exception)
    assert not list(tmp_path.rglob('*.teacher.npy'))


def test_a_folder_without_surfaces_is_named(tmp_path):
    options = ['--data', tmp_path, '--work', tmp_path / 'work', '-o', tmp_path / 'folds.csv']
    done = CliRunner().invoke(leave_out.command, [str(each) for each in options])
    assert done.exit_code == 2
    assert 'holds no surface to train on' in done.output
