# SPDX-License-Identifier: Apache-2.0
"""The group of commands."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from socialcircle_ros.commands.main import COMMANDS, GROUPS, socialcircle
from socialcircle_ros.recording import open_recording

BAGS = Path(__file__).resolve().parents[2] / 'bags'


def test_help_lists_every_command(run):
    done = run('--help')
    assert done.code == 0
    for name in COMMANDS:
        assert f'\n  {name} ' in done.out


def test_help_has_groups_and_cuts_no_sentence_off(run):
    out = run('--help').out
    at = [out.index(f'\n{title}:\n') for title in GROUPS]
    assert at == sorted(at)
    assert '...' not in out.partition('Run:')[2]
    assert '…' not in out


@pytest.mark.parametrize('name', COMMANDS)
def test_the_help_of_every_command_has_an_example(run, name):
    done = run(name, '--help')
    assert done.code == 0
    assert f'socialcircle {name}' in done.out.split('Options:')[-1] or 'Example:' in done.out


def test_an_unknown_command_is_refused(run):
    done = run('polish')
    assert done.code == 2
    assert "No such command 'polish'" in done.err
    assert 'Did you mean' not in done.err


@pytest.mark.parametrize(('typed', 'meant'), [('fliter', 'filter'), ('warmup', 'warm-up'), ('reports', 'report')])
def test_a_misspelt_command_is_asked_back(run, typed, meant):
    done = run(typed)
    assert done.code == 2
    assert f"No such command '{typed}'. Did you mean '{meant}'?" in done.err


def test_help_imports_neither_numpy_nor_the_compiler_nor_ros():
    program = (
        'import sys\nfrom socialcircle_ros.commands import main\n'
        'sys.argv = ["socialcircle", "--help"]\nmain.main()\n'
        'heavy = {"numba", "numpy", "rclpy", "mcap", "matplotlib"} & set(sys.modules)\n'
        'sys.exit(f"loaded {heavy}" if heavy else 0)'
    )
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize('name', COMMANDS)
def test_what_is_written_is_named_by_one_option_in_every_command(name):
    command = socialcircle.get_command(None, name)
    for option in command.params:
        if '-o' in option.opts or {'--out', '--output'} & {*option.opts}:
            assert option.opts == ['-o', '--output']


@pytest.mark.parametrize('name', ['node', 'tune', 'play', 'record', 'demo'])
def test_a_command_that_needs_ros_says_how_to_install_it(name, tmp_path):
    arguments = {'play': ['x.mcap'], 'record': ['-o', 'x.mcap']}.get(name, [])
    program = (
        'import sys\nfor name in ("rclpy", "sensor_msgs"): sys.modules[name] = None\n'
        f'sys.argv = ["socialcircle", {name!r}, *{arguments!r}]\n'
        'from socialcircle_ros.commands.main import main\nsys.exit(main())'
    )
    done = subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert done.returncode == 1
    assert 'source Jazzy, or pip install ' in done.stderr
    assert 'Traceback' not in done.stderr


def test_tune_says_how_to_install_viser(tmp_path):
    pytest.importorskip('rclpy', reason='the command needs ROS 2')
    program = (
        'import sys\nsys.modules["viser"] = None\nsys.argv = ["socialcircle", "tune"]\n'
        'from socialcircle_ros.commands.main import main\nsys.exit(main())'
    )
    done = subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert done.returncode == 1
    assert done.stderr.startswith('Error: The page needs viser: pip install ')


@pytest.mark.parametrize(
    ('arguments', 'sentence'),
    [
        (['a.mcap', 'b.mcap'], "'b.mcap' is not for this command"),
        (['--prot', '80'], 'is not for this command'),
        (['--ros-args', '-r', 'no_rule'], 'no_rule'),
        (['--node', 'a name'], "'a name' cannot be the name of a node"),
        (['--host', 'nowhere.invalid'], 'cannot listen on nowhere.invalid'),
        (['--port', '70000'], '70000 is not in the range'),
    ],
)
def test_tune_says_what_is_wrong_with_its_arguments(run, arguments, sentence):
    pytest.importorskip('viser', reason='the page needs viser')
    done = run('tune', '--port', '0', *arguments)
    assert done.code in (1, 2)
    assert sentence in done.err
    assert 'Traceback' not in done.err


INTERRUPTED = """
import signal, sys
import click
from socialcircle_ros.commands import main

@click.command()
def command():
    try:
        signal.raise_signal(signal.SIGINT)
    except KeyboardInterrupt:
        {handled}

main.socialcircle.get_command = lambda *_: command
sys.exit(main.main(['filter']))
"""


@pytest.mark.parametrize(
    ('handled', 'code', 'err'),
    [
        ("raise RuntimeError('no compiled object yet')", 130, 'Stopped.\n'),
        ("raise click.ClickException('no output')", 130, 'Stopped.\n'),
        ('pass', 130, 'Stopped.\n'),
        ('sys.exit(0)', 0, ''),  # as the node ends normally
    ],
)
def test_ctrl_c_stops_a_command_whatever_a_library_makes_of_it(handled, code, err):
    program = INTERRUPTED.format(handled=handled)
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (code, err)


def test_an_error_without_ctrl_c_is_raised():
    program = INTERRUPTED.replace('signal.raise_signal(signal.SIGINT)', 'raise KeyError').replace(
        'KeyboardInterrupt', 'KeyError'
    )
    done = subprocess.run(
        [sys.executable, '-c', program.format(handled="raise RuntimeError('a fault')")],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 1
    assert 'RuntimeError: a fault' in done.stderr


COMPILING = """
import sys
import click
from socialcircle_ros.commands import main

