# SPDX-License-Identifier: Apache-2.0
"""The cache of compiled kernels."""

import errno
import subprocess
import sys
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pytest

from socialcircle_ros.kernels import compiled, compiling
from socialcircle_ros.kernels.compiled import kernel

MODULE = """
from typing import NamedTuple

import numpy as np

from socialcircle_ros.kernels.compiled import kernel


class {name}(NamedTuple):
    values: np.ndarray


@kernel
def total(arrays):
    return arrays.values.sum()


print(total({name}(np.arange(4.0))), sum(total.stats.cache_hits.values()))
"""


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


def test_it_is_known_while_a_kernel_is_compiled(monkeypatch):
    seen = []
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


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Runs the module, with a NamedTuple of a given name, in a process of its own and with one cache."""
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path / 'cache'))

    def run(name):
        path = tmp_path / 'sums.py'
        text = MODULE.format(name=name)
        if not path.exists() or path.read_text() != text:  # Numba before 0.59 looks at its time
            path.write_text(text)
        program = [sys.executable, '-c', 'import sums']
        done = subprocess.run(program, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout.split()

    return run


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


def test_a_cache_that_cannot_be_read_holds_nothing(monkeypatch):
    def refuse(*_):
        raise OSError(errno.EROFS, 'Read-only file system')

    monkeypatch.setattr(compiled._nothing._cache, 'load_overload', refuse)
    assert not compiled.is_cached(compiled._nothing)
    monkeypatch.setattr(compiled._nothing._cache._cache_file, '_load_index', refuse)
    assert not compiled.has_cached_code(compiled._nothing)


def test_the_cache_is_read_by_the_next_process(run):
    assert run('Arrays') == ['6.0', '0']
    assert run('Arrays') == ['6.0', '1']


def test_a_cache_that_names_a_class_of_another_version_is_compiled_anew(run):
    run('Arrays')
    assert run('Others') == ['6.0', '0']
    assert run('Others') == ['6.0', '1']


def test_a_damaged_cache_is_compiled_anew(run, tmp_path):
    run('Arrays')
    for path in (tmp_path / 'cache').rglob('*.nbi'):
        path.write_bytes(path.read_bytes()[:-20])
    assert run('Arrays') == ['6.0', '0']
    assert run('Arrays') == ['6.0', '1']


READ_ONLY = """
import errno
import tempfile

from numba.core import caching


def refuse(*_, **__):
    raise OSError(errno.EROFS, 'Read-only file system')


# The superuser may write everywhere, so the folder's permissions would not stop this test.
tempfile.TemporaryFile = refuse
caching.IndexDataCacheFile.save = refuse
import sums
"""


INNER = """
from socialcircle_ros.kernels.compiled import kernel


def make():
    @kernel
    def six():
        return 6.0

    return six


six = make()
print(six(), sum(six.stats.cache_hits.values()))
"""


@pytest.mark.parametrize('module', [MODULE.format(name='Arrays'), INNER], ids=['a function', 'an inner function'])
def test_a_read_only_installation_reads_the_cache_that_was_made_with_it(tmp_path, monkeypatch, module):
    monkeypatch.delenv('NUMBA_CACHE_DIR', raising=False)
    (tmp_path / 'sums.py').write_text(module)

    def run(program):
        done = subprocess.run(
            [sys.executable, '-c', program], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout.split()

    assert run(READ_ONLY) == ['6.0', '0']  # nothing was compiled with it: each process compiles
    assert run('import sums') == ['6.0', '0']
    assert run(READ_ONLY) == ['6.0', '1']


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
