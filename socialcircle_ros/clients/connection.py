"""A connection to the ROS graph: a node, and a thread that runs its callbacks."""

import contextlib
import threading
from collections.abc import Callable, Sequence

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node


class Connection:
    """A node in a ROS context of its own.

    Create the publishers and subscriptions on `node`, then call `start`.

    Args:
        name: of the node.
        namespace: of the node; '': the one that the arguments give.
        arguments: of ROS, as on the command line (--ros-args ...).

    Attributes:
        context: the context of the node.
        node: the node.
    """

    def __init__(self, name: str, namespace: str = '', arguments: Sequence[str] = ()) -> None:
        self.context = rclpy.Context()
        rclpy.init(args=list(arguments), context=self.context)
        self.node = Node(name, namespace=namespace, context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._threads: list[threading.Thread] = []

    def start(self, *workers: Callable[[], None]) -> None:
        """Run the callbacks of the node on a thread, and each worker on a thread of its own.

        A worker must end soon after the context is shut down.
        """
        self._threads = [threading.Thread(target=target) for target in (self._spin, *workers)]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Leave the graph, and wait for the threads."""
        rclpy.shutdown(context=self.context)
        for thread in self._threads:
            thread.join()
        self.node.destroy_node()

    def _spin(self) -> None:
        with contextlib.suppress(ExternalShutdownException):
            self._executor.spin()
