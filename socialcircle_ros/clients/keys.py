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

_PERIOD_S = 0.1  # between two checks whether the command has ended
_MOST_BYTES = 64  # that are read at once

SPACE, RIGHT, UP, DOWN = b' ', b'\x1b[C', b'\x1b[A', b'\x1b[B'


@contextmanager
def listened_keys(actions: Mapping[bytes, Callable[[], object]], terminal: int | None = None) -> Iterator[bool]:
    """Call an action at each press of its key, on a thread of its own. Ctrl-C works as always.

    Args:
        actions: by what the key sends, such as `SPACE`.
        terminal: its file descriptor; None: that of the standard input.

    Yields:
        Whether there is a terminal to listen to; without one, nothing is read.
    """
    try:
        terminal = sys.stdin.fileno() if terminal is None else terminal
        before = termios.tcgetattr(terminal)
    except (OSError, ValueError, termios.error):
        yield False
        return
    ended = threading.Event()

    def listen(terminal: int) -> None:
        while not ended.is_set():
            if select.select([terminal], [], [], _PERIOD_S)[0]:
                pressed = os.read(terminal, _MOST_BYTES)
                if not pressed:
                    return
                for key in _keys(pressed, actions):
                    actions[key]()

    thread = threading.Thread(target=listen, args=(terminal,), name='keys', daemon=True)
    tty.setcbreak(terminal)
    thread.start()
    try:
        yield True
    finally:
        ended.set()
        thread.join()
        termios.tcsetattr(terminal, termios.TCSADRAIN, before)


def _keys(pressed: bytes, known: Collection[bytes]) -> Iterator[bytes]:
    """The known keys among what was pressed, in order; several may have been pressed since the last look."""
    while pressed:
        key = next((each for each in known if pressed.startswith(each)), None)
        if key is not None:
            yield key
        pressed = pressed[len(key or b'.') :]
