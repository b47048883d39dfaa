# SPDX-License-Identifier: Apache-2.0
"""Keys of a terminal, which is a pseudo-terminal here."""

import os
import queue
import subprocess
import sys
import termios

import pytest

from socialcircle_ros.clients.keys import RIGHT, SPACE, listened_keys


@pytest.fixture
def terminal():
    """What presses the keys, and the terminal that gets them."""
    keyboard, terminal = os.openpty()
    yield keyboard, terminal
    os.close(keyboard)
    os.close(terminal)


def test_each_key_calls_its_action_and_the_terminal_is_as_before(terminal):
    keyboard, file = terminal
    before = termios.tcgetattr(file)
    pressed = queue.Queue()
    with listened_keys({SPACE: lambda: pressed.put('space'), RIGHT: lambda: pressed.put('right')}, file) as heard:
        assert heard
        os.write(keyboard, b'x' + SPACE + SPACE + RIGHT + b'\x1b[Z' + SPACE)
        assert [pressed.get(timeout=60) for _ in range(4)] == ['space', 'space', 'right', 'space']
    assert termios.tcgetattr(file) == before


SHELL = """
import fcntl, subprocess, sys, termios
fcntl.ioctl(0, termios.TIOCSCTTY, 0)  # as a shell, which has its terminal under control
sys.exit(subprocess.run([sys.executable, '-c', sys.argv[1]], process_group=0, timeout=60).returncode)
"""
IN_BACKGROUND = """
import termios
from socialcircle_ros.clients.keys import listened_keys
before = termios.tcgetattr(0)
with listened_keys({}) as heard:
    assert heard
    assert termios.tcgetattr(0) == before
"""


def test_a_process_in_the_background_of_a_shell_is_not_stopped(terminal):
    _, file = terminal
    shell = [sys.executable, '-c', SHELL, IN_BACKGROUND]
    done = subprocess.run(
        shell, stdin=file, start_new_session=True, stderr=subprocess.PIPE, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_keys_are_left_to_other_programs_until_the_process_is_in_the_foreground(terminal, monkeypatch):
    keyboard, file = terminal
    groups, pressed = [os.getpgrp() + 1], queue.Queue()
    monkeypatch.setattr(os, 'tcgetpgrp', lambda _: groups[-1])
    before = termios.tcgetattr(file)
    with listened_keys({SPACE: lambda: pressed.put('space')}, file):
        os.write(keyboard, SPACE)
        assert termios.tcgetattr(file) == before
        groups.append(os.getpgrp())
        assert pressed.get(timeout=60) == 'space'
        termios.tcsetattr(file, termios.TCSADRAIN, before)  # as a shell does at Ctrl-Z
        os.write(keyboard, SPACE)
        assert pressed.get(timeout=60) == 'space'
    assert termios.tcgetattr(file) == before


def test_without_a_terminal_nothing_is_read():
    read, write = os.pipe()
    os.write(write, SPACE)
    with listened_keys({SPACE: lambda: pytest.fail('was read')}, read) as heard:
        assert not heard
    assert os.read(read, 1) == SPACE
    os.close(read)
    os.close(write)
