# SPDX-License-Identifier: Apache-2.0
"""The page: it waits for a node, offers those that there are, and shows the one that is chosen."""

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from socialcircle_ros.errors import SocialCircleError, install_command

from . import markup
from .elements import PRODUCT, on_choice, set_value
from .link import NodeGraph
from .log import Log
from .node_page import NodePage
from .presets import Presets
from .trends import Trends

if TYPE_CHECKING:
    import viser

_UPDATE_S = 0.25  # between two updates of the page, at least
_PATIENCE_S = 5.0  # with a node that has not sent its parameters
_LEFT_PIXELS = 340
_NO_NODE = 'choose a node'


class Page:
    """The page.

    Args:
        server: viser's, which is listening already.
        graph: gives the nodes that are offered, and the connections to them.
        presets: the folder of the presets.
        recording: a recording that is opened for the first node that is chosen; None: none.
        trends: what is served under `trends_address`.
        trends_address: address of the trends.
    """

    def __init__(
        self,
        server: 'viser.ViserServer',
        graph: NodeGraph,
        presets: Presets,
        recording: Path | None = None,
        *,
        trends: Trends,
        trends_address: str,
    ) -> None:
        self._trends, self._trends_address = trends, trends_address
        self._server, self._graph, self._presets, self._recording = server, graph, presets, recording
        self._names: tuple[str, ...] = ()
        self._chosen: str | None = None
        self._wanted: str | None = None
        self._node: NodePage | None = None
        self._patience_until = time.monotonic() + _PATIENCE_S
        server.gui.configure_theme(
            dark_mode=True, show_logo=False, show_share_button=False, brand_color=(29, 145, 192)
        )
        server.gui.set_panel_label(PRODUCT)
        self._build()
        self._look()

    def run(self, stop: Callable[[], bool], showing: Callable[[str], None] = lambda name: None) -> None:
        """Show the nodes and each new snapshot of the chosen one, until `stop` returns True.

        Args:
            stop: whether to end.
            showing: called with the name of each other node that is shown from now on.
        """
        try:
            while not stop():
                start, before = time.monotonic(), self._chosen
                self._log.guarded('Looking for nodes', self._look)
                if self._chosen is not None and self._chosen != before:
                    showing(self._chosen)
                if self._node is not None:
                    self._node.update(_UPDATE_S)
                    self._open_given(self._node)
                time.sleep(max(0.0, _UPDATE_S - (time.monotonic() - start)))
        finally:
            if self._node is not None:
                self._node.close()

    def _open_given(self, node: NodePage) -> None:
        """Open the recording that was given at the start, once the parameters of the node are known.

        Frames need them. Without a node it is tried once after some seconds, which is enough for clouds.
        """
        path = self._recording
        if path is None or not (node.knows_parameters or time.monotonic() > self._patience_until):
            return
        self._patience_until = math.inf
        node.open_recording(path)
        if node.knows_parameters or node.has_recording:
            self._recording = None

    def _look(self) -> None:
        """Offer the nodes that there are, and show the one that is wanted."""
        names = self._graph.nodes()
        is_other = names != self._names
        self._names = names
        if self._wanted is None:
            self._wanted = self._graph.taken()
        if self._wanted != self._chosen:
            self._show_node(self._wanted)
        elif is_other:
            self._offer()
        if self._chosen is None:
            self._waiting.content = markup.note(self._graph.sentence())

    def _show_node(self, name: str | None) -> None:
        """Build the page anew for a node."""
        if self._node is not None:
            self._node.close()
        self._chosen = name
        self._server.gui.reset()
        self._server.scene.reset()
        self._build()
        self._offer()

    def _offer(self) -> None:
        self._choice.visible = len(self._names) > 1
        self._choice.options = (self._names if self._chosen else ()) or (_NO_NODE, *self._names)
        set_value(self._choice, self._chosen or _NO_NODE)

    def _build(self) -> None:
        gui = self._server.gui
        gui.add_html(markup.STYLE)
        self._choice = gui.add_dropdown(
            'node', [_NO_NODE], visible=False, hint='The node that this page shows and changes.'
        )
        on_choice(self._choice, self._choose)
        if self._chosen is None:
            self._node = None
            self._waiting = gui.add_html('')
            with gui.add_folder('log'):
                self._log = Log(self._server)
        else:
            link = self._graph.link(self._chosen)
            self._node = NodePage(self._server, link, self._presets, self._trends, self._trends_address)
            self._log = self._node.log
        gui.main_panel.dock_left()
        gui.main_panel.set_width(_LEFT_PIXELS)

    def _choose(self, name: str) -> None:
        if name != _NO_NODE:
            self._wanted = name  # the loop of `run` shows it


def require_viser() -> None:
    """Check that viser is installed.

    Raises:
        SocialCircleError: it is not; the message says how to install it.
    """
    try:
        import viser  # noqa: F401, PLC0415 - an extra
    except ImportError:
        raise SocialCircleError(f'The page needs viser: {install_command("panel")}.') from None


def page_of(
    graph: NodeGraph, presets: Presets, host: str, port: int, recording: Path | None = None
) -> 'tuple[viser.ViserServer, Page, str]':
    """Serve the page.

    Args:
        graph: gives the nodes that are offered, and the connections to them.
        presets: the folder of the presets.
        host: the address to listen on; 127.0.0.1 keeps the page on this machine.
        port: the port; where it is in use, the next free one is taken. 0: any free port.
        recording: a recording that is opened for the first node that is chosen; None: none.

    Returns:
        viser's server, the page, and the address with the token that opens it.

    Raises:
        SocialCircleError: viser is not installed, or this machine has no such address.
    """
    require_viser()
    from .server import TRENDS, open_server  # noqa: PLC0415 - needs an extra

    trends = Trends()
    server, address = open_server(host, port, trends)
    # A path without the host, because a visitor may come through a tunnel.
    trends_address = f'{urlsplit(address).path}{TRENDS}'
    page = Page(server, graph, presets, recording, trends=trends, trends_address=trends_address)
    return server, page, address
