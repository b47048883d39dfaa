# SPDX-License-Identifier: Apache-2.0
"""Rounding to 8 bits: the same answers but for the rounding, in the same bytes each time."""

import numpy as np
import pytest

pytest.importorskip('scipy')
torch = pytest.importorskip('torch')
onnx = pytest.importorskip('onnx')
runtime = pytest.importorskip('onnxruntime')

from socialcircle_ros.circle.network import NetworkJudge  # noqa: E402 the others need PyTorch
from socialcircle_ros.circle.network.features import INPUTS, channels_of  # noqa: E402
from socialcircle_ros.studies.learned import corpus, integers, training  # noqa: E402
from socialcircle_ros.studies.learned.export import write_onnx  # noqa: E402
from socialcircle_ros.studies.learned.integers import write_integers  # noqa: E402
from socialcircle_ros.studies.learned.network import Network  # noqa: E402
from socialcircle_ros.studies.learned.teacher import ask_teacher  # noqa: E402
from socialcircle_ros.studies.learned.training import Corpus, Trainer, Training  # noqa: E402

torch.set_num_threads(1)


@pytest.fixture(scope='module', autouse=True)
def small():
    with pytest.MonkeyPatch.context() as patch:
        for module, name, value in (
            (corpus, 'SHARD', 2), (training, 'SHARD', 2), (training, '_SIDE', 32), (training, '_EVERY', 50)
        ):  # fmt: skip
            patch.setattr(module, name, value)
        yield


@pytest.fixture(scope='module')
def crops(tmp_path_factory):
    folder = tmp_path_factory.mktemp('corpus')
    corpus.make_corpus(folder, [], [7], lambda step: None)
    ask_teacher(folder, lambda step: None)
    return Corpus(folder)


@pytest.fixture(scope='module')
def files(crops, tmp_path_factory):
    """A network that was trained a little, and the same rounded twice."""
    folder = tmp_path_factory.mktemp('network')
    torch.manual_seed(2)
    trainer = Trainer(crops, Training(steps=60, batch=4), Network())
    trainer.run(folder / 'state', lambda step, loss: None)
    trained = folder / 'trained.onnx'
    write_onnx(trainer.averaged(), {'trained_on': '["a"]'}, trained)
    rounded = [folder / f'{name}.onnx' for name in ('rounded', 'again')]
    for path in rounded:
        write_integers(trained, crops, path)
    return trained, *rounded


def damaged(shape):
    heights = np.random.default_rng(3).normal(size=shape).astype(np.float32)
    heights[20:26, 30:40] += 20
    return heights


def probabilities_of(network, heights):
    """The probabilities of a network that takes and gives floats, by the definition of its input and output."""
    session = runtime.InferenceSession(network, providers=['CPUExecutionProvider'])
    channels, grain = channels_of(heights)
    rows, columns = (-(-size // 32) * 32 for size in heights.shape)
    planes = np.full((1, INPUTS, rows // 2, columns // 2), grain, np.float32)
    padded = np.pad(channels, [(0, 0), (0, rows - heights.shape[0]), (0, columns - heights.shape[1])])
    planes[:, :-4] = torch.nn.functional.pixel_unshuffle(torch.from_numpy(padded)[None], 2)
    (logits,) = session.run(['logits'], {'features': planes})
    logits = torch.nn.functional.pixel_shuffle(torch.from_numpy(logits), 2)[0, 0].numpy()
    return 1 / (1 + np.exp(-logits[: heights.shape[0], : heights.shape[1]].astype(np.float64)))


def test_rounding_changes_probabilities_a_little(files):
    trained, rounded, _ = files
    heights = damaged((70, 90))
    exact = probabilities_of(trained.read_bytes(), heights)
    found = NetworkJudge(rounded, threads=1).probabilities(heights) / 255
    assert np.ptp(exact) > 0.1
    assert 0 < np.abs(exact - found).max() < 0.2
    assert np.abs(exact - found).mean() < 0.05


@pytest.mark.parametrize('shape', [(1, 1), (37, 70), (64, 96)])
def test_bytes_in_and_out_and_copies_change_nothing(files, crops, shape):
    trained, rounded, _ = files
    heights = damaged(shape)
    expected = probabilities_of(integers.rounded(trained, crops).SerializeToString(), heights)
    found = NetworkJudge(rounded, threads=1).probabilities(heights)
    np.testing.assert_array_equal(found, np.floor(255 * expected + 0.5))


def test_the_card_stays_and_weights_are_integers(files):
    model = onnx.load(files[1])
    card = {entry.key: entry.value for entry in model.metadata_props}
    assert card.items() >= {entry.key: entry.value for entry in onnx.load(files[0]).metadata_props}.items()
    graph = model.graph
    assert not [node for node in graph.node if node.op_type == 'Resize']
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
