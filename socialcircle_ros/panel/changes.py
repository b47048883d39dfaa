# SPDX-License-Identifier: Apache-2.0
"""Changes of parameters that the page asks for: rapid changes are merged, and each change can be undone."""

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from socialcircle_ros.errors import SettingError
from socialcircle_ros.settings import RosValue

from .link import Link

_GESTURE_S = 2.0  # changes of one parameter that follow within this time are undone as one
_SETTLING_S = 1.0  # after a change, in which the node's values do not move the control
_MOST_UNDOABLE = 100


@dataclass(frozen=True)
class _Change:
    """A change that can be undone.

    Attributes:
        before: the values that it replaced.
        at_s: when it was made, on the monotonic clock.
        gesture: whether it may be merged with the next change of the same parameters.
    """

    before: Mapping[str, RosValue]
    at_s: float
    gesture: bool


class Changes:
    """Asks the node for changes, one after the other, in a thread of its own.

    Args:
        link: to the node.
        refused: called with the names and the reason of a change that was refused.
        accepted: called with the names of a change that was accepted.
    """

    def __init__(
        self,
        link: Link,
        refused: Callable[[tuple[str, ...], str], None],
        accepted: Callable[[tuple[str, ...]], None],
    ) -> None:
        self._link = link
        self._refused = refused
        self._accepted = accepted
        self._changed = threading.Condition()
        self._asking = threading.Lock()  # one change at a time, so that each knows what it replaces
        self._waiting: dict[str, tuple[RosValue | SettingError, float]] = {}  # value, and when it is due
        self._touched: dict[str, float] = {}  # when each parameter was changed last
        self._history: list[_Change] = []
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name='changes')
        self._thread.start()

    def ask(self, name: str, value: RosValue | SettingError, pause_s: float) -> None:
        """Set one parameter, unless a newer value for it comes within `pause_s`.

        An unfinished text is often no value, such as 1e on the way to 1e-6. It comes as the error, which counts
        as a refusal only if no newer value replaces it in time.
        """
        with self._changed:
            self._waiting[name] = (value, time.monotonic() + pause_s)
            self._touched[name] = time.monotonic() + pause_s
            self._changed.notify_all()

    def settling(self, name: str) -> bool:
        """Whether this page is changing the parameter now, or changed it a moment ago."""
        with self._changed:
            elapsed_s = time.monotonic() - self._touched.get(name, float('-inf'))
            return name in self._waiting or elapsed_s < _SETTLING_S

    def apply(self, values: Mapping[str, RosValue], *, gesture: bool = False) -> str:
        """Set parameters together, now; return '' or the reason of the refusal.

        Args:
            values: what to set; values that are already current are not sent.
            gesture: whether rapid changes of the same parameters are undone as one.
        """
        with self._asking:
            current = self._link.newest.values  # the page may not show the last change yet
            wanted = {name: value for name, value in values.items() if current.get(name) != value}
            if not wanted:
                return ''
            reason = self._ask_node(wanted)
            if not reason:
                self._remember({name: current[name] for name in wanted if name in current}, gesture)
            return reason

    @property
    def undoable(self) -> int:
        """How many changes can be undone."""
        return len(self._history)

    def undo(self) -> tuple[Mapping[str, RosValue], str]:
        """Undo the last change; return the restored values, and '' or the reason of a refusal."""
        with self._asking:
            if not self._history:
                return {}, 'There is no change of this page to undo.'
            change = self._history[-1]
            reason = self._ask_node(change.before)
            if not reason:
                self._history.pop()
            return change.before, reason

    def stop(self) -> None:
        """End the thread; changes that are still waiting are dropped."""
        with self._changed:
            self._stopping = True
            self._changed.notify_all()
        self._thread.join()

    def _ask_node(self, values: Mapping[str, RosValue]) -> str:
        try:
            reason = self._link.change(values)
        except Exception as error:  # noqa: BLE001 - a value that cannot be sent ends neither this thread nor the page
            reason = f'The change cannot be sent: {type(error).__name__}: {error}.'
        if reason:
            self._refused(tuple(values), reason)
        else:
            self._accepted(tuple(values))
        return reason

    def _remember(self, before: Mapping[str, RosValue], gesture: bool) -> None:
        now = time.monotonic()
        last = self._history[-1] if self._history else None
        if (
            last
            and gesture
            and last.gesture
            and last.before.keys() == before.keys()
            and now - last.at_s < _GESTURE_S
        ):
            self._history[-1] = _Change(last.before, now, gesture=True)
            return
        self._history.append(_Change(before, now, gesture))
        del self._history[:-_MOST_UNDOABLE]

    def _run(self) -> None:
        while True:
            with self._changed:
                due = min(self._waiting, key=lambda name: self._waiting[name][1], default=None)
                if self._stopping:
                    return
                if due is None:
                    self._changed.wait()
                    continue
                value, due_at = self._waiting[due]
                remaining_s = due_at - time.monotonic()
                if remaining_s > 0:
                    self._changed.wait(remaining_s)
                    continue
            if isinstance(value, SettingError):
                self._refused((due,), str(value))
            else:
                self.apply({due: value}, gesture=True)
            with self._changed:
                if self._waiting.get(due) == (value, due_at):
                    del self._waiting[due]
                self._touched[due] = time.monotonic()
