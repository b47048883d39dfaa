# SPDX-License-Identifier: Apache-2.0
"""Bands of rows: a kernel's work is shared among the cores, and where the bands meet changes no result."""

import contextlib
import ctypes
import itertools
import os
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import cache
from typing import TypeVar

from .machine import usable_cores

Result = TypeVar('Result')

limit: int | None = None
"""Greatest number of threads; None: the number of cores that this process may use."""

_LEAST = 100_000  # pixels or points of a band


def in_bands(work: Callable[[slice], Result], height: int, width: int, least: int | None = None) -> list[Result]:
    """Run kernels on bands of rows in parallel, on all cores.

    The kernels release the GIL. The result of a row must not depend on its band.

    Args:
        work: called once for each band with the slice of its rows; it must not call `in_bands` itself.
        height: number of rows.
        width: items of a row, such as pixels.
        least: items that make a band worth a thread, which costs about 50 µs; None: the number for pixels or
            points.

    Returns:
        The results of `work`, from the first band to the last.
    """
    worth = height * width // (_LEAST if least is None else least)
    bands = max(1, min(usable_cores() if limit is None else limit, worth, height))
    edges = [height * band // bands for band in range(bands + 1)]
    slices = list(itertools.starmap(slice, itertools.pairwise(edges)))
    return [work(slices[0])] if bands == 1 else _helpers().share(work, slices)


class _Helpers:
    """Threads that wait for work: starting them for each cloud would cost as much as filtering a small one.

    The helpers do not run on the core of the calling thread. Linux often wakes a thread on the core of the
    thread that wakes it, which goes on to work there, so that the helper waits for that work to end. After a
    pause of 10 ms or more a second core then gained nothing: two times 1.7 ms of work took 3.6 ms, and take 2.0
    ms with this placement. While several threads call, such as the filter and the fit of a stack, the helpers
    may run on any core, because each caller's core is free for the helpers of the others.
    """

    def __init__(self) -> None:
        self._current_core = ctypes.CDLL(None).sched_getcpu
        self._threads: list[int] = []
        self._placed: tuple[set[int], int] = (set(), 0)
        self._callers = 0
        self._changing = threading.Lock()
        self._pool = ThreadPoolExecutor(
            usable_cores(), 'band', initializer=lambda: self._threads.append(threading.get_native_id())
        )

    def share(self, work: Callable[[slice], Result], bands: list[slice]) -> list[Result]:
        """Work on the first band in the calling thread, and on the others in the helpers.

        If that fails, as by Ctrl-C, no helper works on when this ends: the caller may use the memory again.
        """
        others: list[tuple[slice, Future[Result]]] = []
        with self._changing:
            self._callers += 1
            self._place()
        try:
            for band in bands[1:]:
                others.append((band, self._pool.submit(work, band)))  # noqa: PERF401 - known one by one
            # Bands that no helper has started by then run in the calling thread.
            return [work(bands[0]), *(work(band) if job.cancel() else job.result() for band, job in others)]
        except BaseException:
            wait([job for _, job in others if not job.cancel()])
            raise
        finally:
            with self._changing:
                self._callers -= 1

    def _place(self) -> None:
        """Set the cores on which the helpers may run."""
        allowed = os.sched_getaffinity(0)
        cores = allowed - {self._current_core()} if self._callers == 1 else allowed
        threads = tuple(self._threads)
        if cores and self._placed != (cores, len(threads)):
            self._placed = cores, len(threads)
            for thread in threads:
                with contextlib.suppress(OSError):  # where it is not permitted, only speed is lost
                    os.sched_setaffinity(thread, cores)


@cache
def _helpers() -> _Helpers:
    return _Helpers()


os.register_at_fork(after_in_child=_helpers.cache_clear)  # a child process has the pool, but not its threads
