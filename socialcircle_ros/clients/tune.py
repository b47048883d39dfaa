# SPDX-License-Identifier: Apache-2.0
"""The tuning page with its connection to the node that is tuned."""

import signal
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

from socialcircle_ros.arguments import OneOrSeveral
from socialcircle_ros.panel.page import page_of
from socialcircle_ros.panel.presets import Presets

from .finding import NodeFinder


def tune(
    nodes: OneOrSeveral[str],
    cells: OneOrSeveral[str],
    *,
    host: str,
    port: int,
    presets: Path,
    recording: Path | None,
    arguments: Sequence[str],
    serving: Callable[[str, str, str], None],
) -> None:
    """Serve the tuning page until Ctrl-C or SIGTERM.

    Args:
        nodes: names of the nodes that are tuned, absolute or relative to the namespace.
        cells: namespaces of nodes that are tuned. Without `nodes` and `cells`, the nodes of the graph are offered.
        host: the address to listen on.
        port: the first port to try.
        presets: the folder of the presets.
        recording: a recording to open for the first node.
        arguments: of ROS, as on the command line (--ros-args ...).
        serving: called at the start, and for each other node that is shown, with the full name of the node, or ''
            where there is none, with what the page waits for, and with its address. The address holds a secret
            token: every other address is refused.

    Raises:
        SocialCircleError: viser is not installed, or this machine has no such address.
        SettingError: no node can have one of the names.
    """
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    with NodeFinder(nodes, cells, arguments) as finder:
        server, page, address = page_of(finder, Presets(presets), host, port, recording)
        try:
            serving(finder.taken() or '', finder.sentence(), address)
            page.run(stop.is_set, lambda name: serving(name, '', address))
        finally:
            server.stop()
