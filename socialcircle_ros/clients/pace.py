# SPDX-License-Identifier: Apache-2.0
"""Recorded time as it passes for a replay: it runs at a rate, pauses, and goes on by single messages."""

import math
import threading
import time
from collections.abc import Callable

_SLOWEST, _FASTEST = 0.01, 1000.0


class Pace:
    """Tells when a message is due. Another thread, such as that of the keyboard, may change it.

    Args:
        rate: 2 lets recorded time pass twice as fast as recorded; above 0.
        paused: whether recorded time stands still at first.
        monotonic: a clock in seconds.
    """

    def __init__(
        self, rate: float = 1.0, *, paused: bool = False, monotonic: Callable[[], float] = time.monotonic
    ) -> None:
        self._rate = rate
        self._paused = paused
        self._monotonic = monotonic
        self._steps = 0
        self._anchor = (monotonic(), 0)  # a moment, and the recorded time then in ns
        self._lock = threading.Lock()

    @property
    def rate(self) -> float:
        """How fast recorded time passes while it is not paused."""
        return self._rate

    @property
    def paused(self) -> bool:
        """Whether recorded time stands still."""
        return self._paused

    def start(self, recorded_ns: int) -> None:
        """Let recorded time begin."""
        with self._lock:
            self._anchor = self._monotonic(), recorded_ns

    def now_ns(self) -> int:
        """The recorded time, in ns."""
        with self._lock:
            return self._now_ns()

    def is_due(self, log_time: int) -> bool:
        """Whether the next message, with a log time in ns, is due. If so, a step is used up."""
        with self._lock:
            if not self._paused:
                return self._now_ns() >= log_time
            if not self._steps:
                return False
            self._steps -= 1
            self._anchor = self._monotonic(), log_time
            return True

    def seconds_until(self, log_time: int) -> float:
        """Time in s until a message is due, if nothing changes; infinite while paused."""
        with self._lock:
            if self._paused:
                return 0.0 if self._steps else math.inf
            return max(0.0, (log_time - self._now_ns()) / self._rate / 1e9)

    def toggle_pause(self) -> None:
        """Pause, or go on."""
        with self._lock:
            self._anchor = self._monotonic(), self._now_ns()
            self._paused = not self._paused
            self._steps = 0

    def step(self) -> None:
        """Let one more message pass while paused."""
        with self._lock:
            self._steps += self._paused

    def multiply_rate(self, factor: float) -> None:
        """Change the rate, within 0.01 and 1000."""
        with self._lock:
            self._anchor = self._monotonic(), self._now_ns()
            self._rate = min(max(self._rate * factor, _SLOWEST), _FASTEST)

    def _now_ns(self) -> int:
        moment, recorded_ns = self._anchor
        if self._paused:
            return recorded_ns
        return recorded_ns + int((self._monotonic() - moment) * self._rate * 1e9)
