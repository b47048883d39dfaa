# SPDX-License-Identifier: Apache-2.0
"""The tab Presets: save the settings of the node, load them again, and compare two of them."""

from typing import TYPE_CHECKING

from socialcircle_ros.errors import SocialCircleError

from . import markup
from .changes import Changes
from .comparison_folder import ComparisonFolder
from .elements import icon, set_value
from .link import Link
from .log import Log
from .presets import Presets
from .state import CurrentState

if TYPE_CHECKING:
    import viser

_NO_PRESET = 'no preset saved'


class PresetTab:
    """Presets of the node's parameters.

    Args:
        gui: of the page. The elements are made in its current container.
        link: to the node.
        presets: the files.
        changes: loads a preset into the node.
        current: the state of the page.
        log: gets what was saved and loaded.

    Attributes:
        comparison: the folder in which two settings are compared.
    """

    def __init__(
        self,
        gui: 'viser.GuiApi',
        link: Link,
        presets: Presets,
        changes: Changes,
        current: CurrentState,
        log: Log,
    ) -> None:
        self._link, self._presets, self._changes, self._log = link, presets, changes, log
        self._name = gui.add_text('name', 'my setting', hint='Letters, digits, spaces and - _ . +')
        save = gui.add_button(
            'Save current settings', icon=icon('device-floppy'),
            hint=f'Writes a parameter file to {presets.folder}. A node can also start from it.',
        )  # fmt: skip
        save.on_click(lambda _: log.guarded('Saving the preset', self._save))
        self._preset = gui.add_dropdown('preset', [_NO_PRESET])
        load = gui.add_button('Load preset into the node', icon=icon('upload'))
        load.on_click(lambda _: log.guarded('Loading the preset', self._load))
        keep = gui.add_button(
            'Save parameters at the node', icon=icon('file-check'),
            hint='Calls ~/save_parameters: the node writes its parameters_file.',
        )  # fmt: skip
        keep.on_click(lambda _: log.guarded('Saving at the node', lambda: log.notify(link.save())))
        self._note = gui.add_html('', visible=False)
        self.comparison = ComparisonFolder(gui, presets, current, log)
        self.refresh()

    def refresh(self) -> None:
        """List the presets that are in the folder now."""
        names = self._presets.names()
        self._preset.options = tuple(names) or (_NO_PRESET,)
        self.comparison.offer(names)

    def _save(self) -> None:
        snapshot = self._link.newest
        writable = snapshot.writable()
        values = {name: value for name, value in snapshot.values.items() if name in writable}
        if not values:
            self._log.notify('The node has not sent its parameters yet, so there is nothing to save.', bad=True)
            return
        try:
            path = self._presets.save(self._name.value.strip(), values)
        except SocialCircleError as error:
            self._say(str(error), bad=True)
            return
        self.refresh()
        set_value(self._preset, path.stem)
        self._say(f'Saved as {path}.')

    def _load(self) -> None:
        name = self._preset.value
        if name == _NO_PRESET:
            self._say('Save a preset first.', bad=True)
            return
        try:
            values = self._presets.load(name)
        except SocialCircleError as error:
            self._say(str(error), bad=True)
            return
        snapshot = self._link.newest
        writable = snapshot.writable()
        unknown = sorted(values.keys() - snapshot.values.keys())
        reason = self._changes.apply({key: value for key, value in values.items() if key in writable})
        if reason:
            self._say(f'The node refused the preset {name}: {reason}', bad=True)
            return
        ignored = f' Ignored, because the node has no such parameter: {", ".join(unknown)}.' if unknown else ''
        self._say(f'Loaded the preset {name}.{ignored}', bad=bool(unknown))

    def _say(self, text: str, *, bad: bool = False) -> None:
        self._note.content = markup.note(text, bad=bad)
        self._note.visible = True
        self._log.add(text, bad=bad)
