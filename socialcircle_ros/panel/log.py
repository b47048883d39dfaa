"""The log of the page: what happened at the node, and what the page did."""

import time
from collections import deque
from typing import TYPE_CHECKING

from . import markup
from .elements import PRODUCT
from .link import LogEntry, Snapshot

if TYPE_CHECKING:
    import viser

_MOST_ENTRIES = 60
_NOTIFICATION_S = 8.0


class Log:
    """The newest entries of the log, newest first.

    Args:
        server: of the page. The log is made in its current container.
    """

    def __init__(self, server: 'viser.ViserServer') -> None:
        self._server = server
        self._entries: deque[LogEntry] = deque(maxlen=_MOST_ENTRIES)
        self._taken = 0  # entries of the link that are in the log
        self._html = server.gui.add_html(markup.log(()))

    def take(self, snapshot: Snapshot) -> None:
        """Add the entries of the link that are new since the last snapshot."""
        new = snapshot.log_total - self._taken
        if new > 0:
            self._taken = snapshot.log_total
            self._entries.extend(snapshot.log[-new:])
            self._show()

    def add(self, text: str, *, bad: bool = False) -> None:
        """Add an entry of the page."""
        self._entries.append(LogEntry(time.time(), text, bad))
        self._show()

    def notify(self, text: str, *, bad: bool = False) -> None:
        """Add an entry, and show it in each browser as a notification that closes after some seconds."""
        self.add(text, bad=bad)
        for client in self._server.get_clients().values():
            client.add_notification(
                PRODUCT, text, auto_close_seconds=_NOTIFICATION_S, color='orange' if bad else 'teal'
            )

    def _show(self) -> None:
        self._html.content = markup.log(reversed(self._entries))
