"""One thread that works on the newest job; a job that is overtaken while it waits is dropped. No rclpy."""

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
