"""Threads that work: one on the newest job only, one on every job in its order. No rclpy."""

import queue
import threading
import traceback
from collections.abc import Callable
from typing import Generic, TypeVar

Job = TypeVar('Job')


class LatestWorker(Generic[Job]):
    """Runs `work` on a thread of its own, for one job at a time, always the newest.

    A controller wants the answer to the last part, not to the one before it: there is one place to wait in,
    and a new job takes it over. Work that is asked for again gives way to a job that waits.

    Args:
        work: called with each job on the worker's thread.
        dropped: called with each job that is overtaken, on the thread that put the newer one.
        again: does the last work once more, on the worker's thread.
    """

    def __init__(
        self, work: Callable[[Job], None], dropped: Callable[[Job], None], again: Callable[[], None] = lambda: None
    ) -> None:
        self._work = work
        self._dropped = dropped
        self._again = again
        self._again_wanted = False
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

    def put_again(self) -> None:
        """Have the last work done once more, unless a newer job is done first."""
        with self._changed:
            self._again_wanted = True
            self._changed.notify_all()

    def forget(self) -> None:
        """Drop what waits."""
        with self._changed:
            self._waiting, self._again_wanted = None, False

    def drain(self, timeout: float | None = None) -> None:
        """Wait until nothing waits and nothing is being worked on, or the time in seconds is over."""
        with self._changed:
            self._changed.wait_for(lambda: self._stopping or not (self._busy or self._wanted()), timeout)

    def _wanted(self) -> bool:
        return self._waiting is not None or self._again_wanted

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
                self._changed.wait_for(lambda: self._stopping or self._wanted())
                if self._stopping:
                    return
                # A job that begins now is done as it was asked for: nothing is left to be done again.
                job, self._waiting, self._again_wanted, self._busy = self._waiting, None, False, True
            try:
                if job is not None:
                    self._work(job)
                else:
                    self._again()
            except Exception:  # noqa: BLE001 - the last resort: without this thread nothing is filtered
                traceback.print_exc()
            with self._changed:
                self._busy = False
                self._changed.notify_all()


class QueueWorker(Generic[Job]):
    """Runs `work` on a thread of its own for every job, in the order in which they came.

    Every frame of a stack counts, so that they wait for each other; only where too many wait is one dropped.

    Args:
        work: called with each job on the worker's thread.
        idle: called on the worker's thread where nothing waits: after a job, and after each `pause` seconds.
        most: so many jobs may wait, of those that may be refused.
        pause: seconds.
    """

    def __init__(self, work: Callable[[Job], None], idle: Callable[[], None], most: int, pause: float) -> None:
        self._work = work
        self._idle = idle
        self._pause = pause
        self._most = most
        self._jobs: queue.Queue[Job | None] = queue.Queue()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name='stack_worker')
        self._thread.start()

    def put(self, job: Job) -> None:
        """Hand over a job."""
        self._jobs.put(job)

    def put_if_room(self, job: Job) -> bool:
        """Hand over a job; False where too many wait, and it is dropped."""
        if self._jobs.qsize() >= self._most:
            return False
        self._jobs.put(job)
        return True

    def stop(self) -> None:
        """Let the job at hand end, drop what waits, and join the thread; may be called twice."""
        self._stopping.set()
        self._jobs.put(None)  # wakes the thread at once
        self._thread.join()

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                job = self._jobs.get(timeout=self._pause)
            except queue.Empty:
                job = None
            if self._stopping.is_set():
                return
            try:
                if job is not None:
                    self._work(job)
                if self._jobs.empty():
                    self._idle()
            except Exception:  # noqa: BLE001 - the last resort: without this thread no frame is measured
                traceback.print_exc()
