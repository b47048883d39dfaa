"""The tuning page with its connection to the node that is tuned."""

import signal
import threading
from collections.abc import Callable, Sequence
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
    arguments: Sequence[str],
    serving: Callable[[str, str], None],
) -> None:
    """Serve the tuning page until Ctrl-C or SIGTERM.

    Args:
        target: name of the node that is tuned, absolute or relative to the namespace.
        host: the address to listen on.
        port: the first port to try.
        presets: the folder of the presets.
        recording: a recording to open at the start.
        arguments: of ROS, as on the command line (--ros-args ...).
        serving: called once with the full name of the node and the address of the page. The address holds a
            secret token: every other address is refused.

    Raises:
        SocialCircleError: viser is not installed, or this machine has no such address.
        SettingError: no node can have the name `target`.
    """
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    with RemoteNode(target, arguments) as node:
        server, page, address = page_of(node, Presets(presets), host, port)
        try:
            serving(node.name, address)
            if recording is not None:
                page.open_recording(recording)
            page.run(stop.is_set)
        finally:
            server.stop()
