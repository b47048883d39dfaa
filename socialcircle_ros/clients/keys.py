# SPDX-License-Identifier: Apache-2.0
"""Keys of the terminal while a command runs."""

import os
import select
import sys
import termios
import threading
import tty
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager

from socialcircle_ros.terminal import is_in_foreground

_PERIOD_S = 0.1  # between two checks whether the command has ended
_MOST_BYTES = 64  # that are read at once
_LOCAL_MODES = 3  # their place among the attributes of a terminal

SPACE, RIGHT, UP, DOWN = b' ', b'\x1b[C', b'\x1b[A', b'\x1b[B'


@contextmanager
def listened_keys(actions: Mapping[bytes, Callable[[], object]], terminal: int | None = None) -> Iterator[bool]:
    """Call an action at each press of its key, on a thread of its own. Ctrl-C works as always.

    While the process runs in the background of a shell, the keys are for other programs, and the terminal is left
    alone.

    Args:
        actions: by what the key sends, such as `SPACE`.
        terminal: its file descriptor; None: that of the standard input.

    Yields:
        Whether there is a terminal to listen to; without one, nothing is read.
    """
    try:
        terminal = sys.stdin.fileno() if terminal is None else terminal
        termios.tcgetattr(terminal)
    except (OSError, ValueError, termios.error):
        yield False
        return
    keyboard, ended = _Keyboard(terminal), threading.Event()

    def listen() -> None:
        while not ended.is_set():
            if not keyboard.is_taken():
                ended.wait(_PERIOD_S)
            elif select.select([terminal], [], [], _PERIOD_S)[0]:
                pressed = os.read(terminal, _MOST_BYTES)
                if not pressed:
                    return
                for key in _keys(pressed, actions):
                    actions[key]()

    thread = threading.Thread(target=listen, name='keys', daemon=True)
    keyboard.is_taken()
    thread.start()
    try:
        yield True
    finally:
        ended.set()
        thread.join()
        keyboard.give_back()


class _Keyboard:
    """A terminal that gives each key at once, without Enter, to the process in its foreground.

    The kernel stops a process that reads from its terminal, or changes it, from the background.

    Args:
        terminal: its file descriptor.
    """

    def __init__(self, terminal: int) -> None:
        self._terminal = terminal
        self._before: list[int | list[bytes | int]] | None = None  # its attributes

    def is_taken(self) -> bool:
        """Whether keys come to this process; if so, each comes at once from now on."""
        if not is_in_foreground(self._terminal):
            return False
        attributes = termios.tcgetattr(self._terminal)
        if attributes[_LOCAL_MODES] & termios.ICANON:  # again after Ctrl-Z and fg, as a shell resets its terminal
            self._before = self._before or attributes
            tty.setcbreak(self._terminal, termios.TCSADRAIN)
        return True

    def give_back(self) -> None:
        """Put the terminal as it was, unless it belongs to other programs now."""
        if self._before is not None and is_in_foreground(self._terminal):
            termios.tcsetattr(self._terminal, termios.TCSADRAIN, self._before)


def _keys(pressed: bytes, known: Collection[bytes]) -> Iterator[bytes]:
    """The known keys among what was pressed, in order; several may have been pressed since the last look."""
    while pressed:
        key = next((each for each in known if pressed.startswith(each)), None)
        if key is not None:
            yield key
        pressed = pressed[len(key or b'.') :]
