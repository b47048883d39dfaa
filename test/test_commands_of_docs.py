# SPDX-License-Identifier: Apache-2.0
"""The commands of the documents and of the README run as they stand, in the state that those above them left.

The tutorial has a test of its own. Each other page starts in a folder with the files that its reader has. Commands
that cannot run in a test are named in `NOT_RUN`, each with the reason; their options are checked. So are those of
commands within sentences and tables.
"""

import contextlib
import importlib.metadata
import itertools
import re
import runpy
import shlex
from pathlib import Path

import click
import numpy as np
import pytest
import yaml
from archive.archives import recorded
from clusters import cluster_in_this_process
from good_parts import pitted

from socialcircle_ros import MeasuredSurface, write_surface
from socialcircle_ros.commands.main import main, socialcircle
from socialcircle_ros.settings import PARAMETERS

TOP = Path(__file__).resolve().parents[1]
BAGS = TOP / 'bags'
TUTORIAL = TOP / 'docs/tutorial.md'
PAGES = [TOP / 'README.md', TOP / 'CONTRIBUTING.md', *sorted((TOP / 'docs').glob('*.md'))]
BLOCK = re.compile(r'^```(\S*).*?\n(.*?)^```$', re.MULTILINE | re.DOTALL)

COMMANDS_OF_A_SHELL = ('', 'sh')
OTHER_LANGUAGES = ('python', 'yaml', 'text', 'ros', '{eval-rst}')

LIVE = 'talks to a node until Ctrl-C; the tutorial and the live tests run it'
CLUSTER = 'needs machines of a cluster'
DOWNLOADS = 'downloads packages'
SOURCED = 'needs a sourced ROS 2'
NOT_RUN = {
    r'socialcircle (node|record|play|tune)\b': LIVE,
    r'socialcircle (batch|sweep) .*--scheduler': CLUSTER,
    r'socialcircle \w+ /plant/': 'reads the measurements of nodes that the reader has',
    r'dask (scheduler|worker)\b': CLUSTER,
    r'ssh ': 'needs another machine',
    r'sudo ': 'changes the machine',
    r'make\b': 'takes minutes',
    r'pip (install|wheel) ': DOWNLOADS,
    r'python3 -m venv ': 'makes an environment',
    r'environment/bin/pip ': DOWNLOADS,
    r'environment/bin/socialcircle ': 'needs the environment of the lines above',
    r'\. ': 'changes the shell',
    r'export ': 'changes the shell',
    r'(python3 -m colcon build|ament_|rosdep install)': SOURCED,
    r'ros2 security ': SOURCED,
    r'FASTRTPS_DEFAULT_PROFILES_FILE=.* ros2 run my_sensor driver': 'runs a driver of the reader',
    r'SOCIALCIRCLE_DATA=… python -m socialcircle_ros\.studies\.learned(\.leave_out)? ': 'trains for hours',
}
"""What a test cannot run: a pattern of the line, and the reason."""

FAILING = {
    'socialcircle filter night.mcap -p limits.outlier_share_max:=0.05 -p limits.sq_max:=2e-6 -o checked.mcap': 3,
}
"""The exit code of commands that find a measurement beyond its limits."""


EXAMPLES_BETWEEN = ('archives.md', 'formats.md')
"""Pages whose examples in Python use what the commands above them wrote; `test_docs.py` runs those of others."""


def blocks(page):
    return [(found[1], found[2]) for found in BLOCK.finditer(page.read_text(encoding='utf-8'))]


def commands_of(page):
    """The lines of a page that a person types into a shell."""
    text = '\n'.join(text for language, text in blocks(page) if language in COMMANDS_OF_A_SHELL)
    return [line for line in text.splitlines() if line.strip()]


def reason_not_to_run(line):
    return next((reason for pattern, reason in NOT_RUN.items() if re.match(pattern, line)), None)


def within_sentences(page):
    """The commands in sentences and tables."""
    text = BLOCK.sub('', page.read_text(encoding='utf-8'))
    return [line for line in re.findall(r'`((?:socialcircle|make) [^`]+)`', text) if 'COMMAND' not in line]


def check_options(words):
    """Parse a command without running it: the command and its options exist, and each option has what it needs."""
    command, arguments = socialcircle, words
    while isinstance(command, click.Group) and arguments and not arguments[0].startswith('-'):
        name, *arguments = arguments
        found = command.get_command(click.Context(command), name)
        assert found is not None, f'there is no command {" ".join(words)}'
        command = found
    context = click.Context(command, ignore_unknown_options=False)
    own, ros = arguments, []
    if '--ros-args' in arguments:
        first = arguments.index('--ros-args')
        own, ros = arguments[:first], arguments[first + 1 :]
    _, left, _ = command.make_parser(context).parse_args(own)
    assert not left or any(isinstance(each, click.Argument) for each in command.params)
    for flag, value in itertools.pairwise(ros):
        if flag == '-p':
            assert value.split(':=')[0] in PARAMETERS, f'there is no parameter {value}'


