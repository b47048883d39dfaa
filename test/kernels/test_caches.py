# SPDX-License-Identifier: Apache-2.0
"""Caches of compiled kernels: outdated, damaged, of others, read-only, and without room."""

import builtins
import errno
import importlib.util
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numba
import pytest
from numba.core import caching

from socialcircle_ros.kernels import caches
from socialcircle_ros.kernels.compiled import folder_of, has_cached_code, is_cached

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


SIX = """
from socialcircle_ros.kernels.compiled import kernel


@kernel
def six():
    return {value}
"""


class Called(NamedTuple):
    """What a kernel returned, and how it came: from a cache or compiled, and the folder."""

    value: float
    was_cached: bool
    folder: str | None


class Installation:
    """A module with one kernel beside which its cache lies, and a user's folder for caches.

    Each call loads the module anew, as a new process does. The superuser may read and write everywhere, so
    permissions would not stop these tests: the calls that they would stop are refused.
    """

    def __init__(self, folder, monkeypatch):
        self.module = folder / 'package' / 'sixes.py'
        self.beside, self.users = self.module.parent / '__pycache__', folder / 'user'
        self.unwritable, self.unreadable = [], set()
        self.error = errno.EACCES
        self.write()
        monkeypatch.setenv('XDG_CACHE_HOME', str(self.users))
        monkeypatch.setattr(numba.config, 'CACHE_DIR', '')
        monkeypatch.setattr(caches, '_failures', [])
        temporary, write = caching.tempfile.TemporaryFile, caching.IndexDataCacheFile._open_for_write

        @contextmanager
        def open_for_write(cache, path):
            self._refuse(path, self.unwritable)
            with write(cache, path) as file:
                yield file
            self.unreadable.discard(path)  # another file is there

        def temporary_file(dir):  # noqa: A002 - its name in Python
            if self.error != errno.ENOSPC:  # an empty file has room
                self._refuse(dir, self.unwritable)
            return temporary(dir=dir)

        def open_to_read(path, *mode):
            if path in self.unreadable:
                raise PermissionError(errno.EACCES, 'refused')
            return builtins.open(path, *mode)  # noqa: PTH123 - stands in for it

        monkeypatch.setattr(caching.IndexDataCacheFile, '_open_for_write', open_for_write)
        monkeypatch.setattr(caching.tempfile, 'TemporaryFile', temporary_file)
        monkeypatch.setattr(caching, 'open', open_to_read, raising=False)

    def _refuse(self, path, folders):
        if any(Path(path).is_relative_to(folder) for folder in folders):
            raise OSError(self.error, 'refused')

    def write(self, value=6.0):
        self.module.parent.mkdir(exist_ok=True)
        self.module.write_text(SIX.format(value=value))

    def kernel(self):
        spec = importlib.util.spec_from_file_location('sixes', self.module)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module.six

    def call(self):
        six = self.kernel()
        return Called(six(), bool(six.stats.cache_hits), folder_of(six))

    def damage(self, name, folder=None):
        (path,) = (folder or self.beside).rglob(name)
        path.write_bytes(path.read_bytes()[:-20])


@pytest.fixture
def installed(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, 'dont_write_bytecode', True)
    installation = Installation(tmp_path, monkeypatch)
    assert not installation.call().was_cached
    assert installation.call().was_cached
    return installation


def of_another_version(installation):
    installation.write(7.0)


def of_another_numba(installation):
    (path,) = installation.beside.rglob('*.nbi')
    path.write_bytes(path.read_bytes().replace(numba.__version__.encode(), b'9' * len(numba.__version__)))


def of_another_processor(installation):
    for path in installation.beside.iterdir():
        path.unlink()
    with pytest.MonkeyPatch.context() as elsewhere:
        elsewhere.setattr(numba.config, 'CPU_NAME', 'generic')
        assert not installation.call().was_cached


def with_a_damaged_index(installation):
    installation.damage('*.nbi')


def with_damaged_code(installation):
    installation.damage('*.nbc')


def with_an_index_of_a_few_bytes(installation):
    (path,) = installation.beside.rglob('*.nbi')
    path.write_bytes(b'\x80\x05\x95')


def of_a_user_who_lets_no_other_read(installation):
    installation.unreadable = {str(path) for path in installation.beside.iterdir()}


UNUSABLE = pytest.mark.parametrize(
    'spoil',
    [
        of_another_version,
        of_another_numba,
        of_another_processor,
        with_a_damaged_index,
        with_damaged_code,
        with_an_index_of_a_few_bytes,
        of_a_user_who_lets_no_other_read,
    ],
)


@UNUSABLE
def test_a_cache_that_is_of_no_use_and_can_be_written_is_written_again(installed, spoil):
    spoil(installed)
    first, second = installed.call(), installed.call()
    assert (first.was_cached, second.was_cached) == (False, True)
    assert first.folder == second.folder == str(installed.beside)
    assert caches.write_failure() is None


@UNUSABLE
def test_a_cache_that_is_of_no_use_and_read_only_makes_way_for_the_user_s(installed, spoil):
    spoil(installed)
    installed.unwritable = [installed.beside]
    first, second = installed.call(), installed.call()
    assert (first.was_cached, second.was_cached) == (False, True)
    assert first.folder == second.folder
    assert Path(first.folder).is_relative_to(installed.users)
    assert caches.write_failure() is None


@UNUSABLE
def test_where_no_cache_can_be_used_each_process_compiles(installed, spoil):
    spoil(installed)
    installed.unwritable = [installed.beside, installed.users]
    for _ in range(2):
        assert not installed.call().was_cached
    assert caches.write_failure() == 'no folder can be written'


@UNUSABLE
def test_on_a_full_disk_each_process_compiles(installed, spoil):
    spoil(installed)
    installed.error, installed.unwritable = errno.ENOSPC, [installed.beside]
    for _ in range(2):
        assert not installed.call().was_cached
    assert caches.write_failure() == 'refused'


def test_a_good_cache_that_is_read_only_comes_before_the_user_s(installed):
    installed.unwritable = [installed.beside]
    assert installed.call() == (6.0, True, str(installed.beside))
    assert has_cached_code(installed.kernel())
    assert is_cached(installed.kernel())


def test_a_cache_folder_that_was_given_may_be_read_only_too(installed, tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, 'CACHE_DIR', str(tmp_path / 'given'))
    installed.call()
    installed.unwritable = [tmp_path / 'given', installed.beside]
    called = installed.call()
    assert called.was_cached
    assert Path(called.folder).is_relative_to(tmp_path / 'given')


def test_an_index_that_cannot_be_read_holds_nothing(installed):
    with_a_damaged_index(installed)
    assert not has_cached_code(installed.kernel())
    assert not is_cached(installed.kernel())


@pytest.mark.parametrize('error', [MemoryError(), OSError(errno.ENOMEM, 'short'), RuntimeError('LLVM')])
def test_a_good_cache_is_not_emptied_where_the_machine_cannot_read_it(installed, monkeypatch, error):
    def refuse(*_):
        raise error

    with monkeypatch.context() as short:
        short.setattr(caching.IndexDataCacheFile, 'load', refuse)
        short.setattr(caching.IndexDataCacheFile, 'save', refuse)
        assert not installed.call().was_cached
    assert installed.call().was_cached
