# SPDX-License-Identifier: Apache-2.0
"""A node as a process of its own."""

import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from socialcircle_ros.storage import open_in_place


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
        """Begin the process, whose output goes to the log.

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
