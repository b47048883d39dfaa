"""Threads that work: one on the newest job only, one on every job in its order. No rclpy."""

import contextlib
import queue
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

Job = TypeVar('Job')


class LatestWorker(Generic[Job]):
    """Runs `work` on a thread of its own, for one job at a time, always the newest.

    A controller wants the answer to the last part, not to the one before it: there is one place to wait in,
    and a new job takes it over.

    Args:
        work: called with each job on the worker's thread; must not raise.
        dropped: called with each job that is overtaken, on the thread that put the newer one.
    """

    def __init__(self, work: Callable[[Job], None], dropped: Callable[[Job], None]) -> None:
        self._work = work
        self._dropped = dropped
        self._changed = threading.Condition()
        self._waiting: Job | None = None
        self._busy = False
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name='social_circle_worker')
        self._thread.start()

    def put(self, job: Job) -> None:
        """Hand over the newest job."""
        with self._changed:
            overtaken, self._waiting = self._waiting, job
            self._changed.notify_all()
        if overtaken is not None:
            self._dropped(overtaken)

    def drain(self) -> None:
        """Wait until nothing waits and nothing is being worked on."""
        with self._changed:
            self._changed.wait_for(lambda: self._stopping or (self._waiting is None and not self._busy))

    def stop(self) -> None:
        """Let the job at hand end, drop what waits, and join the thread; may be called twice."""
        with self._changed:
            self._stopping = True
            self._waiting = None
            self._changed.notify_all()
        self._thread.join()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._stopping or self._waiting is not None)
                if self._stopping:
                    return
                job, self._waiting, self._busy = self._waiting, None, True
            if job is not None:
                self._work(job)
            with self._changed:
                self._busy = False
                self._changed.notify_all()


class QueueWorker(Generic[Job]):
    """Runs `work` on a thread of its own for every job, in the order in which they came.

    Every frame of a stack counts, so that they wait for each other; only where too many wait is one dropped.

    Args:
        work: called with each job on the worker's thread; must not raise.
        idle: called on the worker's thread whenever nothing came for `pause` seconds.
        most: so many jobs may wait.
        pause: seconds.
    """

    def __init__(self, work: Callable[[Job], None], idle: Callable[[], None], most: int, pause: float) -> None:
        self._work = work
        self._idle = idle
        self._pause = pause
        self._jobs: queue.Queue[Job | None] = queue.Queue(most)
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name='stack_worker')
        self._thread.start()

    def put(self, job: Job) -> bool:
        """Hand over a job; False where too many wait, and it is dropped."""
        try:
            self._jobs.put_nowait(job)
        except queue.Full:
            return False
        return True

    def stop(self) -> None:
        """Let the job at hand end, drop what waits, and join the thread; may be called twice."""
        self._stopping.set()
        with contextlib.suppress(queue.Full):
            self._jobs.put_nowait(None)  # wakes the thread at once
        self._thread.join()

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                job = self._jobs.get(timeout=self._pause)
            except queue.Empty:
                self._idle()
                continue
            if job is not None and not self._stopping.is_set():
                self._work(job)
