# SPDX-License-Identifier: Apache-2.0
"""Which nodes of the graph can be tuned, and the connections to them."""

import time
from collections.abc import Sequence
from contextlib import ExitStack

from socialcircle_ros.arguments import OneOrSeveral, several
from socialcircle_ros.interface import NODE_NAME

from .connection import Connection
from .graph import nodes_of_the_filter, other_nodes
from .remote_node import RemoteNode

_DISCOVERY_S = 2.0  # in which the nodes that run already are found
_SETTLED_S = 0.5  # without a new node, after which there are no more to find
_PERIOD_S = 0.05
_PREFIX = 'socialcircle_tune'


class NodeFinder:
    """The nodes that the page offers; a context manager that ends the connections to them.

    Making one takes up to two seconds, in which the nodes of the graph are discovered.

    Args:
        nodes: full names of nodes, or names relative to the namespace that `arguments` give.
        cells: namespaces of a node, or full names of nodes. Without `nodes` and `cells`, every node of the graph
            is offered; with a namespace in `arguments`, the node in it.
        arguments: of ROS, as on the command line (--ros-args ...).

    Raises:
        SettingError: no node can have one of the names.
    """

    def __init__(
        self, nodes: OneOrSeveral[str] = (), cells: OneOrSeveral[str] = (), arguments: Sequence[str] = ()
    ) -> None:
        self._arguments = arguments
        nodes, cells = several(nodes), several(cells)
        self._links: dict[str, RemoteNode] = {}
        with ExitStack() as undoing:
            self._connection = Connection(f'{_PREFIX}_finder', arguments=arguments)
            undoing.callback(self.close)
            self._connection.start()
            if not nodes and not cells and self._connection.node.get_namespace() != '/':
                nodes = (NODE_NAME,)
            for name in nodes:
                self.link(name)
            if cells or not nodes:
                self._discover()
            for name in cells:
                self.link(self._node_of(name))
            self._named = tuple(self._links)
            undoing.pop_all()

    def nodes(self) -> tuple[str, ...]:
        """Full names of the nodes that are offered: those that were named, else those that were ever found."""
        if self._named:
            return self._named
        return tuple(sorted({*self._links, *nodes_of_the_filter(self._connection.node)}))

    def taken(self) -> str | None:
        """The node to begin with: the first that was named, else the only one that there is."""
        nodes = self.nodes()
        return nodes[0] if self._named or len(nodes) == 1 else None

    def sentence(self) -> str:
        """What is waited for while no node is chosen, and what there is."""
        nodes = self.nodes()
        if nodes:
            return f'{len(nodes)} nodes can be tuned; choose one: {", ".join(nodes)}.'
        others = other_nodes(self._connection.node, nodes, _PREFIX)
        there_is = f'The graph has other nodes: {", ".join(others)}.' if others else 'The graph has no other node.'
        return f'Waiting for a node; start one with: socialcircle node. {there_is}'

    def link(self, name: str) -> RemoteNode:
        """The connection to a node, which is made at the first call.

        Raises:
            SettingError: no node can have this name.
        """
        if name not in self._links:
            made = RemoteNode(name, self._arguments)
            if made.name in self._links:
                made.close()
            else:
                self._links[made.name] = made
            name = made.name
        return self._links[name]

    def close(self) -> None:
        """Leave the graph."""
        for link in self._links.values():
            link.close()
        self._connection.close()

    def __enter__(self) -> 'NodeFinder':  # noqa: PYI034 - Self is not in Python 3.10
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _discover(self) -> None:
        """Wait until the nodes that run are found."""
        found: tuple[str, ...] = ()
        deadline = time.monotonic() + _DISCOVERY_S
        settled = deadline
        while time.monotonic() < min(deadline, settled):
            now = nodes_of_the_filter(self._connection.node)
            if now != found:
                found, settled = now, time.monotonic() + _SETTLED_S
            time.sleep(_PERIOD_S)

    def _node_of(self, cell: str) -> str:
        """The node that a name stands for: itself, or the one in the namespace."""
        found = nodes_of_the_filter(self._connection.node)
        inside = [name for name in found if name.rpartition('/')[0] == cell]
        if cell in found or cell.rpartition('/')[2] == NODE_NAME:
            return cell
        return inside[0] if len(inside) == 1 else f'{cell.rstrip("/")}/{NODE_NAME}'
