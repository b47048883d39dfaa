"""Changes that the page asks for: the newest wins while someone types or drags, and each can be undone."""

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from socialcircle_ros.errors import SettingError
from socialcircle_ros.settings import RosValue

from .link import Link

_ONE_GESTURE = 2.0  # s between two changes of one parameter that are undone as one, such as a slider's way
_SETTLING = 1.0  # s after a change in which the node's answer does not move the control under the hand
_MOST_STEPS = 100


@dataclass(frozen=True)
class _Change:
    """What a change replaced."""

    before: Mapping[str, RosValue]
    at: float
    gesture: bool


class Changes:
    """Asks the node for changes, one after the other, on a thread of its own.

    Args:
        link: to the node.
        current: gives the values in force.
        refused: called with the names and the reason of a change that was refused.
        accepted: called with the names of a change that was accepted.
    """

    def __init__(
        self,
        link: Link,
        current: Callable[[], Mapping[str, RosValue]],
        refused: Callable[[tuple[str, ...], str], None],
        accepted: Callable[[tuple[str, ...]], None],
    ) -> None:
        self._link = link
        self._current = current
        self._refused = refused
        self._accepted = accepted
        self._changed = threading.Condition()
        self._asking = threading.Lock()  # one change at a time, so that each knows what it replaces
        self._waiting: dict[str, tuple[RosValue | SettingError, float]] = {}  # and when it is due
        self._touched: dict[str, float] = {}
        self._steps: list[_Change] = []
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name='changes')
        self._thread.start()

    def ask(self, name: str, value: RosValue | SettingError, pause: float) -> None:
        """Set one parameter, unless a newer value for it comes within `pause` seconds.

        What is typed passes through much that is no value, such as 1e on the way to 1e-6: that comes as the
        error, and is a refusal only if it stays.
        """
        with self._changed:
            self._waiting[name] = (value, time.monotonic() + pause)
            self._touched[name] = time.monotonic() + pause
            self._changed.notify_all()

    def settling(self, name: str) -> bool:
        """Whether the parameter is being moved from this page just now."""
        with self._changed:
            return name in self._waiting or time.monotonic() - self._touched.get(name, float('-inf')) < _SETTLING

    def apply(self, values: Mapping[str, RosValue], *, gesture: bool = False) -> str:
        """Set parameters together, now; '' or the reason of the refusal.

        Args:
            values: what to set; what is in force already is left out.
            gesture: whether changes of the same parameters in quick succession are undone as one.
        """
        with self._asking:
            current = self._current()
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
        return len(self._steps)

    def undo(self) -> tuple[Mapping[str, RosValue], str]:
        """Take the last change back; what is in force again, and '' or the reason of a refusal."""
        with self._asking:
            if not self._steps:
                return {}, 'Nothing was changed from this page yet.'
            step = self._steps[-1]
            reason = self._ask_node(step.before)
            if not reason:
                self._steps.pop()
            return step.before, reason

    def stop(self) -> None:
        """End the thread; what waits is dropped."""
        with self._changed:
            self._stopping = True
            self._changed.notify_all()
        self._thread.join()

    def _ask_node(self, values: Mapping[str, RosValue]) -> str:
        reason = self._link.change(values)
        if reason:
            self._refused(tuple(values), reason)
        else:
            self._accepted(tuple(values))
        return reason

    def _remember(self, before: Mapping[str, RosValue], gesture: bool) -> None:
        now = time.monotonic()
        last = self._steps[-1] if self._steps else None
        if (
            last
            and gesture
            and last.gesture
            and last.before.keys() == before.keys()
            and now - last.at < _ONE_GESTURE
        ):
            self._steps[-1] = _Change(last.before, now, gesture=True)
            return
        self._steps.append(_Change(before, now, gesture))
        del self._steps[:-_MOST_STEPS]

    def _run(self) -> None:
        while True:
            with self._changed:
                due = min(self._waiting, key=lambda name: self._waiting[name][1], default=None)
                if self._stopping:
                    return
                if due is None:
                    self._changed.wait()
                    continue
                value, at = self._waiting[due]
                remaining = at - time.monotonic()
                if remaining > 0:
                    self._changed.wait(remaining)
                    continue
            if isinstance(value, SettingError):
                self._refused((due,), str(value))
            else:
                self.apply({due: value}, gesture=True)
            with self._changed:
                if self._waiting.get(due) == (value, at):
                    del self._waiting[due]
                self._touched[due] = time.monotonic()
