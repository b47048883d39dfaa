# SPDX-License-Identifier: Apache-2.0
"""The packaged network: what it says of itself, and what it judges."""

import json
import math
import subprocess
import sys
import textwrap

import numpy as np
import pytest

from socialcircle_ros import CircleSettings, remove_outliers
from socialcircle_ros.circle.adaptive.likelihood import ONE
from socialcircle_ros.circle.network import inference
from socialcircle_ros.circle.network.inference import WEIGHTS, NetworkJudge, packaged_network
from socialcircle_ros.errors import SettingError, SocialCircleError
from socialcircle_ros.kernels import bands
from socialcircle_ros.settings import CPU_PROVIDER
from socialcircle_ros.studies.learned.surfaces import DEVELOPMENT, HELD_OUT

OTHER = 'NoExecutionProvider'


@pytest.fixture(scope='module')
def judge():
    return NetworkJudge(WEIGHTS, threads=1)


def test_the_file_is_small():
    assert WEIGHTS.stat().st_size < 2_000_000


def test_the_file_names_what_it_was_trained_on_and_what_was_left_out(judge):
    trained, left_out = (set(json.loads(judge.card[name])) for name in ('trained_on', 'held_out'))
    assert left_out == set(HELD_OUT)
    assert trained >= set(DEVELOPMENT)
    assert not trained & left_out


def noise(height=130, width=170):
    return np.random.default_rng(6).normal(size=(height, width)).astype(np.float32)


def damaged():
    """Noise with a spike, a patch and a hole."""
    heights = noise()
    heights[40, 60] += 30
    heights[80:86, 100:107] -= 25
    heights[20:30, 20:25] = np.nan
    return heights


def test_spikes_and_patches_are_probable_and_noise_is_not(judge):
    heights = damaged()
    found = judge.probabilities(heights)
    assert found[40, 60] > 0.8 * ONE
    assert found[80:86, 100:107].mean() > 0.8 * ONE
    assert not found[20:30, 20:25].any()
    assert (found > 0.8 * ONE).sum() < 60


@pytest.mark.parametrize('factor', [2.0**-40, 8.0])
def test_a_power_of_two_changes_nothing(judge, factor):
    np.testing.assert_array_equal(
        judge.probabilities(damaged() * np.float32(factor)), judge.probabilities(damaged())
    )


def test_offset_and_tilt_change_rounding_alone(judge):
    # A last bit of a height may move an input by one of its 8-bit steps.
    rows, columns = np.mgrid[:130, :170]
    tilted = (damaged() + 50 + 0.3 * columns - 2 * rows).astype(np.float32)
    change = np.abs(np.subtract(judge.probabilities(tilted), judge.probabilities(damaged()), dtype=np.int16))
    assert np.quantile(change, 0.98) <= 0.01 * ONE
    assert np.quantile(change, 0.999) <= 0.05 * ONE
    assert change.max() < 0.2 * ONE


def test_tiles_change_nothing(judge, monkeypatch):
    heights = np.tile(damaged(), (2, 4))[:255, :601]
    whole = judge.probabilities(heights)
    monkeypatch.setattr(inference, 'WHOLE', 1000)
    monkeypatch.setattr(inference, 'TILE', 256)
    np.testing.assert_array_equal(judge.probabilities(heights), whole)


