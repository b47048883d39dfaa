# SPDX-License-Identifier: Apache-2.0
"""The tab Trends: a folder of measurements, what drifts in it, and the link to its page."""

from typing import TYPE_CHECKING

from socialcircle_ros.errors import SocialCircleError

from . import markup
from .elements import icon
from .log import Log
from .trends import PAGE, Trends

if TYPE_CHECKING:
    import viser


class TrendTab:
    """Makes the page of trends.

    Args:
        gui: of the page. The elements are made in its current container.
        trends: what was asked for last, by any visitor.
        base: address under which `trends` is served.
        log: gets what failed.
    """

    def __init__(self, gui: 'viser.GuiApi', trends: Trends, base: str, log: Log) -> None:
        self._trends, self._base = trends, base
        self._folder = gui.add_text(
            'measurements',
            trends.folder,
            hint='Folder: output of `socialcircle batch`, or measurements.folder of nodes.',
        )
        button = gui.add_button('Show the trends', icon=icon('chart-line'))
        button.on_click(lambda _: log.guarded('Making the page of trends', self._make))
        invitation = markup.note('Shows the measurements of a folder over time: control limits, and what drifts.')
        self._note = gui.add_html(self._link() if trends.folder else invitation)

    def _make(self) -> None:
        self._note.content = markup.note('Reading the measurements …')
        try:
            self._trends.make(self._folder.value.strip())
        except SocialCircleError as error:
            self._note.content = markup.note(str(error), bad=True)
            return
        self._note.content = self._link()

    def _link(self) -> str:
        return markup.trends(self._trends.drifts, f'{self._base}/{PAGE}')
