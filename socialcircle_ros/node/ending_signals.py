# SPDX-License-Identifier: Apache-2.0
"""The signals that end the node: noted only, so that the node ends in order. No rclpy.

rclpy's own handlers end the context at once, and the cloud at hand could not be published any more. Python's
handlers would raise in the middle of an import or of a call of rclpy.
"""

import os
import signal
import threading
from collections.abc import Callable
from types import FrameType

_NUMBERS = (signal.SIGINT, signal.SIGTERM)


class EndingSignals:
    """Notes SIGINT and SIGTERM; to be made in the main thread.

    Attributes:
        came: whether one has come.
    """

    def __init__(self) -> None:
        self.came = False
        self._wake: Callable[[], object] = lambda: None
        for number in _NUMBERS:
            signal.signal(number, self._note)
        # The main thread waits in rcl, where no handler of Python runs: the signal itself writes to a pipe.
        self._reading, writing = os.pipe()
        os.set_blocking(writing, False)
        signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
        threading.Thread(target=self._watch, name='signals', daemon=True).start()

    def wake_by(self, wake: Callable[[], object]) -> None:
        """Have the first signal call `wake`, on another thread, to end the wait of the main thread."""
        self._wake = wake

    def ignore(self) -> None:
        """Ignore further signals for the rest of the process: at its exit Python ends what notes them."""
        for number in _NUMBERS:
            signal.signal(number, signal.SIG_IGN)

    def _note(self, _: int, __: FrameType | None) -> None:
        self.came = True

    def _watch(self) -> None:
        # The process may have other signals, which are noted in the same pipe.
        while os.read(self._reading, 1)[0] not in _NUMBERS:
            pass
        self._wake()
