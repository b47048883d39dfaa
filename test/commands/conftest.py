# SPDX-License-Identifier: Apache-2.0
import subprocess
import sys
from types import SimpleNamespace

import pytest


@pytest.fixture
def run(tmp_path):
    """Runs `socialcircle` as its users do: a process of its own, in an empty directory."""

    def run(*arguments, timeout=120, **options):
        command = [sys.executable, '-m', 'socialcircle_ros.commands.main', *map(str, arguments)]
        done = subprocess.run(
            command, cwd=tmp_path, capture_output=True, text=True, timeout=timeout, check=False, **options
        )
        return SimpleNamespace(code=done.returncode, out=done.stdout, err=done.stderr)

    return run
