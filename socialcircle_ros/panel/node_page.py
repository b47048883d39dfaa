# SPDX-License-Identifier: Apache-2.0
"""What the page shows of one node: a scene between two docks, updated from the snapshots of the link."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from socialcircle_ros.focus import FocusCurve

from . import markup
from .changes import Changes
from .controls import Controls
from .elements import icon
from .link import Link, Presence, Snapshot
from .log import Log
from .preset_tab import PresetTab
from .presets import Presets
from .recording_tab import RecordingTab
from .restart_offer import RestartOffer
from .result_tab import ResultTab
from .state import CurrentState, State
from .teach_tab import TeachTab
from .trend_tab import TrendTab
from .trends import Trends

if TYPE_CHECKING:
    import viser

_RIGHT_PIXELS = 360


class NodePage:
    """What the page shows of one node.

    Args:
        server: viser's, which is listening already.
        link: to the node.
        presets: the folder of the presets.
        trends: what is served under `trends_address`.
        trends_address: address of the trends.
    """

    def __init__(
        self, server: 'viser.ViserServer', link: Link, presets: Presets, trends: Trends, trends_address: str
    ) -> None:
        self._server, self._link = server, link
        self._offered: tuple[str, ...] | None = None
        self._current = CurrentState(self._show)
        self._changes = Changes(
            link,
            lambda *refusal: self._log.guarded('Showing a refusal', self._refused, *refusal),
            lambda names: self._log.guarded('Showing a change', self._accepted, names),
        )
        self._build_right_dock(trends, trends_address)
        self._build_left_dock(presets)

    @property
    def log(self) -> Log:
        """The log of the node and of the page."""
        return self._log

    @property
    def knows_parameters(self) -> bool:
        """Whether the node has sent its parameters."""
        return bool(self._current.now.snapshot.values)

    @property
    def has_recording(self) -> bool:
        """Whether a recording is open."""
        return self._current.now.recording is not None

    def update(self, timeout_s: float) -> None:
        """Show the newest snapshot of the node, as soon as there is a new one, or after `timeout_s`."""
        self._log.guarded('Updating the page', self._update, timeout_s)

    def close(self) -> None:
        """End the threads of the page; the elements stay."""
        self._changes.stop()
        self._recording_tab.close()

    def open_recording(self, path: Path) -> None:
        """Open a recording and show its first cloud."""
        self._log.guarded(f'Opening {path}', self._recording_tab.open, path)

    def _update(self, timeout_s: float) -> None:
        before = self._current.now.snapshot
        now = self._link.wait(before.revision, timeout_s)
        self._current.change(lambda state: state.followed(now))
        self._log.guarded('Comparing', self._preset_tab.comparison.renew)
        started = now.starts != before.starts or before.presence is not Presence.ACTIVE
        if now.presence is Presence.ACTIVE and started:
            # A node that has just started holds no cloud.
            self._log.guarded('Sending the cloud again', self._recording_tab.send_again)

    def _show(self, state: State) -> None:
        """Show a state; each part alone, so that none keeps the others back."""
        guarded = self._log.guarded
        with self._server.atomic():
            guarded('Showing the state of the node', self._show_node, state.snapshot)
            guarded('Showing the log', self._log.take, state.snapshot)
            guarded('Showing the parameters', self._show_parameters, state.snapshot)
            guarded('Offering the settings before a restart', self._restart_offer.show, state)
            guarded('Showing the recording', self._recording_tab.show, state)
            guarded('Showing the good clouds', self._teach_tab.show, state)
            guarded('Showing the comparison', self._preset_tab.comparison.show, state)
            if self._server.get_clients():  # the first visitor gets the newest cloud
                guarded('Showing the cloud', self._result_tab.show, state)
        names = tuple(state.snapshot.values)
        if names != self._offered:
            self._offered = names
            guarded('Listing the presets', self._preset_tab.refresh)

    def _show_node(self, snapshot: Snapshot) -> None:
        self._node.content = markup.node_card(self._link.name, snapshot)

    def _build_right_dock(self, trends: Trends, trends_address: str) -> None:
        dock = self._server.gui.add_panel()
        result, log = dock.add_tab('Result', icon('chart-dots-3')), dock.add_tab('Log', icon('list'))
        with log:
            self._log = Log(self._server)
        with result:
            self._result_tab = ResultTab(
                self._server,
                self._changes,
                self._current,
                self._log,
                self._focus_curve,
            )
        with dock.add_tab('Trends', icon('chart-line')):
            TrendTab(self._server.gui, trends, trends_address, self._log)
        dock.dock_right()
        dock.set_width(_RIGHT_PIXELS)

    def _focus_curve(self, number: int, place: tuple[int, int]) -> FocusCurve | None:
        return self._recording_tab.focus_curve(number, place)

    def _build_left_dock(self, presets: Presets) -> None:
        gui = self._server.gui
        self._node = gui.add_html(markup.node_card(self._link.name, Snapshot()))
        tabs = gui.add_tab_group()
        self._tune_tab = tabs.add_tab('Tune')
        with self._tune_tab:
            self._build_tuning()
        with tabs.add_tab('Presets'):
            self._preset_tab = PresetTab(gui, self._link, presets, self._changes, self._current, self._log)
        with tabs.add_tab('Teach'):
            self._teach_tab = TeachTab(gui, presets, self._changes, self._current, self._log)
        with tabs.add_tab('Recording'):
            self._recording_tab = RecordingTab(gui, self._link, self._changes, self._current, self._log)

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
        self._restart_offer = RestartOffer(gui, self._changes, self._current, self._log)
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
