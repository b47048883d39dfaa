# SPDX-License-Identifier: Apache-2.0
"""The recipes of the Makefile."""

import subprocess
from pathlib import Path

import pytest

MAKEFILE = Path(__file__).resolve().parents[1] / 'Makefile'


@pytest.mark.parametrize(
    ('given', 'words'),
    [(['DATA=Prüf teil.npz'], ['demo', 'Prüf teil.npz']), (['DATA=a.npz'], ['demo', 'a.npz']), ([], ['demo'])],
)
def test_the_demo_plays_the_file_that_is_named(tmp_path, given, words):
    (tmp_path / 'socialcircle').write_text('#!/bin/sh\nfor word; do echo "word: $word"; done\n')
    (tmp_path / 'socialcircle').chmod(0o755)
    command = ['make', '--silent', '--file', MAKEFILE, 'demo', f'BIN={tmp_path}', 'DEMO=', *given]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [f'word: {word}' for word in words]
