"""Work on all cores; what is compiled and what numpy does release the GIL, so that threads are enough."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

from .machine import usable_cores

Item = TypeVar('Item')
Result = TypeVar('Result')


def in_order(function: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
    """The results of `function` in the order of the items, of which few are in memory at a time."""
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
