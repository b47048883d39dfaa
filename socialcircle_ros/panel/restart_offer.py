"""After a restart of the node: the offer to restore the settings that it had."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from socialcircle_ros.settings import RosValue

from . import markup
from .changes import Changes
from .elements import icon
from .link import Snapshot
from .log import Log

if TYPE_CHECKING:
    import viser


class LostSettings:
    """The values that the node had before it was started again and does not have now.

    A value that is set after the restart, by whomever, is no longer lost.
    """

    def __init__(self) -> None:
        self._lost: dict[str, tuple[RosValue, RosValue]] = {}  # the value before the restart, and the one after

    @property
    def values(self) -> Mapping[str, RosValue]:
        """The lost values by name."""
        return {name: lost for name, (lost, _) in self._lost.items()}

    def follow(self, before: Snapshot, now: Snapshot) -> None:
        """Take the next snapshot of the node.

        Args:
            before: the snapshot before; its values are those of the node before a restart.
            now: the new one.
        """
        if now.starts != before.starts:
            had = {**before.values, **self.values}
            self._lost = {
                name: (had[name], now.values[name])
                for name in now.writable()
                if name in had and name in now.values
            }
        self._lost = {
            name: (lost, after)
            for name, (lost, after) in self._lost.items()
            if now.values.get(name) == after and lost != after
        }

    def forget(self) -> None:
        """Let the node keep its new values."""
        self._lost = {}


class RestartOffer:
    """Shows the lost settings, with a button that restores them; hidden while there are none.

    Args:
        gui: of the page. The elements are made in its current container.
        changes: sets the values.
        log: gets a notification when there is an offer.
    """

    def __init__(self, gui: 'viser.GuiApi', changes: Changes, log: Log) -> None:
        self._changes, self._log = changes, log
        self._settings = LostSettings()
        self._table = gui.add_html('', visible=False)
        self._restore = gui.add_button('Restore these settings', icon=icon('history'), visible=False)
        self._restore.on_click(
            lambda _: log.guarded('Restoring the settings', changes.apply, self._settings.values)
        )
        self._keep = gui.add_button('Keep the new settings', icon=icon('x'), visible=False)
        self._keep.on_click(lambda _: log.guarded('Keeping the settings', self._forget))

    def follow(self, before: Snapshot, now: Snapshot) -> None:
        """Show what the node has lost by a restart between two snapshots, and what of it is restored."""
        offered = self._settings.values
        self._settings.follow(before, now)
        if self._settings.values != offered:
            self._show(now.values)
        if self._settings.values and now.starts != before.starts:
            self._log.notify(
                'The node was started again with other settings; the tab Tune offers to restore them.'
            )

    def _forget(self) -> None:
        self._settings.forget()
        self._show({})

    def _show(self, current: Mapping[str, RosValue]) -> None:
        lost = self._settings.values
        self._table.content = markup.restart({name: (value, current[name]) for name, value in lost.items()})
        for element in (self._table, self._restore, self._keep):
            element.visible = bool(lost)
