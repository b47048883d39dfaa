# SPDX-License-Identifier: Apache-2.0
"""Containers and services, as far as they can be checked without a daemon that builds them."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from socialcircle_ros.commands.main import COMMANDS, socialcircle

ROOT = Path(__file__).resolve().parents[2]
DEPLOY = ROOT / 'deploy'
SERVICES = yaml.safe_load((DEPLOY / 'compose.yaml').read_text(encoding='utf-8'))['services']


def run_lines(path):
    """The RUN lines of a Dockerfile."""
    text = path.read_text(encoding='utf-8').replace('\\\n', ' ')
    return re.findall(r'^RUN (.*)$', text, re.MULTILINE)


def check_command(words):
    """Check that a command of ours and its options exist."""
    name, *rest = words
    assert name in COMMANDS
    command = socialcircle.get_command(None, name)
    own = rest[: rest.index('--ros-args')] if '--ros-args' in rest else rest
    with command.make_context(name, list(own), resilient_parsing=False) as context:
        assert context.params is not None


def command_of(service, folder):
    """The words of a service's command, as the shell that it may run through gives them."""
    words, program = SERVICES[service]['command'], SERVICES[service].get('entrypoint')
    if program is None:
        return words
    (folder / 'socialcircle').write_text('#!/bin/sh\nprintf "%s\\n" "$@"\n')
    (folder / 'date').write_text(f'#!/bin/sh\necho {folder.name}\n')  # each start has a time of its own
    for path in folder.iterdir():
        path.chmod(0o755)
    environment = {'PATH': f'{folder}:{os.environ["PATH"]}'}
    shown = [*program, *(word.replace('$$', '$') for word in words)]
    return subprocess.run(shown, env=environment, capture_output=True, text=True, check=True).stdout.splitlines()


@pytest.mark.parametrize('service', SERVICES)
def test_the_services_of_a_cell_run_commands_that_exist(tmp_path, service):
    check_command(command_of(service, tmp_path))


def test_each_start_of_the_recorder_has_a_file_of_its_own(tmp_path):
    names = []
    for start in ('first', 'second'):
        (tmp_path / start).mkdir()
        words = command_of('recorder', tmp_path / start)
        names.append(words[words.index('-o') + 1])
    assert names == [f'/recordings/cell1_{start}.mcap' for start in ('first', 'second')]


def test_the_image_on_jazzy_has_the_packages_that_the_package_needs():
    manifest = (ROOT / 'package.xml').read_text(encoding='utf-8')
    needed = set(re.findall('<exec_depend>(python3-[a-z0-9-]+)</exec_depend>', manifest))
    installed = set(re.findall('python3-[a-z0-9-]+', (ROOT / 'deploy' / 'Dockerfile').read_text(encoding='utf-8')))
    assert needed
    assert needed <= installed


def test_the_unit_of_systemd_runs_a_command_that_exists():
    (line,) = re.findall(r'^ExecStart=(.*)$', (DEPLOY / 'socialcircle@.service').read_text(), re.MULTILINE)
    program, *words = shlex.split(line)
    assert Path(program).name == 'socialcircle'
    check_command(words)


def test_the_unit_of_systemd_reads_the_kernels_of_an_installation_that_was_warmed_up():
    (line,) = re.findall(r'^Environment=(.*)$', (DEPLOY / 'socialcircle@.service').read_text(), re.MULTILINE)
    values = dict(word.split('=') for word in shlex.split(line))
    assert (
        values['XDG_CACHE_HOME'] == '/var/cache/socialcircle'
    )  # Numba asks for it after the cache beside the package
    assert 'NUMBA_CACHE_DIR' not in values  # which would come before it


def test_systemd_takes_the_unit():
    if shutil.which('systemd-analyze') is None:
        pytest.skip('systemd is not here')
    done = subprocess.run(
        ['systemd-analyze', 'verify', str(DEPLOY / 'socialcircle@.service')],
        capture_output=True,
        text=True,
        check=False,
    )
    complaints = [line for line in done.stderr.splitlines() if 'is not executable: No such file' not in line]
    assert not [line for line in complaints if 'socialcircle@' in line]


@pytest.fixture
def checkout(tmp_path):
    """A copy of what a container gets, where installing takes minutes: only for `make test-install`."""
    if not os.environ.get('SOCIALCIRCLE_INSTALL_TESTS'):
        pytest.skip('installing takes minutes: make test-install runs this')
    listed = subprocess.run(['git', 'ls-files'], cwd=ROOT, capture_output=True, text=True, check=True)
    for name in listed.stdout.splitlines():
        target = tmp_path / 'source' / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, target)
    return tmp_path


def shell(line, folder):
    environment = {name: value for name, value in os.environ.items() if not name.startswith(('PYTHON', 'NUMBA'))}
    environment['PATH'] = f'{Path(sys.base_prefix) / "bin"}:{environment["PATH"]}'
    done = subprocess.run(
        ['bash', '-ec', line], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f'{line}\n{done.stdout}\n{done.stderr}'
    return done.stdout


def test_each_line_of_the_slim_container_runs(checkout):
    for line in run_lines(DEPLOY / 'Dockerfile.slim'):
        shell(line, checkout)
    said = shell('environment/bin/socialcircle warm-up', checkout)
    assert str(checkout) in said  # the cache lies in the image


def test_a_cell_without_internet_installs_from_a_wheelhouse(checkout):
    page = (ROOT / 'docs' / 'deployment.md').read_text(encoding='utf-8')
    section = page.partition('## Without internet')[2].partition('\n## ')[0]
    collect, install = re.findall(r'```\n(.*?)```', section, re.DOTALL)
    shell(f'cd source && {collect.strip()} && mv wheelhouse ..', checkout)
    shell('\n'.join(install.strip().splitlines()), checkout)
