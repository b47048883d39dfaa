# SPDX-License-Identifier: Apache-2.0
"""What the source distribution holds."""

import re
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path
from unittest import mock

import pytest
import setuptools

ROOT = Path(__file__).resolve().parents[2]


def test_the_source_distribution_holds_every_file_of_the_repository(tmp_path):
    if shutil.which('git') is None or not (ROOT / '.git').exists():
        pytest.skip('the files of the repository are known to git only')
    listed = subprocess.run(['git', 'ls-files'], cwd=ROOT, capture_output=True, text=True, check=True)
    tracked = [name for name in listed.stdout.splitlines() if (ROOT / name).is_file()]
    for name in tracked:
        (tmp_path / 'source' / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / 'source' / name)
    command = [sys.executable, 'setup.py', '-q', 'sdist', '-d', str(tmp_path)]
    subprocess.run(command, cwd=tmp_path / 'source', check=True, capture_output=True)
    (archive,) = tmp_path.glob('*.tar.gz')
    with tarfile.open(archive) as made:
        held = {name.partition('/')[2] for name in made.getnames()}
    assert set(tracked) <= held


def test_every_file_that_names_the_version_names_the_same():
    names = {
        'setup.py': r"version='([0-9.]+)'",
        'package.xml': r'<version>([0-9.]+)</version>',
        'CHANGELOG.rst': r'^([0-9.]+) \([0-9-]+\)$',
    }
    texts = {name: (ROOT / name).read_text(encoding='utf-8') for name in names}
    found = {re.search(pattern, texts[name], re.MULTILINE)[1] for name, pattern in names.items()}
    assert len(found) == 1


def test_ros2_run_finds_tune_and_no_path_does():
    source = (ROOT / 'setup.py').read_text(encoding='utf-8')
    with mock.patch.object(setuptools, 'setup') as setup:
        exec(compile(source, 'setup.py', 'exec'), {'__file__': str(ROOT / 'setup.py')})  # noqa: S102
    given = setup.call_args.kwargs
    assert ('lib/socialcircle_ros', ['scripts/tune']) in given['data_files']
    assert not [line for line in given['entry_points']['console_scripts'] if line.startswith('tune')]
    tune = [sys.executable, ROOT / 'scripts' / 'tune', '--help']
    done = subprocess.run(tune, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert 'Tune' in done.stdout
