# SPDX-License-Identifier: Apache-2.0
"""A connection to the ROS graph: a node, and a thread that runs its callbacks."""

import threading
from collections.abc import Callable, Sequence

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from socialcircle_ros.errors import printable
from socialcircle_ros.node.start import start_ros

_PAUSE_S = 0.1  # after a failure, so that one that repeats does not occupy a core
_MOST_REPORTED = 100


class Connection:
    """A node in a ROS context of its own.

    Create the publishers and subscriptions on `node`, then call `start`.

    Args:
        name: of the node.
        namespace: of the node; '': the one that the arguments give.
        arguments: of ROS, as on the command line (--ros-args ...).
        failed: called with one sentence for each new kind of failure of a callback or a worker.

    Attributes:
        context: the context of the node.
        node: the node.
    """

    def __init__(
        self,
        name: str,
        namespace: str = '',
        arguments: Sequence[str] = (),
        failed: Callable[[str], None] = lambda _: None,
    ) -> None:
        self.context = rclpy.Context()
        start_ros(list(arguments), self.context)
        self.node = Node(name, namespace=namespace, context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._threads: list[threading.Thread] = []
        self._failed = failed
        self._reported: set[str] = set()
        self._closing = threading.Event()

    def start(self, *workers: Callable[[], None]) -> None:
        """Run the callbacks of the node on a thread, and each worker on a thread of its own.

        A worker must end soon after the context is shut down.
        """
        self._threads = [threading.Thread(target=target) for target in (self._spin, *workers)]
        for thread in self._threads:
            thread.start()

    def guarded(self, step: Callable[[], object]) -> None:
        """Run a step; what it raises is logged, once for each text, and the caller goes on."""
        try:
            step()
        except Exception as error:  # noqa: BLE001 - one bad message ends nothing
            if self.context.ok():  # else the step was interrupted by the end
                self._report(printable(f'A message or a call failed: {type(error).__name__}: {error}.'))

    def close(self) -> None:
        """Leave the graph, and wait for the threads."""
        self._closing.set()
        rclpy.shutdown(context=self.context)
        for thread in self._threads:
            thread.join()
        self.node.destroy_node()

    def _spin(self) -> None:
        """Run callbacks. Whatever one of them raises, or rclpy itself for a message, the next ones run."""
        while self.context.ok():
            self.guarded(self._executor.spin)
            self._closing.wait(_PAUSE_S)

    def _report(self, text: str) -> None:
        if text in self._reported:
            return
        if len(self._reported) == _MOST_REPORTED:
            self._reported.clear()
        self._reported.add(text)
        self.node.get_logger().error(text)
        self._failed(text)
