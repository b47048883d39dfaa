"""The page of one node: a scene between two docks, updated from the snapshots of the link."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from socialcircle_ros.errors import SocialCircleError, install_command

from . import markup
from .changes import Changes
from .controls import Controls
from .elements import PRODUCT, icon
from .link import Link, Presence, Snapshot
from .log import Log
from .preset_tab import PresetTab
from .presets import Presets
from .recording_tab import RecordingTab
from .restart_offer import RestartOffer
from .result_tab import ResultTab

if TYPE_CHECKING:
    import viser

_UPDATE_S = 0.25  # between two updates of the page, at least
_LEFT_PIXELS, _RIGHT_PIXELS = 340, 320


class Page:
    """The page of one node.

    Args:
        server: viser's, which is listening already.
        link: to the node.
        presets: the folder of the presets.
    """

    def __init__(self, server: 'viser.ViserServer', link: Link, presets: Presets) -> None:
        self._server, self._link = server, link
        self._snapshot = Snapshot()
        self._changes = Changes(
            link,
            lambda: self._snapshot.values,
            lambda *refusal: self._log.guarded('Showing a refusal', self._refused, *refusal),
            lambda names: self._log.guarded('Showing a change', self._accepted, names),
        )
        gui = server.gui
        gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False, brand_color=(29, 145, 192))
        gui.set_panel_label(PRODUCT)
        gui.add_html(markup.STYLE)
        self._build_right_dock()
        self._build_left_dock(presets)

    def run(self, stop: Callable[[], bool]) -> None:
        """Show each new snapshot of the node until `stop` returns True."""
        try:
            while not stop():
                start = time.monotonic()
                self._log.guarded('Updating the page', self._update)
                time.sleep(max(0.0, _UPDATE_S - (time.monotonic() - start)))
        finally:
            self._changes.stop()
            self._recording_tab.close()

    def follow(self, snapshot: Snapshot) -> None:
        """Show what has changed since the last snapshot; each part alone, so that none keeps the others back."""
        before, self._snapshot = self._snapshot, snapshot
        guarded = self._log.guarded
        guarded('Showing the state of the node', self._show_node, snapshot)
        guarded('Showing the log', self._log.take, snapshot)
        guarded('Showing the parameters', self._show_parameters, snapshot)
        guarded('Offering the settings before a restart', self._restart_offer.follow, before, snapshot)
        guarded('Showing the cloud', self._show_cloud, snapshot)
        if before.values.keys() != snapshot.values.keys():
            guarded('Listing the presets', self._preset_tab.refresh)
        if snapshot.presence is Presence.ACTIVE and before.presence is not Presence.ACTIVE:
            # A node that has just started holds no cloud.
            guarded('Sending the cloud again', self._recording_tab.send_again)

    def open_recording(self, path: Path) -> None:
        """Open a recording and show its first cloud."""
        self._log.guarded(f'Opening {path}', self._recording_tab.open, path)

    def _update(self) -> None:
        self.follow(self._link.wait(self._snapshot.revision, _UPDATE_S))

    def _show_node(self, snapshot: Snapshot) -> None:
        self._node.content = markup.node_card(self._link.name, snapshot)

    def _show_cloud(self, snapshot: Snapshot) -> None:
        shown = snapshot.shown_cloud
        if shown is not None and shown is not self._result_tab.shown and self._server.get_clients():
            self._result_tab.show(shown)

    def _build_right_dock(self) -> None:
        dock = self._server.gui.add_panel()
        result, log = dock.add_tab('Result', icon('chart-dots-3')), dock.add_tab('Log', icon('list'))
        with log:
            self._log = Log(self._server)
        with result:
            self._result_tab = ResultTab(self._server, self._log)
        dock.dock_right()
        dock.set_width(_RIGHT_PIXELS)

    def _build_left_dock(self, presets: Presets) -> None:
        gui = self._server.gui
        self._node = gui.add_html(markup.node_card(self._link.name, self._snapshot))
        tabs = gui.add_tab_group()
        self._tune_tab = tabs.add_tab('Tune', icon('adjustments-horizontal'))
        with self._tune_tab:
            self._build_tuning()
        with tabs.add_tab('Presets', icon('bookmarks')):
            self._preset_tab = PresetTab(
                gui, self._link, presets, self._changes, self._result_tab, self._log, lambda: self._snapshot
            )
        with tabs.add_tab('Recording', icon('player-track-next')):
            self._recording_tab = RecordingTab(
                gui, self._link, self._log, lambda: self._snapshot.presence is Presence.ACTIVE
            )
        gui.main_panel.dock_left()
        gui.main_panel.set_width(_LEFT_PIXELS)

    def _build_tuning(self) -> None:
        gui = self._server.gui
        self._undo = gui.add_button(
            'Undo',
            icon=icon('arrow-back-up'),
            disabled=True,
            hint='Undo the last change that was made on this page.',
        )
        self._undo.on_click(lambda _: self._log.guarded('Undoing', self._undo_last))
        command = gui.add_command('Undo', hotkey='Z', modifier='cmd/ctrl', icon=icon('arrow-back-up'))
        command.on_trigger(lambda _: self._log.guarded('Undoing', self._undo_last))
        self._restart_offer = RestartOffer(gui, self._changes, self._log)
        self._waiting = gui.add_html(markup.note('The controls appear when the node has sent its parameters.'))
        self._controls = Controls(gui, self._changes, self._log)

    def _show_parameters(self, snapshot: Snapshot) -> None:
        self._undo.disabled = not self._changes.undoable
        if not snapshot.values:
            return
        with self._tune_tab:
            self._controls.build(snapshot.descriptors, snapshot.values)
        present = snapshot.presence in (Presence.ACTIVE, Presence.INACTIVE)
        self._controls.show(snapshot.values, present)
        self._waiting.visible = False

    def _refused(self, names: Sequence[str], reason: str) -> None:
        self._controls.refused(names, reason)
        self._log.notify(f'{", ".join(names)} refused: {reason}', bad=True)

    def _accepted(self, names: Sequence[str]) -> None:
        self._controls.accepted(names)

    def _undo_last(self) -> None:
        values, reason = self._changes.undo()
        restored = ', '.join(f'{name} = {value}' for name, value in values.items())
        self._log.notify(reason or f'Undone: {restored}.', bad=bool(reason))


def require_viser() -> None:
    """Check that viser is installed.

    Raises:
        SocialCircleError: it is not; the message says how to install it.
    """
    try:
        import viser  # noqa: F401, PLC0415 - an extra
    except ImportError:
        raise SocialCircleError(f'The page needs viser: {install_command("panel")}.') from None


def page_of(link: Link, presets: Presets, host: str, port: int) -> 'tuple[viser.ViserServer, Page, str]':
    """Serve the page.

    Args:
        link: to the node.
        presets: the folder of the presets.
        host: the address to listen on; 127.0.0.1 keeps the page on this machine.
        port: the port; where it is in use, the next free one is taken. 0: any free port.

    Returns:
        viser's server, the page, and the address with the token that opens it.

    Raises:
        SocialCircleError: viser is not installed, or this machine has no such address.
    """
    require_viser()
    from .server import open_server  # noqa: PLC0415 - needs an extra

    server, address = open_server(host, port)
    return server, Page(server, link, presets), address
