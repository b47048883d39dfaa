"""The tab Result: the cloud that is shown in numbers, in the scene and as pictures."""

from typing import TYPE_CHECKING

import numpy as np

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.messages.point_cloud import PointCloud

from . import markup
from .link import ShownCloud
from .log import Log
from .scene import CloudScene
from .state import State
from .view import height_picture, mask_picture, view_of

if TYPE_CHECKING:
    import viser

    from .comparison import Comparison

NO_PICTURE = np.zeros((24, 32, 3), np.uint8)
"""What an image shows before there is a cloud."""


class ResultTab:
    """The cloud that is shown.

    Args:
        server: of the page. The elements are made in its current container.
        log: gets the reason where a cloud cannot be shown.
    """

    def __init__(self, server: 'viser.ViserServer', log: Log) -> None:
        gui = server.gui
        self._log = log
        self._shown: ShownCloud | None = None
        self._compared: Comparison | None = None
        self._title = gui.add_html('')
        self._measurement = gui.add_html(markup.measurement(None))
        self._scene = CloudScene(server, log)
        self._heights = gui.add_image(NO_PICTURE, label='heights of kept points', format='png')
        self._mask = gui.add_image(NO_PICTURE, label='outlier mask', format='png')
        self._details = gui.add_html(markup.details(None))

    def show(self, state: State) -> None:
        """Show the cloud of the state and what the node made of it, or the comparison on it."""
        self._title.content = markup.title(state)
        if state.shown is not self._shown and state.shown is not None:
            self._shown = state.shown
            self._draw(state.shown)
        comparison = state.comparison
        if comparison is not self._compared:
            self._compared = comparison
            with self._scene.update():
                if comparison is not None:
                    self._scene.show_comparison(comparison)
                else:
                    self._scene.end_comparison()

    def _draw(self, shown: ShownCloud) -> None:
        with self._scene.update():
            self._measurement.content = markup.measurement(shown)
            self._details.content = markup.details(shown)
            try:
                xyz = PointCloud.decode(shown.cloud).xyz()
                view = view_of(xyz, shown.mask)
            except SocialCircleError as error:
                self._log.add(str(error), bad=True)
                self._heights.image = self._mask.image = NO_PICTURE
                self._scene.clear(str(error))
                return
            self._heights.image = height_picture(xyz, shown.mask, view.span)
            self._mask.image = mask_picture(shown.mask)
            self._scene.show(view)
