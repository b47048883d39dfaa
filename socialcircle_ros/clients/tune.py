"""The node `socialcircle_tune`: it serves the tuning page and connects it to the node that is tuned."""

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
        target: name of the node that is tuned, absolute or relative to the namespace.
        host: the address to listen on.
        port: the port; where it is in use, the next free one is taken.
        presets: folder of the presets.
        recording: a recording to open at the start; None: none.
        arguments: for ROS, as on the command line (--ros-args ...).
        serving: called with the node's full name and the address of the page when the page can be opened.

    Raises:
        SettingError: `target` is not the name of a node.
        SocialCircleError: viser is not installed, or this machine has no such address.
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
