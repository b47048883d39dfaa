# SPDX-License-Identifier: Apache-2.0
"""`socialcircle bench`."""

import json
import os

import pytest
from click.testing import CliRunner

from socialcircle_ros.commands import bench
from socialcircle_ros.studies.bench import candidates, sizes


def test_ratios_are_printed_and_written_with_the_hardware(tmp_path, monkeypatch):
    monkeypatch.setattr(candidates, 'ROWS', 210)
    monkeypatch.setattr(candidates, 'COLUMNS', 240)
    done = CliRunner().invoke(bench.command, ['--repeats', '1', '--json', str(tmp_path / 'bench.json')])
    assert done.exit_code == 0, done.output
    written = json.loads((tmp_path / 'bench.json').read_text())
    names = {figure['name'] for figure in written['figures']}
    assert {'expansion', 'vote 60×60', 'exact mode', 'NumPy vote 60×60'} <= names
    assert all(figure['milliseconds'] > 0 for figure in written['figures'])
    assert any(ratio['goal']['numerator'] == 'NumPy vote 60×60' for ratio in written['ratios'])
    assert 'cores' in written['hardware']
    assert 'ratios of this run' in done.output


def test_sizes_are_printed_and_written(tmp_path, monkeypatch):
    monkeypatch.setattr(sizes, 'SIZES', ((120, 160), (240, 320)))
    path = tmp_path / 'bench.json'
    done = CliRunner().invoke(bench.command, ['--sizes', '--repeats', '1', '--json', str(path)])
    assert done.exit_code == 0, done.output
    figures = json.loads(path.read_text())['ms']
    assert [(figure['rows'], figure['columns']) for figure in figures] == [(120, 160), (240, 320)]
    assert '240 × 320' in done.output
    assert all(figure['radius_and_expansion'] > 0 for figure in figures)


def test_a_file_that_cannot_be_written_is_an_error(run):
    for words in (['--json', 'no/folder/bench.json'], ['--growth', '--plot', 'no/folder/bench.png']):
        done = run('bench', *words)
        assert done.code == 1
        assert f'{words[-1]} cannot be written' in done.err


def test_a_machine_that_cannot_lose_packets_is_an_error(run):
    pytest.importorskip('rclpy')
    done = run('bench', '--network', env=os.environ | {'PATH': '/nowhere'})
    assert done.code == 1
    assert 'need root' in done.err
    assert 'iproute2' in done.err


@pytest.mark.parametrize(
    ('words', 'sentence'),
    [
        (['--repeats', '0'], 'must be at least 1'),
        (['--sizes', '--growth'], 'give one'),
        (['--live', '--network'], 'give one'),
        (['--plot', 'growth.png'], 'give both'),
        (['--growth', '--plot', 'growth.svg'], 'choose a name such as growth.png'),
        (['--depth', '--json', 'bench.json'], '--depth writes no file'),
        (['--depth', '--repeats', '20'], 'repeats nothing'),
    ],
)
def test_options_that_contradict_each_other_are_refused(run, words, sentence):
    assert sentence in run('bench', *words).err
