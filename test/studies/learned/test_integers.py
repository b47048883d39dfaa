# SPDX-License-Identifier: Apache-2.0
"""Rounding to 8 bits: the same answers but for the rounding, in the same bytes each time."""

import numpy as np
import pytest

pytest.importorskip('scipy')
torch = pytest.importorskip('torch')
onnx = pytest.importorskip('onnx')
pytest.importorskip('onnxruntime')

from socialcircle_ros.circle.network import NetworkJudge  # noqa: E402 the others need PyTorch
from socialcircle_ros.studies.learned import corpus, training  # noqa: E402
from socialcircle_ros.studies.learned.export import write_onnx  # noqa: E402
from socialcircle_ros.studies.learned.integers import write_integers  # noqa: E402
from socialcircle_ros.studies.learned.network import Network  # noqa: E402
from socialcircle_ros.studies.learned.teacher import ask_teacher  # noqa: E402
from socialcircle_ros.studies.learned.training import Corpus, Trainer, Training  # noqa: E402

torch.set_num_threads(1)


@pytest.fixture(scope='module')
def files(tmp_path_factory):
    """A network that was trained a little, and the same rounded twice."""
    folder = tmp_path_factory.mktemp('network')
    with pytest.MonkeyPatch.context() as patch:
        for module, name, value in (
            (corpus, 'SHARD', 2), (training, 'SHARD', 2), (training, '_SIDE', 32), (training, '_EVERY', 50)
        ):  # fmt: skip
            patch.setattr(module, name, value)
        corpus.make_corpus(folder, [], [7], lambda step: None)
        ask_teacher(folder, lambda step: None)
        crops = Corpus(folder)
        torch.manual_seed(2)
        trainer = Trainer(crops, Training(steps=60, batch=4), Network())
        trainer.run(folder / 'state', lambda step, loss: None)
        trained = folder / 'trained.onnx'
        write_onnx(trainer.averaged(), {'trained_on': '["a"]'}, trained)
        rounded = [folder / f'{name}.onnx' for name in ('rounded', 'again')]
        for path in rounded:
            write_integers(trained, crops, path)
    return trained, *rounded


def test_rounding_changes_probabilities_a_little(files):
    heights = np.random.default_rng(3).normal(size=(70, 90)).astype(np.float32)
    heights[20:26, 30:40] += 20
    exact, rounded = (NetworkJudge(path, threads=1).probabilities(heights) / 255 for path in files[:2])
    assert np.ptp(exact) > 0.1
    assert 0 < np.abs(exact - rounded).max() < 0.2
    assert np.abs(exact - rounded).mean() < 0.05


def test_the_card_stays_and_weights_are_integers(files):
    trained, rounded = (NetworkJudge(path, threads=1) for path in files[:2])
    assert rounded.card == trained.card
    model = onnx.load(files[1])
    graph = model.graph
    # An older runtime refuses sets of operators that it does not have.
    assert {each.domain for each in model.opset_import} == {node.domain for node in graph.node}
    assert not [node for node in graph.node if node.op_type == 'AveragePool']
    made_by = {name: node.op_type for node in graph.node for name in node.output}
    convolutions = [node for node in graph.node if node.op_type == 'Conv']
    assert len(convolutions) > 20
    for node in convolutions:
        assert [made_by[each] for each in node.input[:2]] == ['DequantizeLinear'] * 2
    kinds = {weight.data_type for weight in graph.initializer if len(weight.dims) == 4}
    assert kinds == {onnx.TensorProto.INT8}


def test_the_same_network_and_corpus_give_the_same_bytes(files):
    assert files[1].read_bytes() == files[2].read_bytes()
