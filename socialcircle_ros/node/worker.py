# SPDX-License-Identifier: Apache-2.0
"""Worker threads: one for the newest item only, one for every item in order. No rclpy."""

import queue
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from typing import Generic, TypeVar

Item = TypeVar('Item')

_PERIOD_S = 0.1  # between two questions whether the work at hand is still waited for


def always() -> bool:
    """Patience without an end: the wait lasts as long as the work at hand."""
    return True


def _ended(thread: threading.Thread, patient: Callable[[], bool]) -> bool:
    """Wait until a thread has ended, for as long as `patient` returns True; return whether it has.

    A thread with nothing at hand ends at once, and is given the time to do so where no patience is left.
    """
    thread.join(_PERIOD_S)
    while thread.is_alive() and patient():
        thread.join(_PERIOD_S)
    return not thread.is_alive()


class LatestWorker(Generic[Item]):
    """Runs `work` on a thread of its own, for one item at a time, always the newest.

    A controller needs the result of the last part, not of the part before. Therefore one item waits at most, and a
    newer one replaces it. A repetition of the last work has lower priority than an item that waits.

    Args:
        work: called with each item on the worker's thread.
        dropped: called with each item that is not worked on: a newer one replaced it, or it waited when the worker
            was to forget or stop; on the thread that asked for that.
        again: repeats the last work, on the worker's thread.
    """

    def __init__(
        self,
        work: Callable[[Item], None],
        dropped: Callable[[Item], None],
        again: Callable[[], None] = lambda: None,
    ) -> None:
        self._work = work
        self._dropped = dropped
        self._again = again
        self._again_wanted = False
        self._changed = threading.Condition()
        self._waiting: Item | None = None
        self._busy = False
        self._began_s = float('inf')
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name='social_circle_worker')
        self._thread.start()

    @property
    def busy_s(self) -> float:
        """For how long the work at hand has lasted; at most 0 where there is none."""
        return time.monotonic() - self._began_s

    def put(self, item: Item) -> None:
        """Hand over the newest item."""
        with self._changed:
            replaced, self._waiting = self._waiting, item
            self._changed.notify_all()
        if replaced is not None:
            self._dropped(replaced)

    def put_again(self) -> None:
        """Repeat the last work, unless a newer item is worked on first."""
        with self._changed:
            self._again_wanted = True
            self._changed.notify_all()

    def forget(self) -> None:
        """Drop the item that waits for the work at hand; one that waits for nothing else begins."""
        with self._changed:
            forgotten, self._again_wanted = None, False
            if self._busy:
                forgotten, self._waiting = self._waiting, None
        if forgotten is not None:
            self._dropped(forgotten)

    def drain(self, timeout_s: float | None = None) -> None:
        """Wait until nothing waits and the worker is idle, or until the timeout."""
        with self._changed:
            self._changed.wait_for(lambda: self._stopping or not (self._busy or self._wanted()), timeout_s)

    def _wanted(self) -> bool:
        return self._waiting is not None or self._again_wanted

    def stop(self, patient: Callable[[], bool] = always) -> bool:
        """Let the work at hand end, drop what waits for it, and join the thread; may be called twice.

        Args:
            patient: called periodically; the wait ends when it returns False.

        Returns:
            Whether the thread has ended.
        """
        with self._changed:
            self._stopping = True
            self._changed.notify_all()
        self.forget()
        return _ended(self._thread, patient)

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._stopping or self._wanted())
                if self._stopping and self._waiting is None:
                    return
                # An item that begins now is processed under the newest parameters: nothing is left to repeat.
                item, self._waiting, self._again_wanted, self._busy = self._waiting, None, False, True
            self._began_s = time.monotonic()
            try:
                if item is not None:
                    self._work(item)
                else:
                    self._again()
            except Exception:  # noqa: BLE001 - the last resort: without this thread nothing is filtered
                traceback.print_exc()
            self._began_s = float('inf')
            with self._changed:
                self._busy = False
                self._changed.notify_all()


class QueueWorker(Generic[Item]):
    """Runs `work` on a thread of its own for every item, in order.

    Every frame of a stack counts, so frames queue; a frame is dropped only where too many wait.

    Args:
        work: called with each item on the worker's thread.
        idle: called on the worker's thread while nothing waits: after an item, and every `pause_s`.
        pause_s: in s.
    """

    def __init__(self, work: Callable[[Item], None], idle: Callable[[], None], pause_s: float) -> None:
        self._work = work
        self._idle = idle
        self._pause_s = pause_s
        self._items: queue.Queue[Item | None] = queue.Queue()
        self._began_s = float('inf')
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name='stack_worker')
        self._thread.start()

    @property
    def busy_s(self) -> float:
        """For how long the work at hand has lasted; at most 0 where there is none."""
        return time.monotonic() - self._began_s

    def put(self, item: Item) -> None:
        """Hand over an item."""
        self._items.put(item)

    def put_if_room(self, item: Item, most: int) -> bool:
        """Hand over an item; False: `most` items wait already, and it is dropped."""
        if self._items.qsize() >= most:
            return False
        self._items.put(item)
        return True

    def forget(self) -> list[Item]:
        """Take the items that wait away, and return them."""
        forgotten = []
        with suppress(queue.Empty):
            while True:
                forgotten.append(self._items.get_nowait())
        return [item for item in forgotten if item is not None]

    def stop(self, patient: Callable[[], bool] = always) -> bool:
        """Let the work at hand end, begin no other, and join the thread; may be called twice.

        Args:
            patient: called periodically; the wait ends when it returns False.

        Returns:
            Whether the thread has ended.
        """
        self._stopping.set()
        self._items.put(None)  # wakes the thread at once
        return _ended(self._thread, patient)

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                item = self._items.get(timeout=self._pause_s)
            except queue.Empty:
                item = None
            if self._stopping.is_set():
                self._items.put(item)  # it was not begun, and still waits
                return
            self._began_s = time.monotonic()
            try:
                if item is not None:
                    self._work(item)
                if self._items.empty():
                    self._idle()
            except Exception:  # noqa: BLE001 - the last resort: without this thread no frame is measured
                traceback.print_exc()
            self._began_s = float('inf')
