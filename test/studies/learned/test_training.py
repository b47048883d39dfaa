# SPDX-License-Identifier: Apache-2.0
"""The training, on a tiny corpus, and the file that it writes."""

import json

import numpy as np
import pytest

pytest.importorskip('scipy')
torch = pytest.importorskip('torch')
pytest.importorskip('onnx')
runtime = pytest.importorskip('onnxruntime')

from socialcircle_ros.circle.network.features import INPUTS, channels_of  # noqa: E402 the others need PyTorch
from socialcircle_ros.circle.network.scales import scales_of  # noqa: E402
from socialcircle_ros.errors import SocialCircleError  # noqa: E402
from socialcircle_ros.studies.learned import corpus, teacher, training  # noqa: E402
from socialcircle_ros.studies.learned.export import network_from, write_onnx  # noqa: E402
from socialcircle_ros.studies.learned.network import HALO, Network  # noqa: E402
from socialcircle_ros.studies.learned.teacher import Teacher, ask_teacher, inputs_of  # noqa: E402
from socialcircle_ros.studies.learned.training import Batch, Corpus, Trainer, Training, loss_of  # noqa: E402

torch.set_num_threads(1)  # more threads wait for each other where other tests have the cores
CARD = {'trained_on': '["a"]'}


@pytest.fixture(scope='module')
def tiny_corpus(tmp_path_factory):
    """Two patches in a file."""
    folder = tmp_path_factory.mktemp('corpus')
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(corpus, 'SHARD', 2)
        corpus.make_corpus(folder, [], [7], lambda step: None)
        torch.manual_seed(0)  # of the teacher, which is not trained
        ask_teacher(folder, lambda step: None)
    return folder


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(training, 'SHARD', 2)
    monkeypatch.setattr(training, '_SIDE', 32)
    monkeypatch.setattr(training, '_EVERY', 2)


def trained(folder, state, steps, **options):
    trainer = Trainer(Corpus(folder), Training(steps=steps, batch=2, **options))
    if state.exists():
        trainer.resume(state)
    trainer.run(state, lambda step, loss: None, every=2)
    return trainer


@pytest.mark.usefixtures('small')
def test_a_training_that_was_stopped_goes_on_as_if_it_was_not(tiny_corpus, tmp_path):
    whole = trained(tiny_corpus, tmp_path / 'whole', 4, cooling=0.0)
    trained(tiny_corpus, tmp_path / 'parts', 2, cooling=0.0)
    parts = trained(tiny_corpus, tmp_path / 'parts', 4, cooling=0.0)
    assert parts.step == 4
    assert [step for step, _ in parts.curve] == [2, 4]
    for name, value in whole.mean.items():
        assert torch.equal(value, parts.mean[name]), name


class Certain(torch.nn.Module):
    """A teacher that takes every point for an outlier."""

    def forward(self, planes):
        return torch.full_like(planes[:, :1], 20.0)


def test_the_teacher_may_not_call_good_points_of_simulated_surfaces_outliers(tiny_corpus, tmp_path):
    path = tmp_path / '000001.npy'
    patches = np.load(tiny_corpus / '000007.npy')
    np.save(path, patches)
    teacher.write_opinions(path, [0.0, 0.0], [True, False], Certain())
    real, simulated = np.load(corpus.opinions_beside(path))
    assert (real == 255).all()
    assert np.array_equal(simulated > 0, patches[1, -1] == 2)
    assert simulated.any()


def test_a_small_patch_is_drawn_as_often_as_a_large_one_and_whole(tmp_path, monkeypatch):
    monkeypatch.setattr(training, 'SHARD', 2)
    patches = np.zeros((2, corpus.PLANES, 320, 320), np.float16)
    patches[0, :, :40, :50] = 1
    patches[1] = 2
    np.save(tmp_path / '000001.npy', patches)
    known = {'grain': [0.0, 1.0], 'shape': [[40, 50], [320, 320]], 'real': [True, True]}
    (tmp_path / '000001.json').write_text(json.dumps(known))
    crops = Corpus(tmp_path, taught=False)
    random = np.random.default_rng(0)
    drawn = [crops._crop(random) for _ in range(60)]
    small = [crop for crop, _, grain in drawn if grain == 0]
    assert 15 < len(small) < 45
    assert all(np.count_nonzero(crop[-1]) == 40 * 50 for crop in small)


