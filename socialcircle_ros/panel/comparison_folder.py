"""The folder in which two settings are compared on the cloud that is shown."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.settings import RosValue

from . import markup
from .comparison import compare
from .elements import icon
from .link import Snapshot
from .log import Log
from .presets import Presets
from .result_tab import NO_PICTURE, ResultTab

if TYPE_CHECKING:
    import viser

_CURRENT = 'current settings'


class ComparisonFolder:
    """Two settings on one cloud.

    Args:
        gui: of the page. The folder is made in its current container.
        presets: the settings to choose from, beside those of the node.
        result: the cloud, and the scene that shows the comparison.
        snapshot: gives the last snapshot of the node.
        log: gets the reason where a comparison fails.
    """

    def __init__(
        self,
        gui: 'viser.GuiApi',
        presets: Presets,
        result: ResultTab,
        snapshot: Callable[[], Snapshot],
        log: Log,
    ) -> None:
        self._presets, self._result, self._snapshot = presets, result, snapshot
        with gui.add_folder('Compare two settings'):
            self._a = gui.add_dropdown('A', [_CURRENT])
            self._b = gui.add_dropdown('B', [_CURRENT])
            start = gui.add_button(
                'Compare on this cloud', icon=icon('columns-2'),
                hint='Filters the cloud that is shown with both settings, on this machine and not in the node.',
            )  # fmt: skip
            start.on_click(lambda _: log.guarded('Comparing', self._compare))
            self._close = gui.add_button('Close the comparison', icon=icon('x'), visible=False)
            self._close.on_click(lambda _: log.guarded('Closing the comparison', self._end))
            self._table = gui.add_html('', visible=False)
            self._picture = gui.add_image(
                NO_PICTURE, label='outliers of A, of B and of both', format='png', visible=False
            )

    def offer(self, names: Sequence[str]) -> None:
        """Offer presets, beside the current settings of the node."""
        for choice in (self._a, self._b):
            choice.options = (_CURRENT, *names)

    def _compare(self) -> None:
        shown = self._result.shown
        if shown is None:
            self._table.content = markup.note('There is no cloud to compare on yet.', bad=True)
            self._table.visible = True
            return
        self._table.content = markup.note('Filtering … The first comparison also compiles the filter.')
        self._table.visible = True
        try:
            a, b = self._settings(self._a.value), self._settings(self._b.value)
            comparison = compare(shown.cloud, a, b, shown.depth_of_field)
        except SocialCircleError as error:
            self._table.content = markup.note(str(error), bad=True)
            return
        with self._result.scene.update():
            self._table.content = markup.comparison(comparison)
            self._picture.image = comparison.picture()
            self._picture.visible = self._close.visible = True
            self._result.scene.show_comparison(comparison)

    def _settings(self, name: str) -> tuple[str, Mapping[str, RosValue]]:
        values = dict(self._snapshot().values)
        return name, values if name == _CURRENT else values | self._presets.load(name)

    def _end(self) -> None:
        with self._result.scene.update():
            for element in (self._table, self._picture, self._close):
                element.visible = False
            self._result.scene.end_comparison()
