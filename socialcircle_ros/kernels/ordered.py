# SPDX-License-Identifier: Apache-2.0
"""Work on many items on all cores, in threads: kernels and most of NumPy release the GIL."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

from .machine import usable_cores

Item = TypeVar('Item')
Result = TypeVar('Result')


def in_order(function: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
    """Call `function` for each item on all cores, and yield the results in the order of the items.

    Only a few items are in memory at a time: the next one is taken when the oldest result has been yielded.
    """
    cores = usable_cores()
    with ThreadPoolExecutor(cores) as pool:
        running: deque[Future[Result]] = deque()
        try:
            for item in items:
                running.append(pool.submit(function, item))
                if len(running) > cores:
                    yield running.popleft().result()
            while running:
                yield running.popleft().result()
        finally:
            for future in running:
                future.cancel()
