# SPDX-License-Identifier: Apache-2.0
"""Dask as the engine: one function on many items, on the cores of this machine or on a cluster that is there."""

import importlib.metadata
import importlib.util
import json
import multiprocessing
import multiprocessing.forkserver
import multiprocessing.resource_tracker
import os
import platform
import signal
import tempfile
import uuid
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar

from socialcircle_ros.arguments import check_count
from socialcircle_ros.errors import SocialCircleError, install_command
from socialcircle_ros.kernels import bands
from socialcircle_ros.kernels.machine import usable_cores
from socialcircle_ros.kernels.memory import keep_freed_memory
from socialcircle_ros.storage import raised_signals

if TYPE_CHECKING:
    from distributed import Client, Future

Item = TypeVar('Item')
Result = TypeVar('Result')

_CONNECT_S = 10
_LEAST_AHEAD, _AHEAD_PER_THREAD = 64, 4
_ONE_THREAD = {'OMP_NUM_THREADS': '1', 'OPENBLAS_NUM_THREADS': '1', 'MKL_NUM_THREADS': '1'}
_PACKAGE = 'socialcircle_ros'


class Engine(Generic[Item, Result]):
    """Runs one function on many items; a context manager that ends what it has started.

    Args:
        scheduler: address of a Dask scheduler such as tcp://host:8786, or its scheduler file. None: processes of
            this machine, one for each core that this process may use.
        workers: number of processes of this machine; None: one per core.
        preload: names of modules that these processes need. They are imported once, by a process from which the
            others are forked; until then it must have no threads.

    Attributes:
        dashboard: address of Dask's dashboard; '': it has none.

    Raises:
        SettingError: `workers` is not a number of processes.
        SocialCircleError: Dask is not installed, or no scheduler answers.
    """

    def __init__(
        self, scheduler: str | None = None, workers: int | None = None, preload: Sequence[str] = ()
    ) -> None:
        if workers is not None:
            check_count('workers', workers)
        if importlib.util.find_spec('distributed') is None:
            raise SocialCircleError(f'This needs Dask: {install_command("batch")}.')
        with ExitStack() as started:
            started.enter_context(raised_signals())
            if scheduler is None:
                started.enter_context(_one_thread_each())
                _start_fork_server(preload)  # imports on another core while this process imports Dask
            import dask  # noqa: PLC0415 - an extra
            import distributed  # noqa: PLC0415

            self._distributed = distributed
            if scheduler is None:
                # Dask would import pandas and more here, to name them to a fork server that runs already.
                distributed.utils._forkserver_preload_set = True  # noqa: SLF001 - there is no setting for it
                # A process that takes the place of one that ended is forked as well.
                method = {'distributed.worker.multiprocessing-method': 'forkserver'}
                folder = started.enter_context(_own_folder())
                if folder is not None:
                    started.enter_context(dask.config.set({'temporary-directory': folder}))
                started.enter_context(dask.config.set(method))
                cluster = distributed.LocalCluster(
                    n_workers=usable_cores() if workers is None else workers,
                    threads_per_worker=1,
                    dashboard_address='127.0.0.1:0',
                    silence_logs=50,
                )
                self._client = started.enter_context(
                    distributed.Client(started.enter_context(cluster), set_as_default=False)
                )
            else:
                self._client = started.enter_context(self._connected(scheduler))
                self._check_workers()
            self._started = started.pop_all()
        self.dashboard: str = self._client.dashboard_link or ''

    def run(
        self, function: Callable[[Item], Result], items: Iterable[Item], *, eager: bool = True
    ) -> Iterator[tuple[Item, Result | Exception]]:
        """Call a function on each item on the workers, and yield each item with its result as soon as it is there.

        Few items are handed to the scheduler in advance, so that neither it nor this process holds all of them. A
        task whose worker ends is done again on another worker; after several lost workers its result is an error.
        Kernels use one thread, because other cores have tasks of their own.

        Args:
            function: of a module that the workers can import.
            items: are sent to the workers.
            eager: whether some items per thread are handed over in advance, so that no thread waits; if not, one
                per thread, and each is taken after the results before it have been yielded.
        """
        coming = iter(items)
        waiting: dict[str, Item] = {}
        results = self._distributed.as_completed(loop=self._client.loop, raise_errors=False)
        call = partial(_call, function, importlib.metadata.version(_PACKAGE))

        def hand_over(count: int) -> None:
            new = {f'{function.__name__}-{uuid.uuid4().hex}': item for item in islice(coming, count)}
            if new:  # Dask's cost is more for a message than for a task
                waiting.update(new)
                results.update(self._client.map(call, list(new.values()), key=list(new), pure=False))

        threads = self._threads()
        hand_over(max(_LEAST_AHEAD, _AHEAD_PER_THREAD * threads) if eager else max(1, threads))
        for futures in results.batches():
            if eager:
                hand_over(len(futures))
            for future, result in zip(futures, self._results(futures), strict=True):
                yield waiting.pop(future.key), result
                future.release()
                if not eager:  # workers may have come or gone
                    hand_over(max(1, self._threads()) - len(waiting))

    def close(self) -> None:
        """End the tasks and the processes that were started."""
        self._started.close()

    def __enter__(self) -> 'Engine[Item, Result]':
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _check_workers(self) -> None:
        """Check that the workers have this package: one that lacks it would wait without end.

        Raises:
            SocialCircleError: a worker has no or another version.
        """
        found = self._client.run(importlib.metadata.version, _PACKAGE, on_error='return')
        mine = importlib.metadata.version(_PACKAGE)
        for worker, version in found.items():
            if version != mine:
                has = f'version {version}' if isinstance(version, str) else 'none'
                raise SocialCircleError(
                    f'The worker {worker} needs {_PACKAGE} {mine}, as here, and has {has}. Install it there.'
                )

    def _threads(self) -> int:
        """The number of threads of all workers that are there now."""
        return sum(self._client.nthreads().values())

    def _results(self, futures: Sequence['Future']) -> list[Result | Exception]:
        """The results of tasks that have ended, or why there is none."""
        finished = [future for future in futures if future.status == 'finished']
        results: dict[str, Result] = {}
        with suppress(Exception):  # one was lost with its worker, and its task failed when it was done again
            keys = [future.key for future in finished]
            results = dict(zip(keys, self._client.gather(finished), strict=True))
        return [results[future.key] if future.key in results else self._result(future) for future in futures]

    def _result(self, future: 'Future') -> Result | Exception:
        """The result of one task, or why there is none."""
        if future.status == 'cancelled':
            return SocialCircleError('The task was cancelled, because the scheduler ended.')
        try:
            error = future.exception()
            if error is None:
                result: Result = future.result()
                return result
        except Exception as lost:  # noqa: BLE001 - whatever a task may raise
            error = lost
        if isinstance(error, self._distributed.scheduler.KilledWorker):
            return SocialCircleError(
                'The workers of this task ended several times, probably because memory ran out.'
            )
        return error if isinstance(error, Exception) else SocialCircleError(f'The task ended: {error}')

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


