"""How a kernel's work is shared among the cores: bands of rows, whose borders change no result."""

import itertools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TypeVar

Result = TypeVar('Result')

limit: int | None = None
"""At most so many threads; None: as many as there are cores that this process may use."""

_LEAST = 100_000  # pixels or points of a band


def in_bands(work: Callable[[slice], Result], height: int, width: int, least: int | None = None) -> list[Result]:
    """Have kernels work on bands of rows side by side, on every core.

    The kernels release the interpreter's lock. What a row becomes must not depend on its band.

    Args:
        work: called once for each band, with its rows; does not call this function itself.
        height: how many rows there are.
        width: what a row holds, such as pixels.
        least: a band that holds less is not worth a thread, which costs some 50 µs; None: for pixels or points.

    Returns:
        What `work` gave for each band, from the first row to the last.
    """
    worth = height * width // (_LEAST if least is None else least)
    bands = max(1, min(cores() if limit is None else limit, worth, height))
    edges = [height * band // bands for band in range(bands + 1)]
    first, *rest = itertools.starmap(slice, itertools.pairwise(edges))
    others = [_pool().submit(work, band) for band in rest]
    return [work(first), *(other.result() for other in others)]


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0))


@cache
def _pool() -> ThreadPoolExecutor:
    """Threads that wait for the next cloud: starting them anew would cost as much as a small one's filter."""
    return ThreadPoolExecutor(os.cpu_count(), thread_name_prefix='band')


os.register_at_fork(after_in_child=_pool.cache_clear)  # a child has the pool, but not its threads
