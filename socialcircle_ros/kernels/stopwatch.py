"""A stopwatch over consecutive steps."""

import time


class Stopwatch:
    """Measures how long each of several consecutive steps takes.

    Attributes:
        times_s: seconds of each step, in the order of their first lap.
    """

    def __init__(self) -> None:
        self.times_s: dict[str, float] = {}
        self.restart()

    def restart(self) -> None:
        """Begin the next step now: the time since the last lap belongs to no step."""
        self._since = time.perf_counter()

    def lap(self, step: str) -> None:
        """End a step and begin the next; laps of the same name add up."""
        now = time.perf_counter()
        self.times_s[step] = self.times_s.get(step, 0.0) + now - self._since
        self._since = now
