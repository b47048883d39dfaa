# SPDX-License-Identifier: Apache-2.0
"""After a restart of the node: the offer to restore the settings that it had."""

import re
from typing import TYPE_CHECKING

from . import markup
from .changes import Changes
from .elements import icon
from .log import Log
from .state import CurrentState, Lost, State

if TYPE_CHECKING:
    import viser


class RestartOffer:
    """Shows the lost settings, with a button that restores them; hidden while there are none.

    Args:
        gui: of the page. The elements are made in its current container.
        changes: sets the values.
        current: the state of the page.
        log: gets a notification when there is an offer.
    """

    def __init__(self, gui: 'viser.GuiApi', changes: Changes, current: CurrentState, log: Log) -> None:
        self._changes, self._current, self._log = changes, current, log
        self._shown: Lost = {}
        self._starts = 0
        self._table = gui.add_html('', visible=False)
        self._restore = gui.add_button('Restore these settings', icon=icon('history'), visible=False)
        self._restore.on_click(lambda _: log.guarded('Restoring the settings', self._restore_lost))
        self._keep = gui.add_button('Keep the new settings', icon=icon('x'), visible=False)
        self._keep.on_click(
            lambda _: log.guarded('Keeping the settings', current.change, State.keeping_new_settings)
        )

    def show(self, state: State) -> None:
        """Show what the node has lost by its restarts."""
        starts, self._starts = self._starts, state.snapshot.starts
        if state.lost != self._shown:
            self._shown = state.lost
            self._table.content = markup.restart(state.lost)
            for element in (self._table, self._restore, self._keep):
                element.visible = bool(state.lost)
        if state.lost and starts != self._starts:
            self._log.notify(
                'The node was started again with other settings; the tab Tune offers to restore them.'
            )

    def _restore_lost(self) -> None:
        """Restore the settings together; those that the refusal names, such as a lesson that is gone, are left."""
        lost = {name: value for name, (value, _) in self._current.now.lost.items()}
        reason = self._changes.apply(lost)
        named = set(re.findall(r'[\w.]+\w', reason))
        others = {name: value for name, value in lost.items() if name not in named}
        if reason and len(others) < len(lost):
            self._changes.apply(others)
