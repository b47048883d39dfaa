# SPDX-License-Identifier: Apache-2.0
"""A node as a process of its own."""

import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.interface import ACTIVE
from socialcircle_ros.storage import open_in_place


def is_active(log: Path) -> bool:
    """Whether a node says in its log that it is active."""
    try:
        return ACTIVE.encode() in log.read_bytes()
    except OSError:
        return False


def not_found(log: Path) -> SocialCircleError:
    """The error for a node that runs, as its log says, and does not appear in the graph."""
    return SocialCircleError(
        f'The node runs ({log} says so), but cannot be found over DDS. Check the network: an interface must be up'
        ' (ip link set lo up), no firewall may drop UDP, and ROS_LOCALHOST_ONLY and'
        ' ROS_AUTOMATIC_DISCOVERY_RANGE must let it be found.'
    )


class NodeProcess:
    """`social_circle_node` in a process of its own; a context manager that ends it with SIGINT.

    Args:
        namespace: of the node, such as `/demo`.
        log: the file that receives the node's output.
        parameters: full names to values, as YAML writes them.
        arguments: more arguments for --ros-args, such as remappings.
        module: the Python module to run.

    Attributes:
        log: the file that receives the node's output.
        process: the running process.
    """

    def __init__(
        self,
        namespace: str,
        log: Path,
        parameters: Mapping[str, str] | None = None,
        arguments: Sequence[str] = (),
        module: str = 'socialcircle_ros.node.main',
    ) -> None:
        given = [item for name, value in (parameters or {}).items() for item in ('-p', f'{name}:={value}')]
        self.log = log
        self.process = self.begin(module, ['--ros-args', '-r', f'__ns:={namespace}', *given, *arguments])

    def begin(self, module: str, arguments: list[str]) -> subprocess.Popen[bytes]:
        """Begin the process; its output goes to the log.

        Args:
            module: the Python module to run.
            arguments: its arguments.
        """
        with open_in_place(self.log) as output:
            return subprocess.Popen([sys.executable, '-m', module, *arguments], stdout=output, stderr=output)  # noqa: S603

    def stop(self, timeout_s: float = 10.0) -> int:
        """End the node as Ctrl-C does. It is killed if it does not end in time.

        Returns:
            The exit code.
        """
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            return self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return self.process.wait()

    def __enter__(self) -> 'NodeProcess':  # noqa: PYI034 - Self is not in Python 3.10
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