def check(line):
    """What can be known of a command without running it."""
    words = [word for word in shlex.split(line, comments=True) if word != '&']
    if words[0] in ('socialcircle', 'environment/bin/socialcircle'):
        check_options(words[1:])
    if words[0] == 'make':
        targets = re.search(r'^\.PHONY: (.*)$', (TOP / 'Makefile').read_text(encoding='utf-8'), re.MULTILINE)[1]
        assert {word for word in words[1:] if '=' not in word} <= set(targets.split())
    for extras in re.findall(r'(?:\.|socialcircle_ros)\[([\w,]+)\]', line):
        declared = importlib.metadata.metadata('socialcircle_ros').get_all('Provides-Extra')
        assert set(extras.split(',')) <= set(declared)
    for file in re.findall(r'(?<![\w/])((?:config|deploy|launch|constraints)/[\w./@]+)', line):
        assert (TOP / file).exists(), f'{file} does not exist'


@pytest.fixture
def given(tmp_path, monkeypatch):
    """The folder of a reader: recordings, measurements and parameter files of the names that the pages use."""
    monkeypatch.chdir(tmp_path)
    recorded(tmp_path / 'night.mcap', clouds=2)
    rng = np.random.default_rng(1)
    for name in ('part1', 'part2'):
        np.savez(tmp_path / f'{name}.npz', z=rng.normal(size=(60, 70)), dx=1.0, dy=1.5, unit='um')
    for name in ('part', 'part1', 'part2'):
        heights = 1e-6 * rng.normal(size=(60, 70))
        heights[20:23, 30:33] += 30e-6
        write_surface(tmp_path / f'{name}.sdf', MeasuredSurface(heights, (1e-6, 1.5e-6), 'm'))
    np.savez(tmp_path / 'good.npz', z=pitted(200, 260, pits=50), dx=1.0, dy=2.0, unit='um')
    assert main(['import', 'good.npz', '-o', 'good.mcap']) == 0
    for name in ('tuned', 'adaptive', 'paper'):
        mode = 'paper' if name == 'paper' else 'adaptive'
        text = yaml.safe_dump({'/**': {'ros__parameters': {'circle': {'mode': mode}}}})
        (tmp_path / f'{name}.yaml').write_text(text)
    from PIL import Image

    (tmp_path / 'frames').mkdir()
    for number in range(6):
        frame = rng.integers(40, 200, (48, 64), np.uint8)
        Image.fromarray(frame).save(tmp_path / f'frames/f{number}.png')
    for cell in ('cell1', 'cell2'):
        for number in range(2):
            recorded(tmp_path / f'nights/{cell}/lid_{number:03d}.mcap', seed=number, namespace=f'/{cell}')
    return tmp_path


def test_every_block_is_of_a_known_language():
    for page in PAGES:
        assert {language for language, _ in blocks(page)} <= {*COMMANDS_OF_A_SHELL, *OTHER_LANGUAGES}, page.name


def test_every_reason_not_to_run_a_command_is_needed():
    lines = [line for page in PAGES if page != TUTORIAL for line in commands_of(page)]
    assert [pattern for pattern in NOT_RUN if not any(re.match(pattern, line) for line in lines)] == []


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_the_commands_that_are_not_run_exist_with_their_options(page):
    lines = [line for line in commands_of(page) if reason_not_to_run(line)] if page != TUTORIAL else []
    for line in [*lines, *within_sentences(page)]:
        check(line)


def has_commands_to_run(page):
    return page != TUTORIAL and any(not reason_not_to_run(line) for line in commands_of(page))


RUN = [page for page in PAGES if has_commands_to_run(page)]


@pytest.mark.long
@pytest.mark.parametrize('page', RUN, ids=lambda page: page.name)
def test_the_commands_of_a_page_run_one_after_the_other(page, given, capfd):
    for library in ('matplotlib', 'optuna', 'distributed', 'pyarrow', 'duckdb', 'bokeh', 'PIL'):
        pytest.importorskip(library)
    with contextlib.ExitStack() as stack:
        for language, text in blocks(page):
            # A file of an instrument cannot be written; what is said of it holds for a file that can.
            block = text.replace('.al3d', '.sdf')
            if language == 'python' and page.name in EXAMPLES_BETWEEN:
                (given / 'example.py').write_text(f'import numpy as np\n{block}', encoding='utf-8')
                runpy.run_path(str(given / 'example.py'))
            if language not in COMMANDS_OF_A_SHELL:
                continue
            for line in block.splitlines():
                words = shlex.split(line, comments=True)
                if not words or reason_not_to_run(line):
                    continue
                assert words[0] == 'socialcircle', f'{page.name}: nothing runs {line}'
                if words[1] == 'batch':  # processes would take longer than the work
                    words += ['--scheduler', stack.enter_context(cluster_in_this_process())]
                code = main(words[1:])
                out, err = capfd.readouterr()
                assert code == FAILING.get(shlex.join(words), 0), f'{page.name}: {line}\n{out}{err}'
