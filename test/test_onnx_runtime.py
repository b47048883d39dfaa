# SPDX-License-Identifier: Apache-2.0
"""ONNX Runtime tells nobody anything."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

import socialcircle_ros

PACKAGE = Path(socialcircle_ros.__file__).parent
USE = """
import os, sys
import numpy as np
from socialcircle_ros import remove_outliers

before = len(os.listdir('/proc/self/task'))
from socialcircle_ros.onnx_runtime import onnxruntime
print(len(os.listdir('/proc/self/task')) - before)
heights = np.random.default_rng(1).normal(size=(60, 80)).astype(np.float32)
heights[20, 30] = 60
print(remove_outliers(heights, pitch=(1.0, 2.0)).outliers.sum())
"""


def importers():
    for path in PACKAGE.rglob('*.py'):
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                names = [node.module or '']
            if any(name.partition('.')[0] == 'onnxruntime' for name in names):
                yield path.relative_to(PACKAGE)


def test_one_module_imports_it_and_one_its_tool_after_that():
    tool = Path('studies/learned/integers.py')
    assert set(importers()) == {Path('onnx_runtime.py'), tool}
    text = (PACKAGE / tool).read_text(encoding='utf-8')
    assert text.index('import socialcircle_ros.onnx_runtime') < text.index('from onnxruntime')


@pytest.mark.skipif(sys.platform != 'linux', reason='threads are counted in /proc')
def test_its_import_starts_no_thread_and_leaves_no_file(tmp_path):
    environment = os.environ | {'HOME': str(tmp_path), 'XDG_CACHE_HOME': str(tmp_path / 'cache')}
    # It is off in tests and in CI without being told; here it must be as in a cell.
    for name in ('ORT_DISABLE_TELEMETRY', 'ORT_RUNNING_UNIT_TESTS', 'CI', 'TF_BUILD', 'GITHUB_ACTIONS'):
        environment.pop(name, None)
    done = subprocess.run([sys.executable, '-c', USE], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ['0', '1']
    assert not [path for path in tmp_path.rglob('*') if 'onnx' in path.name.lower()]
