# SPDX-License-Identifier: Apache-2.0
"""Compiling at install time."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from socialcircle_ros.commands import warm_up
from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.kernels import caches, compiled
from socialcircle_ros.node import warm_up as node_warm_up


@pytest.fixture(autouse=True)
def _nothing_failed_before(monkeypatch):
    monkeypatch.setattr(caches, '_failures', [])


def test_every_step_runs(monkeypatch):
    done = []
    monkeypatch.setattr(node_warm_up, 'steps', lambda: iter([lambda: done.append(1), lambda: done.append(2)]))
    result = CliRunner().invoke(warm_up.command)
    assert result.exit_code == 0, result.output
    assert done == [1, 2]


def test_the_folder_that_is_told_holds_the_kernels_of_all_packages(tmp_path):
    environment = {**os.environ, 'NUMBA_CACHE_DIR': str(tmp_path / 'given')}
    program = (
        'import contextlib, io; from socialcircle_ros.commands.warm_up import command;'
        ' from socialcircle_ros.node import warm_up; warm_up.steps = lambda: iter([warm_up._all_rare()]);'
        ' from socialcircle_ros.kernels.compiled import cache_folder; command(standalone_mode=False);'
        ' print(cache_folder())'
    )
    done = subprocess.run(
        [sys.executable, '-c', program], env=environment, capture_output=True, text=True, check=True
    )
    sentence, one_package = done.stdout.splitlines()[-2:]
    assert sentence.endswith(f'they lie under {tmp_path / "given"}.')
    assert Path(one_package).parent == tmp_path / 'given'


@pytest.mark.parametrize(
    ('used', 'told'),
    [('/a/package/room/__pycache__', '/a/package'), ('/cache/room_f00', '/cache'), (None, 'None')],
)
def test_the_folder_is_that_of_all_packages(used, told, monkeypatch):
    monkeypatch.setattr(node_warm_up, 'folder_of', lambda kernel: used)
    assert str(node_warm_up.folder()) == told


def test_without_onnx_runtime_all_is_compiled_and_a_sentence_says_what_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, 'onnxruntime', None)
    first, network, *rare = node_warm_up.steps()
    assert node_warm_up._see in rare  # the kernels before and after the network
    monkeypatch.setattr(node_warm_up, 'steps', lambda: iter([first, network]))
    result = CliRunner().invoke(warm_up.command)
    assert result.exit_code == 0, result.output
    assert 'The kernels are compiled' in result.output
    assert 'The network needs ONNX Runtime, which is not installed: pip install onnxruntime.' in result.output


def test_the_folder_is_where_numba_is_told_to_write(tmp_path):
    program = 'from socialcircle_ros.kernels.compiled import cache_folder; print(cache_folder())'
    environment = {**os.environ, 'NUMBA_CACHE_DIR': str(tmp_path)}
    done = subprocess.run(
        [sys.executable, '-c', program], env=environment, capture_output=True, text=True, check=True
    )
    assert Path(done.stdout.strip()).is_relative_to(tmp_path)


def test_without_a_folder_a_sentence_says_what_to_set(monkeypatch):
    monkeypatch.setattr(compiled, 'cache_folder', lambda: None)
    monkeypatch.setattr(node_warm_up, 'is_warm', lambda: False)
    result = CliRunner().invoke(warm_up.command)
    assert 'set NUMBA_CACHE_DIR' in str(result.exception)


def test_kernels_that_cannot_be_kept_are_an_error_that_gives_the_reason(monkeypatch):
    def full():
        caches._failures.append(OSError(errno.ENOSPC, 'No space left on device'))

    monkeypatch.setattr(node_warm_up, 'steps', lambda: iter([full]))
    result = CliRunner().invoke(warm_up.command)
    assert isinstance(result.exception, SocialCircleError)
    assert '(No space left on device)' in str(result.exception)
    assert 'set NUMBA_CACHE_DIR' in str(result.exception)
    assert 'they lie' not in result.output


def test_a_full_cache_that_is_read_only_is_all_that_is_needed(monkeypatch):
    monkeypatch.setattr(compiled, 'cache_folder', lambda: None)
    monkeypatch.setattr(node_warm_up, 'is_warm', lambda: True)
    monkeypatch.setattr(node_warm_up, 'folder', lambda: '/package')
    monkeypatch.setattr(node_warm_up, 'steps', lambda: iter([]))
    result = CliRunner().invoke(warm_up.command)
    assert result.exit_code == 0, result.output
    assert 'they lie under /package.' in result.output


def signatures():
    """How many signatures of all kernels are compiled in this process."""
    modules = [module for name, module in list(sys.modules.items()) if name.startswith('socialcircle_ros')]
    values = {id(value): value for module in modules for value in vars(module).values()}.values()
    kernels = [each for each in values if hasattr(each, 'nopython_signatures') and not isinstance(each, type)]
    return sum(len(kernel.signatures) for kernel in kernels)


@pytest.mark.parametrize('step', list(node_warm_up.steps()))
def test_a_step_compiles_all_that_it_needs(step):
    step()
    compiled_by_then = signatures()
    step()
    assert compiled_by_then == signatures()
    own = getattr(step, 'signatures', ())  # the last step is a kernel that is no variable of a module
    assert compiled_by_then + len(own) > 0