@pytest.mark.usefixtures('small')
def test_training_lowers_the_loss_on_what_it_sees(tiny_corpus):
    trainer = Trainer(Corpus(tiny_corpus), Training(steps=12, batch=2))
    batch = trainer.corpus.batch(2, np.random.default_rng(0))
    losses = [float(trainer._one_step(batch)) for _ in range(12)]
    assert losses[-1] < losses[0]


@pytest.mark.usefixtures('small')
def test_the_norms_of_the_averaged_network_are_those_of_its_weights_on_the_corpus(tiny_corpus):
    trainer = Trainer(Corpus(tiny_corpus), Training(steps=12, batch=2, rate=0.05))
    for _ in trainer._losses():
        pass
    averaged = trainer.averaged()
    first = averaged.down[0][0]
    crops = [
        trainer.corpus.batch(4, np.random.default_rng([trainer.training.seed, number, training._NORM_SEED]))
        for number in range(training._NORM_BATCHES)
    ]
    with torch.no_grad():
        seen = torch.stack([first.weights(crop.planes).mean((0, 2, 3)) for crop in crops]).mean(0)
    after = abs(first.norm.running_mean - seen).max()
    assert after < 0.01  # bfloat16
    assert abs(trainer.mean['down.0.0.norm.running_mean'] - seen).max() > 5 * after
    again = trainer.averaged()
    assert all(torch.equal(value, again.state_dict()[name]) for name, value in averaged.state_dict().items())


def test_a_corpus_is_made_once(tiny_corpus):
    before = {path: path.stat().st_mtime_ns for path in tiny_corpus.iterdir()}
    corpus.make_corpus(tiny_corpus, [], [7], lambda step: None)
    ask_teacher(tiny_corpus, lambda step: None)
    assert {path: path.stat().st_mtime_ns for path in tiny_corpus.iterdir()} == before


def test_a_corpus_without_the_teacher_is_refused(tmp_path):
    np.save(tmp_path / '000001.npy', np.zeros(3))
    with pytest.raises(FileNotFoundError, match='no file of a corpus that has the probabilities of the teacher'):
        Corpus(tmp_path)


def test_a_teacher_without_weights_says_where_to_train(tmp_path, monkeypatch):
    monkeypatch.setattr(teacher, 'WEIGHTS', tmp_path / 'teacher.pt')
    with pytest.raises(SocialCircleError, match=r'teacher\.pt is not there: train in a checkout'):
        Teacher()


def test_a_corpus_of_other_surfaces_is_refused(tiny_corpus):
    class Other:
        name = 'other'

    with pytest.raises(SocialCircleError, match='was made from other surfaces'):
        corpus.make_corpus(tiny_corpus, [Other()], [8], lambda step: None)


def test_points_that_do_not_count_do_not_change_the_loss():
    batch = labelled([0, 1, 2], [0, 0, 255])
    first, second = (
        loss_of(torch.tensor([value, -1.0, 2.0]).reshape(1, 1, 1, 3), batch, Training()) for value in (-9.0, 9.0)
    )
    assert torch.equal(first, second)


def labelled(labels, opinions):
    parts = (torch.tensor(part, dtype=torch.uint8).reshape(1, 1, 1, -1) for part in (labels, opinions))
    return Batch(torch.zeros(0), *parts)


