# SPDX-License-Identifier: Apache-2.0
"""Compiling before the first cloud comes."""

import importlib.util
import os
import subprocess
import sys

import numpy as np
import pytest

from socialcircle_ros.circle import network
from socialcircle_ros.focus import registration
from socialcircle_ros.node import warm_up

# Two kernels that compile fast stand for those of clouds and of stacks, here and in the helper processes.
FEW_KERNELS = """
import numpy as np
from socialcircle_ros.kernels import compiled
from socialcircle_ros.messages import gray
from socialcircle_ros.node import warm_up

warm_up._filter = lambda *settings: compiled._nothing()
warm_up._see = lambda: None
warm_up._measure = lambda kind: gray.gray_of_mosaic(np.zeros((6, 8), kind))
"""

PROGRAM = f"""
import subprocess
{FEW_KERNELS}
start = subprocess.Popen
subprocess.Popen = lambda line, **options: start([*line[:2], {FEW_KERNELS!r} + line[2]], **options)
warm_up._compile_common('paper', 'rules', cold=warm_up._is_cold())
for kernel in (compiled._nothing, gray.gray_of_mosaic):
    print(sum(kernel.stats.cache_misses.values()), sum(kernel.stats.cache_hits.values()))
"""


NODE_PATH = """
import sys

import numpy as np

from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.point_cloud import encode_point_cloud
from socialcircle_ros.node import warm_up
from socialcircle_ros.pipeline.clouds import process_cloud
from socialcircle_ros.settings import CircleSettings, PipelineSettings


def signatures():
    modules = [module for name, module in sys.modules.items() if name.startswith('socialcircle_ros')]
    values = [value for module in modules for value in vars(module).values()]
    kernels = {each for each in values if hasattr(each, 'nopython_signatures') and not isinstance(each, type)}
    return {kernel.__module__ + '.' + kernel.__name__: len(kernel.signatures) for kernel in kernels}


def far_off(kind):
    rows, columns = np.mgrid[:120, :160]
    heights = np.random.default_rng(1).normal(size=rows.shape)
    heights[40:56, 60:76] += 1000
    return encode_point_cloud(Header(), np.dstack([columns, rows, heights]).astype(kind))


for mode, judge in ((CircleSettings().mode, 'rules'), ('paper', 'rules'), ('adaptive', 'network')):
    warm_up._compile_common(mode, judge, cold=False)
    before = signatures()
    settings = PipelineSettings(circle=CircleSettings(mode=mode, judge=judge))
    for kind in (np.float32, np.float64):
        for cloud in (warm_up._cloud(kind), far_off(kind)):
            message = memoryview(bytearray(cloud))  # writable, as the node takes it from the middleware
            process_cloud(message, lambda topic, output: None, settings, lend=True)
    print({name: count for name, count in signatures().items() if count != before.get(name, 0)})
"""


def test_the_first_cloud_of_a_node_compiles_nothing():
    done = subprocess.run([sys.executable, '-c', NODE_PATH], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ['{}', '{}', '{}']


LESSON = """
import numpy as np

from socialcircle_ros.circle.adaptive import LessonJudge, communities, find_outliers
from socialcircle_ros.node import warm_up
from socialcircle_ros.settings.lessons import TRAITS, WEIGHTS, Lesson

warm_up._compile_common('adaptive', 'rules', cold=False)
list(call() for call in warm_up._rare())
before = len(communities._measure.signatures)
scales = (0.0,) * len(TRAITS), (1.0,) * len(TRAITS)
lesson = Lesson(('a',), (0.0, 9.0), 'rules', 0.955, *scales, (1.0,) * WEIGHTS, 0.5, {})
heights = np.random.default_rng(1).normal(size=(60, 70)).astype(np.float32)
heights[20:24, 30:35] += 30
find_outliers(heights, judge=LessonJudge(lesson))
print(before, len(communities._measure.signatures))
"""


def test_the_first_cloud_with_a_lesson_compiles_nothing():
    done = subprocess.run([sys.executable, '-c', LESSON], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ['1', '1']


def test_the_network_is_read_and_its_provider_tried_before_the_first_cloud(monkeypatch):
    read = []

    class Nothing:
        def probabilities(self, heights):
            return np.zeros(heights.shape, np.uint8)

    monkeypatch.setattr(network, 'packaged_network', lambda provider: read.append(provider) or Nothing())
    warm_up._filter('adaptive', 'network', 'CPUExecutionProvider')
    assert set(read) == {'CPUExecutionProvider'}


WITHOUT_SCIPY = f"""
import sys
{FEW_KERNELS}
warm_up.WarmUp().wait(lambda: True, 'paper', 'rules', 'CPUExecutionProvider')
print([name for name in sys.modules if name.startswith('scipy.linalg')])
import scipy.linalg
"""


@pytest.mark.skipif(importlib.util.find_spec('scipy') is None, reason='scipy is not installed')
def test_the_kernels_load_without_the_linear_algebra_of_scipy_which_stays_importable():
    done = subprocess.run([sys.executable, '-c', WITHOUT_SCIPY], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ['[]']


def compiled_and_loaded():
    """How often a new process compiled and loaded the kernel of clouds, and that of stacks."""
    done = subprocess.run([sys.executable, '-c', PROGRAM], capture_output=True, text=True, check=True)
    return [tuple(int(word) for word in line.split()) for line in done.stdout.splitlines()]


def test_the_first_start_compiles_in_other_processes_and_the_second_not_at_all(tmp_path, monkeypatch):
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path))

    assert compiled_and_loaded() == [(0, 1), (0, 1)]
    written = {path: path.stat().st_mtime_ns for path in tmp_path.rglob('*.nbc')}
    assert {path.name.partition('-')[0].rpartition('.')[2] for path in written} >= {'_nothing', 'gray_of_mosaic'}
    assert compiled_and_loaded() == [(0, 1), (0, 1)]
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob('*.nbc')} == written


