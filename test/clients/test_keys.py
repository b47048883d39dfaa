# SPDX-License-Identifier: Apache-2.0
"""Keys of a terminal, which is a pseudo-terminal here."""

import os
import queue
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


def test_without_a_terminal_nothing_is_read():
    read, write = os.pipe()
    os.write(write, SPACE)
    with listened_keys({SPACE: lambda: pytest.fail('was read')}, read) as heard:
        assert not heard
    assert os.read(read, 1) == SPACE
    os.close(read)
    os.close(write)