@click.command()
def command():
    from numba import njit
    from socialcircle_ros.kernels import compiled  # listens
    njit(lambda x: x)(1)
    njit(lambda x: x + 1)(1)

main.socialcircle.get_command = lambda *_: command
sys.exit(main.main([sys.argv[1]]))
"""


@pytest.mark.parametrize(('name', 'times'), [('filter', 1), ('warm-up', 0)])
def test_an_offline_command_says_once_that_it_compiles(name, times):
    done = subprocess.run([sys.executable, '-c', COMPILING, name], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stderr == 'The first use compiles the filter, which can take half a minute.\n' * times


def run_with(program, folder, **options):
    """Run `socialcircle` with what a program says before; its stdout is what `options` say."""
    end = 'from socialcircle_ros.commands.main import main\nsys.exit(main())'
    return subprocess.run(
        [sys.executable, '-c', f'import sys\n{program}\n{end}'],
        cwd=folder, stderr=subprocess.PIPE, text=True, check=False, timeout=100, **options,
    )  # fmt: skip


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='no device that is always full')
@pytest.mark.parametrize('unbuffered', ['', '1'])
@pytest.mark.parametrize('arguments', [['--help'], ['filter', '--help'], ['--version'], ['info', 'clouds.mcap']])
def test_an_output_on_a_full_disk_is_told_in_a_sentence(tmp_path, arguments, unbuffered):
    shutil.copy(BAGS / 'padded.mcap', tmp_path / 'clouds.mcap')
    with Path('/dev/full').open('wb') as full:
        done = run_with(
            f'sys.argv = ["socialcircle", *{arguments!r}]',
            tmp_path,
            stdout=full,
            env={**os.environ, 'PYTHONUNBUFFERED': unbuffered},
        )
    assert (done.returncode, done.stderr) == (1, 'Error: The output cannot be written: No space left on device.\n')


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='no device that is always full')
def test_a_result_is_whole_where_the_sentence_about_it_cannot_be_written(tmp_path):
    shutil.copy(BAGS / 'padded.mcap', tmp_path / 'clouds.mcap')
    with Path('/dev/full').open('wb') as full:
        program = 'sys.argv = ["socialcircle", "filter", "clouds.mcap", "-o", "cleaned.mcap"]'
        done = run_with(program, tmp_path, stdout=full)
    assert done.returncode == 1
    assert done.stderr.endswith('Error: The output cannot be written: No space left on device.\n')
    with open_recording(tmp_path / 'cleaned.mcap') as reader:
        assert reader.damage is None or not reader.damage
    assert sorted(path.name for path in tmp_path.iterdir()) == ['cleaned.mcap', 'clouds.mcap']


def test_the_reader_of_a_pipe_may_go(tmp_path):
    reading, writing = os.pipe()
    os.close(reading)
    done = run_with('sys.argv = ["socialcircle", "--help"]', tmp_path, stdout=writing)
    os.close(writing)
    assert (done.returncode, done.stderr) == (1, '')


FAILING = """
import tempfile
import click
from socialcircle_ros.commands import main

@click.command()
def command():
    {failure}

main.socialcircle.get_command = lambda *_: command
sys.argv = ["socialcircle", "filter"]
"""

NO_FOLDER = 'tempfile._get_candidate_names = lambda: iter(()); tempfile._candidate_tempdir_list = lambda: []; '


@pytest.mark.parametrize(
    ('failure', 'sentence'),
    [
        (NO_FOLDER + 'tempfile.mkdtemp()', 'No folder for temporary files can be written: set TMPDIR to one'),
        (
            NO_FOLDER + 'raise OSError("Matplotlib requires access to a writable cache")',
            'set TMPDIR to one that can',
        ),
        (
            'raise MemoryError("Unable to allocate 3 GiB.")',
            'Memory is short (Unable to allocate 3 GiB): end other',
        ),
        ('raise MemoryError', 'Memory is short: end other programs'),
        ('raise RuntimeError("can\'t start new thread")', 'No further thread can be started: allow more memory'),
        ('raise ImportError("x.so: failed to map segment from shared object", name="x")', 'x cannot be loaded.'),
    ],
)
def test_what_the_machine_lacks_is_told_in_a_sentence(tmp_path, failure, sentence):
    done = run_with(FAILING.format(failure=failure), tmp_path, stdout=subprocess.DEVNULL)
    assert done.returncode == 1
    assert sentence in done.stderr
    assert done.stderr.startswith('Error: ')
    assert done.stderr.count('\n') == 1


@pytest.mark.parametrize('failure', ['raise OSError(9, "a fault")', 'raise RuntimeError("a fault")'])
def test_an_error_that_may_be_a_fault_of_the_program_shows_where_it_is(tmp_path, failure):
    done = run_with(FAILING.format(failure=failure), tmp_path, stdout=subprocess.DEVNULL)
    assert done.returncode == 1
    assert 'Traceback' in done.stderr