def test_the_helper_ends_with_the_process_that_asked_for_it(tmp_path, monkeypatch):
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path))
    helper = warm_up._helper('stack')
    assert os.getsid(helper.pid) != os.getsid(0)  # Ctrl-C in a terminal does not reach it

    helper.stdin.close()

    assert helper.wait(60) == 0
    assert not list(tmp_path.rglob('*_fit-*.nbc'))


def test_without_a_helper_process_this_one_compiles_everything(monkeypatch):
    def refuse(*_, **__):
        raise OSError('no more processes')

    measured = []
    monkeypatch.setattr(warm_up, '_measure', measured.append)
    monkeypatch.setattr(subprocess, 'Popen', refuse)

    warm_up._compile_common('paper', 'rules', cold=True)

    assert measured == [np.uint8]


def test_where_no_cache_can_be_written_no_helper_compiles_for_it(tmp_path, monkeypatch):
    monkeypatch.setattr(subprocess, 'Popen', None)
    for folder in (None, str(tmp_path / 'none')):
        monkeypatch.setattr(warm_up, 'cache_folder', lambda folder=folder: folder)
        assert warm_up._helper('rare') is None


RARE = f"""
import subprocess
{FEW_KERNELS}
import os, sys
FEW = {FEW_KERNELS!r} + '''
warm_up._rare = lambda: [lambda: gray.gray_of_mosaic(np.zeros((6, 8), np.uint8)), warm_up._all_rare()]
'''
start, helpers = subprocess.Popen, []
subprocess.Popen = lambda line, **options: helpers.append(1) or start([*line[:2], FEW + line[2]], **options)
warm_up._cache_rare()
print(len(helpers), len(gray.gray_of_mosaic.signatures))
gray.gray_of_mosaic(np.zeros((6, 8), np.uint8))
print(sum(gray.gray_of_mosaic.stats.cache_misses.values()))
"""


def printed(program):
    """The words that a process of its own prints."""
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True, check=True)
    return done.stdout.split()


def test_rare_kernels_are_compiled_once_by_a_helper_and_loaded_only_when_they_are_used(tmp_path, monkeypatch):
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path))
    assert [printed(RARE) for _ in range(2)] == [['1', '0', '0'], ['0', '0', '0']]


def test_rare_kernels_are_compiled_again_after_any_change_of_the_package(tmp_path, monkeypatch):
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path))
    one_file = 'warm_up.Path.rglob = lambda *_: [warm_up.Path(compiled.__file__)]'
    changed = RARE.replace('warm_up._see =', f'{one_file}; warm_up._see =')
    assert [printed(each)[0] for each in (RARE, changed, changed, RARE)] == ['1', '1', '0', '0']


def test_a_helper_that_ended_too_early_is_started_again(tmp_path, monkeypatch):
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path))
    ended = RARE.replace('warm_up._all_rare()]', 'lambda: __import__("os")._exit(1)]')
    assert [printed(each)[0] for each in (ended, RARE)] == ['1', '1']


def test_where_nothing_can_be_cached_this_process_compiles_what_is_rare(monkeypatch):
    compiled = []
    monkeypatch.setattr(warm_up, 'is_warm', lambda: False)
    monkeypatch.setattr(warm_up, '_helper', lambda part: None)
    monkeypatch.setattr(warm_up, '_rare', lambda: [lambda: compiled.append(1)] * 2)
    warm_up._cache_rare()
    assert compiled == [1, 1]


def test_a_rare_kernel_that_cannot_be_compiled_leaves_the_others(monkeypatch):
    compiled = []

    def fail():
        raise RuntimeError('cannot be compiled')

    monkeypatch.setattr(warm_up, '_rare', lambda: [fail, lambda: compiled.append(1)])
    warm_up._compile_rare()
    assert compiled == [1]


@pytest.mark.parametrize('kind', [np.uint8, np.uint16])
def test_frames_that_are_registered_are_warmed_up(kind, monkeypatch):
    moved = []
    resample = registration._resample
    monkeypatch.setattr(registration, '_resample', lambda *given: (moved.append(given[0].dtype), resample(*given)))
    warm_up._register(kind)
    assert moved == [kind, kind]
