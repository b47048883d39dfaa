"""The group of commands."""

import subprocess
import sys

import pytest

from socialcircle_ros.commands.main import COMMANDS


def test_help_lists_every_command_with_a_sentence(run):
    done = run('--help')
    assert done.code == 0
    for name in COMMANDS:
        assert f'\n  {name} ' in done.out


@pytest.mark.parametrize('name', COMMANDS)
def test_every_command_teaches_with_an_example(run, name):
    done = run(name, '--help')
    assert done.code == 0
    assert f'socialcircle {name}' in done.out.split('Options:')[-1] or 'Example:' in done.out


def test_a_command_that_is_not_there_is_told(run):
    done = run('polish')
    assert done.code == 2
    assert "No such command 'polish'" in done.err


def test_help_loads_neither_the_compiler_nor_ros():
    program = (
        'import sys\nfrom socialcircle_ros.commands import main\n'
        'sys.argv = ["socialcircle", "--help"]\nmain.main()\n'
        'heavy = {"numba", "numpy", "rclpy", "mcap", "matplotlib"} & set(sys.modules)\n'
        'sys.exit(f"loaded {heavy}" if heavy else 0)'
    )
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize('name', ['node', 'play', 'record', 'demo'])
def test_a_command_that_needs_ros_says_so_where_there_is_none(name, tmp_path):
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
    assert 'pip install "socialcircle_ros[ros]"' in done.stderr
    assert 'Traceback' not in done.stderr
