"""How a kernel's work is shared among the cores: bands of rows, whose borders change no result."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache

limit: int | None = None
"""At most so many threads; None: as many as there are cores that this process may use."""


def in_bands(work: Callable[[int, int], object], rows: int, least: int) -> None:
    """Call `work(first, last)` for bands of rows that together are all of `rows`, side by side.

    The kernels that it calls release the interpreter's lock. What a row becomes must not depend on its band.

    Args:
        work: called with the first row of a band and the one behind its last.
        rows: how many there are.
        least: a band of fewer rows is not worth a thread, which costs some 50 µs.
    """
    bands = max(1, min(cores() if limit is None else limit, rows // max(least, 1)))
    edges = [rows * band // bands for band in range(bands + 1)]
    others = [_pool().submit(work, *edges[band : band + 2]) for band in range(1, bands)]
    work(0, edges[1])
    for other in others:
        other.result()


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0))


@cache
def _pool() -> ThreadPoolExecutor:
    """Threads that wait for the next cloud: starting them anew would cost as much as a small one's filter."""
    return ThreadPoolExecutor(os.cpu_count(), thread_name_prefix='band')


os.register_at_fork(after_in_child=_pool.cache_clear)  # a child has the pool, but not its threads
