# SPDX-License-Identifier: Apache-2.0
"""Stopwatch of the studies."""

import time
from collections.abc import Callable


def elapsed_ms(call: Callable[[], object]) -> float:
    """Wall time of one call."""
    began = time.perf_counter()
    call()
    return 1e3 * (time.perf_counter() - began)


def repeated_ms(call: Callable[[], object], repeats: int) -> list[float]:
    """Wall times of several calls, after one warm-up call that is not timed."""
    call()
    return [elapsed_ms(call) for _ in range(repeats)]
