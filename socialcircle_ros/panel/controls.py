# SPDX-License-Identifier: Apache-2.0
"""The controls of the node's parameters, made from the node's own descriptions of them."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from socialcircle_ros.errors import SettingError
from socialcircle_ros.settings import RosValue
from socialcircle_ros.settings.effects import has_effect

from . import markup
from .changes import Changes
from .link import Descriptor
from .log import Log
from .widgets import Widget, widget_of

if TYPE_CHECKING:
    import viser

_HIDDEN = ('qos_overrides.', 'use_sim_time', 'start_type_description_service')  # ROS's own, fixed at the start


class Controls:
    """One control for each parameter, made in the container in which `build` is called.

    Args:
        gui: of the page.
        changes: takes the values that a visitor chooses.
        log: gets the reason where a parameter cannot be shown.
    """

    def __init__(self, gui: 'viser.GuiApi', changes: Changes, log: Log) -> None:
        self._gui = gui
        self._changes = changes
        self._log = log
        self._descriptors: tuple[Descriptor, ...] = ()
        self._folders: list[viser.GuiFolderHandle] = []
        self._rows: list[list[Descriptor]] = []
        self._widgets: dict[str, Widget] = {}
        self._refusals: dict[str, viser.GuiHtmlHandle] = {}

    def build(self, descriptors: Sequence[Descriptor], values: Mapping[str, RosValue]) -> None:
        """Make the controls, unless there are controls of these parameters already. The first group is open."""
        shown = tuple(row for row in descriptors if row.name in values and not row.name.startswith(_HIDDEN))
        if shown == self._descriptors:
            return
        for folder in self._folders:
            folder.remove()
        self._folders, self._rows, self._widgets, self._refusals = [], [], {}, {}
        self._descriptors = shown
        groups: dict[str, list[Descriptor]] = {}
        for row in shown:
            groups.setdefault(row.name.rpartition('.')[0] or 'node', []).append(row)
        for number, (group, rows) in enumerate(groups.items()):
            folder = self._gui.add_folder(group, expand_by_default=number == 0)
            self._folders.append(folder)
            self._rows.append(rows)
            with folder:
                for row in rows:
                    self._log.guarded(f'Making the control of {row.name}', self._add, row, values[row.name])

    def show(self, values: Mapping[str, RosValue], enabled: bool) -> None:
        """Show the current values, except in controls that a visitor moves; hide controls without an effect."""
        for row in self._descriptors:
            widget = self._widgets.get(row.name)
            if widget is None:
                continue
            if row.name in values and not self._changes.settling(row.name):
                self._log.guarded(f'Showing {row.name}', widget.show, values[row.name])
            widget.enable(enabled and not row.read_only)
            widget.reveal(has_effect(row.name, values))
        for folder, rows in zip(self._folders, self._rows, strict=True):
            folder.visible = any(has_effect(row.name, values) for row in rows)

    def refused(self, names: Sequence[str], reason: str) -> None:
        """Show below its control why a value was refused."""
        for name in names:
            if name in self._refusals:
                self._refusals[name].content = markup.refusal(reason)
                self._refusals[name].visible = True

    def accepted(self, names: Sequence[str]) -> None:
        """Hide earlier refusals of parameters."""
        for name in names:
            if name in self._refusals:
                self._refusals[name].visible = False

    def _add(self, row: Descriptor, value: RosValue) -> None:
        def choose(chosen: RosValue | SettingError, pause_s: float) -> None:
            self._changes.ask(row.name, chosen, pause_s)

        self._widgets[row.name] = widget_of(self._gui, row, value, choose)
        self._refusals[row.name] = self._gui.add_html('', visible=False)
