# SPDX-License-Identifier: Apache-2.0
"""A stopwatch over consecutive steps."""

import time


class Stopwatch:
    """Measures how long each of several consecutive steps takes.

    Attributes:
        times_ms: time of each step in ms, in the order of their first lap.
    """

    def __init__(self) -> None:
        self.times_ms: dict[str, float] = {}
        self.restart()

    def restart(self) -> None:
        """Begin the next step now: the time since the last lap belongs to no step."""
        self._since_s = time.perf_counter()

    def lap(self, step: str) -> None:
        """End a step and begin the next; laps of the same name add up."""
        now_s = time.perf_counter()
        self.times_ms[step] = self.times_ms.get(step, 0.0) + 1e3 * (now_s - self._since_s)
        self._since_s = now_s
