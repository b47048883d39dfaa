# SPDX-License-Identifier: Apache-2.0
"""Signals while files are written: raised as an exception, noted, put off to the end of a step, or raised again.

Python runs the handlers of signals in the main thread only, so elsewhere these functions do nothing.
"""

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType

# What ends a process unless it is handled, and leaves time to clean up. SIGINT raises KeyboardInterrupt already.
_TERMINATING = (signal.SIGTERM, signal.SIGHUP)


class SignalExit(SystemExit):
    """A signal that ends the process, raised in the main thread so that `with` blocks clean up.

    Attributes:
        signal: the signal. The exit code is 128 and its number, as shells have it.
    """

    def __init__(self, number: int) -> None:
        super().__init__(128 + number)
        self.signal = signal.Signals(number)


@dataclass
class NotedSignal:
    """What `noted_signals` has noted.

    Attributes:
        first: the first signal that came; None: none has come.
    """

    first: signal.Signals | None = None


def _raise(number: int, _: FrameType | None) -> None:
    raise SignalExit(number)


class _Raising:
    """Raises SIGTERM and SIGHUP as SignalExit while at least one holder wants that.

    Only signals with the default action are changed: a program with handlers of its own keeps them, and a signal
    that is ignored, as by nohup, stays ignored.
    """

    def __init__(self) -> None:
        self._holders = 0

    def begin(self) -> bool:
        """Begin; False in a thread other than the main thread, where nothing is changed."""
        if threading.current_thread() is not threading.main_thread():
            return False
        for number in _TERMINATING:
            if signal.getsignal(number) is signal.SIG_DFL:
                signal.signal(number, _raise)
        self._holders += 1
        return True

    def end(self, *, begun: bool) -> None:
        """End what `begin` began, if it did."""
        self._holders -= begun
        if self._holders or threading.current_thread() is not threading.main_thread():
            return
        for number in _TERMINATING:
            if signal.getsignal(number) is _raise:
                signal.signal(number, signal.SIG_DFL)


raising = _Raising()
"""Of this process."""


@contextmanager
def raised_signals() -> Iterator[None]:
    """Raise SIGTERM and SIGHUP as SignalExit in the block, so that what it has started is ended."""
    begun = raising.begin()
    try:
        yield
    finally:
        raising.end(begun=begun)


@contextmanager
def noted_signals(*numbers: signal.Signals) -> Iterator[NotedSignal]:
    """Note signals instead of acting on them, so that a loop can look for them between two steps.

    Args:
        numbers: the signals. Those that are ignored, as by nohup, stay ignored.

    Yields:
        What has been noted so far.
    """
    noted = NotedSignal()

    def note(number: int, _: FrameType | None) -> None:
        noted.first = noted.first or signal.Signals(number)

    with _handled(numbers, note):
        yield noted


@contextmanager
def postponed_signals() -> Iterator[None]:
    """Put off SIGINT, SIGTERM and SIGHUP to the end of the block, so that a step of a few renames is not torn."""
    noted: list[int] = []
    try:
        with _handled((signal.SIGINT, *_TERMINATING), lambda number, _: noted.append(number)):
            yield
    finally:
        for number in noted[:1]:
            signal.raise_signal(number)


@contextmanager
def _handled(numbers: tuple[signal.Signals, ...], handler: object) -> Iterator[None]:
    """Handle signals in the block, where Python knows how to restore what was there before."""
    before = {}
    try:
        if threading.current_thread() is threading.main_thread():
            for number in numbers:
                found = signal.getsignal(number)
                if found is not None and found is not signal.SIG_IGN:
                    before[number] = found
                    signal.signal(number, handler)  # type: ignore[arg-type]
        yield
    finally:
        for number, found in before.items():
            signal.signal(number, found)


_AGAIN_S = 0.1  # after an interruption that was lost


@contextmanager
def lasting_interruption() -> Iterator[NotedSignal]:
    """Note SIGINT, which raises KeyboardInterrupt as ever, and raise it again if it is lost.

    Python drops an exception in a finalizer or in a function that C calls, and libraries make other errors of it:
    Numba does both while it compiles. Handlers that are set in the block are not changed.

    Yields:
        Whether SIGINT has come.
    """
    noted = NotedSignal()
    main = threading.main_thread()
    if threading.current_thread() is not main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield noted
        return
    timers: list[threading.Timer] = []
    others = sys.unraisablehook

    def interrupt(number: int, frame: FrameType | None) -> None:
        noted.first = signal.SIGINT
        signal.default_int_handler(number, frame)

    def again(lost: 'sys.UnraisableHookArgs') -> None:
        if not isinstance(lost.exc_value, KeyboardInterrupt):
            others(lost)
            return
        timers.append(threading.Timer(_AGAIN_S, signal.pthread_kill, (main.ident, signal.SIGINT)))
        timers[-1].daemon = True
        timers[-1].start()

    signal.signal(signal.SIGINT, interrupt)
    sys.unraisablehook = again
    try:
        yield noted
    finally:
        sys.unraisablehook = others
        for timer in timers:
            timer.cancel()
        if signal.getsignal(signal.SIGINT) is interrupt:
            signal.signal(signal.SIGINT, signal.default_int_handler)
