# SPDX-License-Identifier: Apache-2.0
"""The folder in which two settings are compared on the cloud that is shown."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.settings import RosValue

from . import markup
from .comparison import Comparison, compare
from .elements import icon
from .log import Log
from .presets import Presets
from .result_tab import NO_PICTURE
from .state import CurrentState, State

if TYPE_CHECKING:
    import viser

_OF_NODE = 'current settings'


class ComparisonFolder:
    """Two settings on one cloud.

    While two settings are compared, they are compared again on each cloud that the page shows, and with each
    setting that the node takes.

    Args:
        gui: of the page. The folder is made in its current container.
        presets: the settings to choose from, beside those of the node.
        current: the state of the page.
        log: gets the reason where a comparison fails.
    """

    def __init__(self, gui: 'viser.GuiApi', presets: Presets, current: CurrentState, log: Log) -> None:
        self._presets, self._current = presets, current
        self._shown: Comparison | None = None
        with gui.add_folder('Compare two settings'):
            self._a = gui.add_dropdown('A', [_OF_NODE])
            self._b = gui.add_dropdown('B', [_OF_NODE])
            start = gui.add_button(
                'Compare on this cloud', icon=icon('columns-2'),
                hint='Filters the cloud that is shown with both settings, on this machine and not in the node.',
            )  # fmt: skip
            start.on_click(lambda _: log.guarded('Comparing', self._start))
            self._close = gui.add_button('Close the comparison', icon=icon('x'), visible=False)
            self._close.on_click(
                lambda _: log.guarded('Closing the comparison', current.change, State.not_comparing)
            )
            self._table = gui.add_html('', visible=False)
            self._picture = gui.add_image(
                NO_PICTURE, label='outliers of A, of B and of both', format='png', visible=False
            )

    def offer(self, names: Sequence[str]) -> None:
        """Offer presets, beside the current settings of the node."""
        for choice in (self._a, self._b):
            choice.options = (_OF_NODE, *names)

    def show(self, state: State) -> None:
        """Show the comparison of the state, or why there is none."""
        compared, comparison = state.compared, state.comparison
        self._close.visible = self._table.visible = compared is not None
        self._picture.visible = comparison is not None
        if compared is not None and comparison is None:
            waiting = 'Filtering … The first comparison also compiles the filter.'
            problem = compared.problem if not state.must_compare else ''
            text = 'There is no cloud to compare on yet.' if state.shown is None else problem or waiting
            self._table.content = markup.note(text, bad=text != waiting)
        if comparison is not None and comparison is not self._shown:
            self._table.content = markup.comparison(comparison, state.unit)
            self._picture.image = comparison.picture()
        self._shown = comparison

    def renew(self) -> None:
        """Compare on the cloud and with the settings that are shown, where that is not done yet."""
        state = self._current.now
        compared, wanted, shown = state.compared, state.to_compare, state.shown
        if compared is None or wanted is None or shown is None or not state.must_compare:
            return
        result, problem = None, ''
        try:
            a, b = self._settings(compared.a, state), self._settings(compared.b, state)
            result = compare(shown.cloud, a, b, shown.depth_of_field)
        except SocialCircleError as error:
            problem = str(error)
        self._current.change(lambda now: now.with_comparison(wanted, result, problem))

    def _start(self) -> None:
        names = [choice.value if choice.value != _OF_NODE else '' for choice in (self._a, self._b)]
        self._current.change(lambda state: state.comparing(*names))
        self.renew()

    def _settings(self, name: str, state: State) -> tuple[str, Mapping[str, RosValue]]:
        values = dict(state.snapshot.values)
        return name or _OF_NODE, values | self._presets.load(name) if name else values