@contextmanager
def _own_folder() -> Iterator[str | None]:
    """A folder for what Dask puts aside; None: it chooses one itself, and clears it up at its next start.

    Where no folder for temporary files can be written, Python takes the current one, in which Dask would leave a
    folder.

    Raises:
        FileNotFoundError: that cannot be written either.
    """
    if Path(tempfile.gettempdir()).samefile('.'):
        with tempfile.TemporaryDirectory() as folder:
            yield folder
    else:
        yield None


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Let the processes that are started meanwhile use one thread in their libraries, as Dask's own do."""
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(_ONE_THREAD)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value


def _start_fork_server(preload: Sequence[str]) -> None:
    """Start the process from which those of the workers are forked, if there is none.

    A forked process has all modules at once; a new one imports them for seconds. A terminal sends Ctrl-C to all of
    them, but this process alone acts on it, and ends the others.
    """
    multiprocessing.get_context('forkserver').set_forkserver_preload(['distributed.nanny', *preload])
    multiprocessing.resource_tracker.ensure_running()  # which would unblock the signal
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])  # the processes inherit it
    try:
        multiprocessing.forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _call(function: Callable[[Item], Result], version: str, item: Item) -> Result:
    """Call the function in a worker, which may have come after the others.

    Raises:
        SocialCircleError: the worker has another version of this package, whose results may differ.
    """
    mine = importlib.metadata.version(_PACKAGE)
    if version != mine:
        raise SocialCircleError(
            f'The worker on {platform.node()} needs {_PACKAGE} {version}, as the client, and has version {mine}.'
            ' Install it there.'
        )
    bands.limit = 1
    keep_freed_memory()
    return function(item)
