"""The node `socialcircle_tune`: the tuning page, and behind it the connection to the node that is tuned."""

import signal
import threading
from collections.abc import Callable
from pathlib import Path

from socialcircle_ros.panel.page import page_of
from socialcircle_ros.panel.presets import Presets

from .remote_node import RemoteNode


def tune(
    target: str,
    *,
    host: str,
    port: int,
    presets: Path,
    recording: Path | None,
    arguments: list[str],
    serving: Callable[[str, str], None],
) -> None:
    """Serve the page until Ctrl-C or SIGTERM.

    Args:
        target: the node that is tuned, absolute or relative to the namespace.
        host: the address to listen on.
        port: the first that is tried.
        presets: their folder.
        recording: one to begin with.
        arguments: of ROS.
        serving: called with the node's full name and the page's address, once it is there.

    Raises:
        SocialCircleError: viser is not installed.
    """
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    with RemoteNode(target, arguments) as link:
        server, page = page_of(link, Presets(presets), host, port)
        try:
            serving(link.name, f'http://{host}:{server.get_port()}')
            if recording is not None:
                page.open_recording(recording)
            page.run(stop.is_set)
        finally:
            server.stop()
