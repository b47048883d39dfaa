"""The tab Result: the last cloud of the node in numbers, in the scene and as pictures."""

from typing import TYPE_CHECKING

import numpy as np

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.messages.point_cloud import PointCloud

from . import markup
from .link import ShownCloud
from .log import Log
from .scene import CloudScene
from .view import height_picture, mask_picture, view_of

if TYPE_CHECKING:
    import viser

NO_PICTURE = np.zeros((24, 32, 3), np.uint8)
"""What an image shows before there is a cloud."""


class ResultTab:
    """The last cloud of the node.

    Args:
        server: of the page. The elements are made in its current container.
        log: gets the reason where a cloud cannot be shown.

    Attributes:
        shown: the last cloud, also where it could not be shown; None: none has come.
        scene: the scene.
    """

    def __init__(self, server: 'viser.ViserServer', log: Log) -> None:
        gui = server.gui
        self._log = log
        self.shown: ShownCloud | None = None
        self._measurement = gui.add_html(markup.measurement(None))
        self.scene = CloudScene(server, log)
        self._heights = gui.add_image(NO_PICTURE, label='heights of kept points', format='png')
        self._mask = gui.add_image(NO_PICTURE, label='outlier mask', format='png')
        self._details = gui.add_html(markup.details(None))

    def show(self, shown: ShownCloud) -> None:
        """Show a cloud and what the node made of it."""
        self.shown = shown
        try:
            xyz = PointCloud.decode(shown.cloud).xyz()
            view = view_of(xyz, shown.mask)
        except SocialCircleError as error:
            self._log.add(str(error), bad=True)
            return
        with self.scene.update():
            self._measurement.content = markup.measurement(shown)
            self._details.content = markup.details(shown)
            self._heights.image = height_picture(xyz, shown.mask, view.span)
            self._mask.image = mask_picture(shown.mask)
            self.scene.show(view)
