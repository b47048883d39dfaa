# SPDX-License-Identifier: Apache-2.0
"""The log of the page: what happened at the node, what the page did, and what failed in it."""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, ParamSpec

from socialcircle_ros.errors import SocialCircleError, printable

from . import markup
from .elements import PRODUCT
from .link import LogEntry, Snapshot

if TYPE_CHECKING:
    import viser

_LOGGER = logging.getLogger(__name__)
_MOST_ENTRIES = 60
_NOTIFICATION_S = 8.0

Arguments = ParamSpec('Arguments')


class Log:
    """The newest entries of the log, newest first. Its methods may be called from any thread.

    Args:
        server: of the page. The log is made in its current container.
    """

    def __init__(self, server: 'viser.ViserServer') -> None:
        self._server = server
        self._entries: deque[LogEntry] = deque(maxlen=_MOST_ENTRIES)
        self._taken = 0  # entries of the link that are in the log
        self._changing = threading.RLock()
        self._failing: dict[str, str] = {}  # the last failure of each step that has not succeeded since
        self._html = server.gui.add_html(markup.log(()))

    def take(self, snapshot: Snapshot) -> None:
        """Add the entries of the link that are new since the last snapshot."""
        with self._changing:
            new = snapshot.log_total - self._taken
            if new > 0:
                self._taken = snapshot.log_total
                self._entries.extend(snapshot.log[-new:])
                self._show()

    def add(self, text: str, *, bad: bool = False) -> None:
        """Add an entry of the page."""
        with self._changing:
            self._entries.append(LogEntry(time.time(), text, bad))
            self._show()

    def notify(self, text: str, *, bad: bool = False) -> None:
        """Add an entry, and show it in each browser as a notification that closes after some seconds."""
        self.add(text, bad=bad)
        for client in self._server.get_clients().values():
            client.add_notification(
                PRODUCT, markup.plain(text), auto_close_seconds=_NOTIFICATION_S, color='orange' if bad else 'teal'
            )

    def guarded(
        self, what: str, step: Callable[Arguments, object], *args: Arguments.args, **kwargs: Arguments.kwargs
    ) -> None:
        """Run a step of the page. Whatever it raises is logged and shown, and the page goes on.

        A failure that repeats is shown once, until the step succeeds again.

        Args:
            what: names the step, such as 'Showing the cloud'.
            step: is called with the arguments that follow.
            *args: for `step`.
            **kwargs: for `step`.
        """
        try:
            step(*args, **kwargs)
        except Exception as error:  # noqa: BLE001 - one bad message or one click ends nothing
            self._failed(what, error)
        else:
            self._failing.pop(what, None)

    def _failed(self, what: str, error: Exception) -> None:
        expected = isinstance(error, SocialCircleError)
        text = str(error) if expected else printable(f'{what} failed: {type(error).__name__}: {error}.')
        if self._failing.get(what) == text:
            return
        self._failing[what] = text
        if not expected:
            _LOGGER.error('%s', text, exc_info=error)
        try:
            self.notify(text, bad=True)
        except Exception:
            _LOGGER.exception('A failure could not be shown on the page.')

    def _show(self) -> None:
        self._html.content = markup.log(reversed(self._entries))