@pytest.mark.parametrize(('trust', 'best'), [(0.0, 1.0), (0.5, 0.75), (1.0, 0.5)])
def test_what_is_learned_lies_between_the_truth_and_the_teacher(trust, best):
    batch = labelled([2, 1], [128, 0])
    chances = torch.linspace(0.01, 0.99, 99)
    losses = [
        float(loss_of(torch.stack([torch.logit(chance), torch.tensor(-9.0)]).reshape(1, 1, 1, 2), batch,
                      Training(trust=trust, dice=0.0)))
        for chance in chances
    ]  # fmt: skip
    assert abs(float(chances[int(np.argmin(losses))]) - best) < 0.015


def test_the_teacher_gets_natural_logarithms_of_what_the_network_gets():
    heights = np.random.default_rng(2).normal(size=(40, 56)).astype(np.float32)
    channels, grain = channels_of(heights)
    planes = inputs_of(channels, grain)
    scales = scales_of(heights)
    second = np.zeros(heights.shape)
    second[:, 1:-1] = (heights[:, 2:] - 2 * heights[:, 1:-1] + heights[:, :-2]) / scales.spread
    expected = np.sign(second) * np.log1p(np.abs(second))
    assert np.allclose(planes[3][:, 1:-1], expected[:, 1:-1], atol=1e-3)
    assert np.array_equal(planes[5], channels[5])
    assert np.allclose(planes[6], grain * np.log(2))


def test_the_teacher_finds_a_point_that_stands_out():
    heights = np.random.default_rng(4).normal(size=(64, 80)).astype(np.float32)
    heights[20, 33] += 40
    with torch.no_grad():
        logits = Teacher()(torch.from_numpy(inputs_of(*channels_of(heights)))[None])[0, 0]
    assert (logits > 0).nonzero().tolist() == [[20, 33]]


@pytest.fixture(scope='module')
def network():
    torch.manual_seed(5)
    made = Network().eval()
    for module in made.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            module.running_mean.normal_()
            module.running_var.uniform_(0.5, 2)
    made.up[3][0].norm.running_var.mul_(2e5)  # beyond float16, as trainings made it
    return made


@pytest.fixture(scope='module')
def file(network, tmp_path_factory):
    path = tmp_path_factory.mktemp('network') / 'network.onnx'
    write_onnx(network, CARD, path)
    return path


def test_the_file_gives_what_the_network_gives(file):
    again = network_from(file).eval()
    planes = torch.randn(2, INPUTS, 48, 32)
    session = runtime.InferenceSession(str(file))
    (logits,) = session.run(['logits'], {'features': planes.numpy()})
    with torch.no_grad():
        assert np.allclose(logits, again(planes).numpy(), atol=1e-4)


def test_a_network_of_another_shape_is_refused(tmp_path):
    narrow = Network()
    narrow.last = torch.nn.Conv2d(8, 4, 1)
    write_onnx(narrow, CARD, tmp_path / 'narrow.onnx')
    with pytest.raises(SocialCircleError, match=r'narrow\.onnx holds a network of another shape'):
        network_from(tmp_path / 'narrow.onnx')


def test_half_precision_of_the_weights_changes_little(network, file):
    planes = torch.randn(1, INPUTS, 32, 32)
    assert torch.equal(network_from(file).up[3][0].norm.running_var, network.up[3][0].norm.running_var)
    with torch.no_grad():
        assert torch.allclose(network(planes), network_from(file).eval()(planes), atol=0.02)


def test_the_same_weights_give_the_same_bytes(network, file, tmp_path):
    write_onnx(network, CARD, tmp_path / 'again.onnx')
    assert (tmp_path / 'again.onnx').read_bytes() == file.read_bytes()
    assert file.stat().st_size < 2_000_000


def test_no_point_beyond_the_halo_matters(network):
    planes = torch.randn(1, INPUTS, 256, 16, requires_grad=True)
    network(planes)[0, 0, 128, 8].backward()
    rows = torch.nonzero(planes.grad[0].abs().sum((0, 2))).flatten()
    assert 2 * max(128 - int(rows.min()), int(rows.max()) - 128) <= HALO
