# SPDX-License-Identifier: Apache-2.0
"""docs/tutorial.md: its commands run, one after the other, in one shell."""

import csv
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from launching.stand_in import commands

from socialcircle_ros.interface import NODE_NAME

TOP = Path(__file__).resolve().parents[1]
TEXT = (TOP / 'docs/tutorial.md').read_text(encoding='utf-8')
BLOCKS = re.findall(r'^```(\w+)(?: (\w+))?\n(.*?)^```$', TEXT, re.MULTILINE | re.DOTALL)

NODE = f'/cell1/{NODE_NAME}'
"""The node that the tutorial starts."""

SERVING = ('tune',)
"""Commands that serve a page until Ctrl-C; the test waits until they have found the node, and ends them so."""


def lines(language, mark=''):
    return [
        line for found, label, text in BLOCKS if (found, label) == (language, mark) for line in text.splitlines()
    ]


def runnable(line):
    words = shlex.split(line)
    if words[0] == 'socialcircle' and words[1] in SERVING:
        return (
            f'{line} > page.txt & page=$!\n'
            f'until grep -q "^Tuning {NODE} at http" page.txt; do kill -0 $page; sleep 0.1; done\n'
            'kill -INT $page; wait $page'
        )
    return line


def test_every_block_is_of_a_kind_that_a_test_runs():
    assert {(language, mark) for language, mark, _ in BLOCKS} == {('sh', 'install'), ('sh', ''), ('ros', '')}


def test_the_commands_that_install_exist():
    make, activate = lines('sh', 'install')
    assert make == 'make'
    assert activate == '. .venv/bin/activate'
    command = [shutil.which('make') or 'make', '--dry-run', '--always-make']
    done = subprocess.run(command, cwd=TOP, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert '-m venv  .venv' in done.stdout.replace('--system-site-packages', '')


def test_the_launch_files_take_the_arguments():
    for line in lines('ros'):
        ros2, launch, package, file, *arguments = shlex.split(line)
        assert (ros2, launch, package) == ('ros2', 'launch', 'socialcircle_ros')
        given = dict(argument.split(':=') for argument in arguments)
        declared = re.findall(r"DeclareLaunchArgument\(\s*'(\w+)'", (TOP / 'launch' / file).read_text())
        assert set(given) <= set(declared)
        assert commands(TOP / 'launch' / file, given)


def scores(folder):
    """The score of the setting as given, and the rows of the other settings of a sweep."""
    with (folder / 'sweep.csv').open(encoding='utf-8', newline='') as file:
        given, *others = csv.DictReader(file)
    return float(given['F1']), others


def table_of_settings(modes, scales):
    """The scores of the tutorial's two sweeps, as its table has them."""
    best = max(scales[1], key=lambda row: float(row['F1']))
    return {
        'adaptive, as given': f'{modes[0]:.2f}',
        f'paper, best radius scale ({float(best["circle.radius_scale"]):g})': f'{float(best["F1"]):.2f}',
        'paper, default': f'{float(modes[1][0]["F1"]):.2f}',
    }


@pytest.mark.long
@pytest.mark.live
def test_the_commands_run_one_after_the_other(tmp_path):
    pytest.importorskip('rclpy', reason='the tutorial needs ROS 2')
    pytest.importorskip('optuna')
    pytest.importorskip('matplotlib')
    pytest.importorskip('viser')
    tools = tmp_path / 'tools'
    tools.mkdir()
    ours = tools / 'socialcircle'
    ours.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m socialcircle_ros.commands.main "$@"\n')
    ours.chmod(0o755)
    work = tmp_path / 'work'
    work.mkdir()
    script = '\n'.join(['set -e', 'set -x', *map(runnable, lines('sh'))])
    environment = os.environ | {'PATH': f'{tools}{os.pathsep}{os.environ["PATH"]}'}
    done = subprocess.run(
        [shutil.which('bash') or '/bin/bash', '-c', script],
        cwd=work, env=environment, capture_output=True, text=True, timeout=900, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert 'Traceback' not in done.stderr
    pages = ('before', 'after', 'night', 'modes/sweep', 'paper/sweep', 'search/sweep')
    for page in (f'{name}.html' for name in pages):
        assert (work / 'out' / page).stat().st_size > 10_000
    table = dict(re.findall(r'^\| (\w+, .+?) \| (0\.\d\d) \|$', TEXT, re.MULTILINE))
    assert table == table_of_settings(scores(work / 'out/modes'), scores(work / 'out/paper'))
