"""How a kernel's work is shared among the cores: bands of rows, whose borders change no result."""

import contextlib
import ctypes
import itertools
import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TypeVar

from .machine import usable_cores

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
    bands = max(1, min(usable_cores() if limit is None else limit, worth, height))
    edges = [height * band // bands for band in range(bands + 1)]
    slices = list(itertools.starmap(slice, itertools.pairwise(edges)))
    return [work(slices[0])] if bands == 1 else _helpers().share(work, slices)


class _Helpers:
    """Threads that wait for the next cloud: starting them anew would cost as much as a small one's filter.

    They are kept off the core of who calls them. Linux often wakes a thread on the core of its waker, who goes on
    to work there, so that it waits until that work is done: after a rest of 10 ms or more nothing was gained
    by a second core (3.6 ms for two times 1.7 ms of work, 2.0 with this). While several call, as the filter and
    a stack's fit may, one's core is another's elsewhere, and the helpers go where they like.
    """

    def __init__(self) -> None:
        self._core_at_hand = ctypes.CDLL(None).sched_getcpu
        self._threads: list[int] = []
        self._placed: tuple[set[int], int] = (set(), 0)
        self._callers = 0
        self._changing = threading.Lock()
        self._pool = ThreadPoolExecutor(
            usable_cores(), 'band', initializer=lambda: self._threads.append(threading.get_native_id())
        )

    def share(self, work: Callable[[slice], Result], bands: list[slice]) -> list[Result]:
        """Work on the first band, while the helpers work on the others."""
        with self._changing:
            self._callers += 1
            self._place()
        try:
            others = [(band, self._pool.submit(work, band)) for band in bands[1:]]
            # What nobody has begun by then, because the other cores are taken, is done here.
            return [work(bands[0]), *(work(band) if job.cancel() else job.result() for band, job in others)]
        finally:
            with self._changing:
                self._callers -= 1

    def _place(self) -> None:
        """Say on which cores the helpers may run."""
        allowed = os.sched_getaffinity(0)
        places = allowed - {self._core_at_hand()} if self._callers == 1 else allowed
        threads = tuple(self._threads)
        if places and self._placed != (places, len(threads)):
            self._placed = places, len(threads)
            for thread in threads:
                with contextlib.suppress(OSError):  # where it may not be said, speed is all that is lost
                    os.sched_setaffinity(thread, places)


@cache
def _helpers() -> _Helpers:
    return _Helpers()


os.register_at_fork(after_in_child=_helpers.cache_clear)  # a child has the pool, but not its threads
