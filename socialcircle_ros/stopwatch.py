"""Stage times in milliseconds."""

import time


class Stopwatch:
    """Times the stages of one job, one after the other.

    Attributes:
        times_ms: time of each stage in ms, in the order of the stages.
    """

    def __init__(self) -> None:
        self.times_ms: dict[str, float] = {}
        self.restart()

    def restart(self) -> None:
        """Begin the next stage now; the time since the last stage counts for none."""
        self._since_s = time.perf_counter()

    def lap(self, stage: str) -> None:
        """End a stage, which began with the stage before it; a stage that was timed before gets the sum."""
        now_s = time.perf_counter()
        self.times_ms[stage] = self.times_ms.get(stage, 0.0) + 1e3 * (now_s - self._since_s)
        self._since_s = now_s