@pytest.mark.parametrize('shape', [(33, 5000), (5000, 33), (1, 8000)])
def test_tiles_of_thin_clouds_change_nothing(judge, monkeypatch, shape):
    heights = noise(*shape)
    heights.ravel()[:: heights.size // 97] += 30
    whole = judge.probabilities(heights)
    monkeypatch.setattr(inference, 'WHOLE', 1000)
    monkeypatch.setattr(inference, 'TILE', 32)
    np.testing.assert_array_equal(judge.probabilities(heights), whole)


class Session:
    """Stands in for a session of ONNX Runtime, and counts what it would compute."""

    def __init__(self):
        self.points = []

    def run(self, _, inputs):
        squares = inputs[inference.FEATURES]
        self.points.append(squares[..., 0].size * 4)
        return (np.zeros((*squares.shape[:3], 4), np.uint8),)


SHAPES = [(1, 1_400_000), (1_400_000, 1), (2, 90_000), (100, 14_500), (900, 2500), (2500, 900), (1180, 1180)]


@pytest.mark.parametrize('shape', SHAPES)
def test_a_tile_takes_as_much_memory_as_is_stated_whatever_the_shape(judge, monkeypatch, shape):
    session = Session()
    monkeypatch.setattr(judge, '_session', session)
    judge.probabilities(noise(*shape))
    assert max(session.points) <= inference.WHOLE


@pytest.mark.parametrize('shape', [each for each in SHAPES if min(each) <= 100])
def test_the_tiles_of_a_thin_cloud_are_hardly_more_than_the_cloud(judge, monkeypatch, shape):
    session = Session()
    monkeypatch.setattr(judge, '_session', session)
    judge.probabilities(noise(*shape))
    multiple = int(judge.card['multiple'])
    assert sum(session.points) <= 1.05 * math.prod(-(-size // multiple) * multiple for size in shape)


def test_the_number_of_threads_changes_nothing(judge):
    heights = np.tile(damaged(), (2, 2))
    np.testing.assert_array_equal(
        NetworkJudge(WEIGHTS, threads=2).probabilities(heights), judge.probabilities(heights)
    )


@pytest.mark.parametrize('shape', [(1, 1), (1, 40), (33, 2), (31, 65)])
def test_clouds_of_any_size_are_judged(judge, shape):
    found = judge.probabilities(np.random.default_rng(1).normal(size=shape).astype(np.float32))
    assert found.shape == shape
    assert found.dtype == np.uint8


def test_the_packaged_network_is_read_once(monkeypatch):
    monkeypatch.setattr(bands, 'limit', 1)
    assert packaged_network() is packaged_network()


FORK = """
    import os, sys
    import numpy as np
    from socialcircle_ros.circle.network import packaged_network
    from socialcircle_ros.kernels import bands

    bands.limit = 2
    heights = np.random.default_rng(1).normal(size=(60, 80)).astype(np.float32)
    heights[20, 30] = 60
    found = packaged_network().probabilities(heights)
    child = os.fork()
    same = np.array_equal(packaged_network().probabilities(heights), found)
    if child == 0:
        sys.exit(3 if same else 4)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), same)
    """


def test_a_forked_process_reads_the_network_again():
    # A session holds threads that a child process does not have: to drop it there would wait for ever.
    program = [sys.executable, '-c', textwrap.dedent(FORK)]
    done = subprocess.run(program, capture_output=True, text=True, check=True, timeout=300)
    assert done.stdout == '3 True\n'


def test_the_filter_uses_the_network():
    heights = damaged()
    result = remove_outliers(heights, CircleSettings(judge='network'), pitch=(1.0, 2.0))
    assert result.outliers[40, 60]
    assert result.outliers[80:86, 100:107].mean() > 0.9
    assert result.outliers.sum() < 60
    np.testing.assert_array_equal(result.score > 0.5, result.outliers)
    np.testing.assert_array_equal(np.isnan(result.score), np.isnan(heights))
    assert np.nanmin(result.score) >= 0
    assert np.nanmax(result.score) <= 1
    assert 'network' in result.times_ms
    finer = remove_outliers(heights * np.float32(2**-30), CircleSettings(judge='network'), pitch=(1.0, 2.0))
    np.testing.assert_array_equal(finer.outliers, result.outliers)
    np.testing.assert_array_equal(finer.score, result.score)


def test_the_rules_decide_where_the_depth_of_field_is_known():
    with_network, rules = (
        remove_outliers(damaged(), CircleSettings(judge=judge, depth_of_field=3.0), pitch=(1.0, 2.0))
        for judge in ('network', 'rules')
    )
    np.testing.assert_array_equal(with_network.outliers, rules.outliers)
    np.testing.assert_array_equal(with_network.score, rules.score)
    assert 'network' not in with_network.times_ms


@pytest.mark.parametrize(
    'error',
    [
        RuntimeError('posix/env.cc:PosixThread pthread_create failed, error code: 11\nand a trace'),
        RuntimeError('Failed to allocate memory for requested buffer of size 64'),
        RuntimeError('std::bad_alloc'),
        MemoryError(),
    ],
)
def test_where_memory_or_threads_are_short_the_file_is_not_blamed(monkeypatch, error):
    onnxruntime = pytest.importorskip('onnxruntime')

    def fail(*_, **__):
        raise error

    monkeypatch.setattr(onnxruntime, 'InferenceSession', fail)
    with pytest.raises(SocialCircleError, match='^Memory or threads are short, so that network.onnx') as raised:
        NetworkJudge(WEIGHTS, threads=1)
    assert '\n' not in str(raised.value)


def test_a_file_that_is_no_network_is_named(tmp_path):
    path = tmp_path / 'other.onnx'
    path.write_bytes(b'no network')
    with pytest.raises(SocialCircleError, match=r'other\.onnx cannot be read as a network'):
        NetworkJudge(path, threads=1)


def test_without_the_runtime_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, 'onnxruntime', None)
    monkeypatch.delitem(sys.modules, 'socialcircle_ros.onnx_runtime', raising=False)
    with pytest.raises(SocialCircleError, match='The network needs ONNX Runtime, .* pip install onnxruntime'):
        NetworkJudge(WEIGHTS, threads=1)


def test_another_provider_computes_the_same(judge):
    import onnxruntime

    other = next((each for each in onnxruntime.get_available_providers() if each != CPU_PROVIDER), None)
    if other is None:
        pytest.skip('this ONNX Runtime offers the CPU alone')
    settings = CircleSettings(judge='network', provider=other)
    chosen = packaged_network(settings.provider)
    one, other = (each.probabilities(damaged()) / ONE for each in (chosen, judge))
    np.testing.assert_allclose(one, other, atol=0.1)


def test_a_provider_that_is_not_offered_is_refused_with_those_that_are():
    with pytest.raises(SettingError, match=rf'circle\.provider: {OTHER} is not offered.*CPUExecutionProvider'):
        CircleSettings(judge='network', provider=OTHER)
    assert CircleSettings(judge='rules', provider=OTHER).provider == OTHER  # it has no effect


@pytest.mark.parametrize('settings', [{}, {'mode': 'paper'}])
def test_a_text_that_names_no_provider_is_refused_whether_it_is_used_or_not(settings):
    with pytest.raises(SettingError, match="circle.provider is 'gpu', which names no execution provider"):
        CircleSettings(provider='gpu', **settings)


def test_a_provider_that_fails_is_an_error_and_not_the_cpu_in_silence():
    with pytest.raises(SocialCircleError, match='circle.provider: ROCMExecutionProvider cannot be used'):
        NetworkJudge(WEIGHTS, 1, 'ROCMExecutionProvider')
