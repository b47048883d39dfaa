# SPDX-License-Identifier: Apache-2.0
"""`python -m socialcircle_ros.studies.learned`, from the data to the file."""

import csv
import json
import sys

import pytest
from click.testing import CliRunner
from studies.learned.small import few_small_crops, write_surfaces

pytest.importorskip('scipy')
torch = pytest.importorskip('torch')
pytest.importorskip('onnx')
pytest.importorskip('onnxruntime')
pytest.importorskip('matplotlib')

from socialcircle_ros.circle.network import NetworkJudge  # noqa: E402 the others need PyTorch
from socialcircle_ros.studies.learned import corpus, training  # noqa: E402
from socialcircle_ros.studies.learned.__main__ import command  # noqa: E402


@pytest.fixture
def data(tmp_path, monkeypatch):
    torch.set_num_threads(1)
    few_small_crops(monkeypatch, corpus, training)
    return write_surfaces(tmp_path / 'data', ('plate', 'training/film'))


def run(data, work, out, *options):
    arguments = ['--data', data, '--work', work, '-o', out, '--files', 1, '--workers', 1, '--leave-out', 'film']
    return CliRunner().invoke(command, [str(each) for each in (*arguments, *options)], catch_exceptions=False)


def test_one_command_makes_the_corpus_and_trains_and_can_go_on(data, tmp_path):
    work, out = tmp_path / 'work', tmp_path / 'network.onnx'
    done = run(data, work, out, '--steps', 2)
    assert '1 of 2 surfaces' in done.output
    judge = NetworkJudge(out, threads=1)
    assert json.loads(judge.card['trained_on']) == ['plate']
    assert json.loads(judge.card['held_out']) == ['film']
    run(data, work, out, '--steps', 3)
    with (work / 'curve.csv').open() as file:
        assert [row['step'] for row in csv.DictReader(file)] == ['1', '2', '3']
    assert (work / 'curve.png').read_bytes().startswith(b'\x89PNG')
    again = run(
        data, tmp_path / 'further', tmp_path / 'further.onnx', '--steps', 1, '--from', work / 'trained.onnx'
    )
    assert again.exit_code == 0
    further = NetworkJudge(tmp_path / 'further.onnx', threads=1)
    assert [further.card[name] for name in ('trained_on', 'held_out')] == ['["plate"]', '["film"]']


def test_a_network_needs_a_surface_to_be_trained_on(data, tmp_path):
    done = run(data, tmp_path / 'work', tmp_path / 'network.onnx', '--leave-out', 'plate')
    assert done.exit_code == 2
    assert 'no surface is left to train on' in done.output


def test_what_is_not_installed_is_named_with_the_command_that_installs_it(data, tmp_path, monkeypatch):
    for name in [each for each in sys.modules if each.startswith('socialcircle_ros.studies.learned.')]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, 'torch', None)
    done = run(data, tmp_path / 'work', tmp_path / 'network.onnx')
    assert done.exit_code == 1
    assert 'The training needs torch: pip install' in done.output
