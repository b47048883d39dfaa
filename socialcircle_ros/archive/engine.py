# SPDX-License-Identifier: Apache-2.0
"""Dask as the engine: a local cluster of processes, or a scheduler that is there."""

import json
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar

from socialcircle_ros.errors import SocialCircleError, install_command
from socialcircle_ros.kernels.machine import usable_cores

if TYPE_CHECKING:
    from distributed import Client

Item = TypeVar('Item')
Result = TypeVar('Result')

_CONNECT_S = 10
_LEAST_AHEAD, _AHEAD_PER_THREAD = 64, 4


class Engine(Generic[Item, Result]):
    """Runs one function on many items; a context manager that ends what it has started.

    Args:
        scheduler: address of a Dask scheduler such as tcp://host:8786, or its scheduler file. None: processes of
            this machine, one for each core that this process may use.
        workers: number of processes of this machine; None: one per core.

    Attributes:
        dashboard: address of Dask's dashboard; '': it has none.

    Raises:
        SocialCircleError: Dask is not installed, or no scheduler answers.
    """

    def __init__(self, scheduler: str | None = None, workers: int | None = None) -> None:
        try:
            import distributed  # noqa: PLC0415 - an extra
        except ImportError:
            raise SocialCircleError(f'A batch needs Dask: {install_command("batch")}.') from None
        self._distributed = distributed
        self._cluster: distributed.LocalCluster | None = None
        if scheduler is None:
            self._cluster = distributed.LocalCluster(
                n_workers=workers or usable_cores(),
                threads_per_worker=1,
                dashboard_address='127.0.0.1:0',
                silence_logs=50,
            )
            self._client = distributed.Client(self._cluster, set_as_default=False)
        else:
            self._client = self._connected(scheduler)
        self.dashboard: str = self._client.dashboard_link or ''

    def run(
        self, function: Callable[[Item], Result], items: Iterable[Item]
    ) -> Iterator[tuple[Item, Result | Exception]]:
        """Call a function on each item on the workers, and yield each item with its result as soon as it is there.

        Few items are handed to the scheduler in advance, so that neither it nor this process holds all of them. A
        task whose worker ends is done again on another worker; after several lost workers its result is an error.

        Args:
            function: of a module that the workers can import.
            items: are sent to the workers.
        """
        coming = iter(items)
        waiting: dict[str, Item] = {}
        results = self._distributed.as_completed(loop=self._client.loop, raise_errors=False)
        ahead = max(_LEAST_AHEAD, _AHEAD_PER_THREAD * sum(self._client.nthreads().values()))

        def hand_over(count: int) -> None:
            for item in islice(coming, count):
                future = self._client.submit(function, item, pure=False)
                waiting[future.key] = item
                results.add(future)

        hand_over(ahead)
        for future in results:
            item = waiting.pop(future.key)
            if future.status == 'finished':
                result: Result | Exception = future.result()
            else:
                error = None if future.status == 'cancelled' else future.exception()
                lost = SocialCircleError('The task was cancelled, because the scheduler ended.')
                result = error if isinstance(error, Exception) else lost
            future.release()
            hand_over(1)
            yield item, result

    def close(self) -> None:
        """End the tasks and the processes that were started."""
        self._client.close()
        if self._cluster is not None:
            self._cluster.close()

    def __enter__(self) -> 'Engine[Item, Result]':
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _connected(self, scheduler: str) -> 'Client':
        try:
            if '://' not in scheduler and scheduler.endswith('.json'):
                # Dask waits for a file without end; its content is the address.
                scheduler = json.loads(Path(scheduler).read_bytes())['address']
            return self._distributed.Client(scheduler, timeout=_CONNECT_S, set_as_default=False)
        except (OSError, ValueError, KeyError, TypeError, TimeoutError) as error:
            raise SocialCircleError(
                f'No Dask scheduler answers at {scheduler} ({type(error).__name__}): start one with `dask'
                ' scheduler`, or leave --scheduler out.'
            ) from None
