# SPDX-License-Identifier: Apache-2.0
import subprocess
import sys

import pytest
from forked import Done, run_command


@pytest.fixture
def run(tmp_path):
    """Runs `socialcircle` in a process of its own, in an empty directory; with `env`, it is not forked."""

    def run(*arguments, timeout=120, env=None):
        words = [str(argument) for argument in arguments]
        if env is None:
            return run_command(words, tmp_path, timeout)
        done = subprocess.run(
            [sys.executable, '-m', 'socialcircle_ros.commands.main', *words],
            cwd=tmp_path, env=env, capture_output=True, text=True, timeout=timeout, check=False,
        )  # fmt: skip
        return Done(done.returncode, done.stdout, done.stderr)

    return run
