# SPDX-License-Identifier: Apache-2.0
"""Kernels, and whether they are in the cache."""

import os
import subprocess
import sys
from typing import NamedTuple

import numba
import numpy as np
import numpy.typing as npt
import pytest

from socialcircle_ros.kernels import compiled, compiling
from socialcircle_ros.kernels.compiled import kernel


class Pair(NamedTuple):
    first: npt.NDArray[np.float64]
    second: npt.NDArray[np.float64]


class Surface(NamedTuple):
    heights: npt.NDArray[np.float32]
    slopes: Pair
    predicted: bool


@kernel
def second_of(surface, row):
    return surface.heights[row, 1]


def test_it_is_known_while_a_kernel_is_compiled(tmp_path, monkeypatch):
    seen = []
    monkeypatch.setattr(numba.config, 'CACHE_DIR', str(tmp_path))  # where an earlier run left nothing
    monkeypatch.setattr(compiling, 'listeners', [lambda: seen.append(compiled.is_compiling())])

    @kernel
    def half(value):
        return value / 2

    assert half(3) == 1.5
    assert seen == [True]
    assert not compiled.is_compiling()


def test_a_kernel_runs_the_machine_code_for_the_tuple_that_is_given():
    heights = np.arange(780, dtype=np.float32).reshape(30, 26)
    slopes = Pair(np.zeros((4, 26)), np.zeros((4, 26)))
    random = np.random.default_rng(0)
    for place in range(600):
        memory = [np.zeros(size) for size in random.integers(1, 400, 8)]
        del memory  # so that other things lie in the memory that comes next
        of_rows, of_columns = heights.copy(), np.asfortranarray(heights)
        surface = Surface((of_rows, of_columns)[place % 2], slopes, predicted=False)
        assert (second_of(surface, 3), second_of(surface=surface, row=0)) == (79, 1)


CACHED = """
import sys

from socialcircle_ros.kernels import compiling
from socialcircle_ros.kernels.compiled import has_cached_code, is_cached, kernel

told = []
compiling.listeners.append(lambda: told.append('compiles'))


@kernel
def nothing():
    return 0


print(is_cached(nothing), has_cached_code(nothing), len(nothing.signatures), told)
if sys.argv[1:]:
    nothing()
    print(told)
"""


def test_a_kernel_is_cached_once_it_was_called_and_asking_compiles_nothing(tmp_path, monkeypatch):
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path / 'cache'))
    (tmp_path / 'cached.py').write_text(CACHED)
    absent, present = 'False False 0 []', 'True True 0 []'
    for call, answer in (
        ([], [absent]),
        (['call'], [absent, "['compiles']"]),
        ([], [present]),
        (['call'], [present, '[]']),
    ):
        program = [sys.executable, str(tmp_path / 'cached.py'), *call]
        assert subprocess.run(program, capture_output=True, text=True, check=True).stdout.splitlines() == answer


CALLED = """
import sys

import numpy as np

from socialcircle_ros.kernels.compiled import kernel


@kernel
def double(values):
    return 2 * values.sum()


@kernel
def more(values):
    return double(values) + 1


print(double(np.arange(4.0)), sum(double.stats.cache_hits.values()))
library = next(iter(double.overloads.values())).library
print(library._shared_module is None)
if 'more' in sys.argv:
    print(more(np.arange(4.0)))
"""


def test_bitcode_of_a_cached_kernel_is_read_when_a_kernel_that_calls_it_is_compiled(tmp_path, monkeypatch):
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path / 'cache'))
    path = tmp_path / 'called.py'
    path.write_text(CALLED)

    def run(*arguments):
        program = [sys.executable, str(path), *arguments]
        done = subprocess.run(program, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout.split()

    run()
    assert run() == ['12.0', '1', 'True']
    assert run('more') == ['12.0', '1', 'True', '13.0']


@pytest.mark.parametrize(
    ('variable', 'value', 'sentence'),
    [
        ('NUMBA_DISABLE_JIT', '1', 'NUMBA_DISABLE_JIT is set, so that each cloud would take minutes: unset it.'),
        ('NUMBA_NUM_THREADS', '0', 'Number of threads specified must be > 0. Check the variables'),
    ],
)
@pytest.mark.parametrize('module', ['commands.main', 'node.main'])
def test_a_variable_that_forbids_compiling_is_named_by_commands_and_the_node(module, variable, value, sentence):
    arguments = ['info', 'x.mcap'] if module == 'commands.main' else []
    if not arguments:
        pytest.importorskip('rclpy', reason='the node needs ROS 2')
    done = subprocess.run(
        [sys.executable, '-m', f'socialcircle_ros.{module}', *arguments],
        env={**os.environ, variable: value}, capture_output=True, text=True, check=False, timeout=100,
    )  # fmt: skip
    assert done.returncode == 1
    assert sentence in done.stderr
    assert 'Traceback' not in done.stderr
