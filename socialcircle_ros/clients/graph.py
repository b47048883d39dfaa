# SPDX-License-Identifier: Apache-2.0
"""The nodes of the filter in the graph."""

from rclpy.node import Node

from socialcircle_ros import interface


def nodes_of_the_filter(node: Node) -> tuple[str, ...]:
    """Full names of the nodes that offer the services of the filter, whatever they are called; sorted."""
    services = {name for name, _ in node.get_service_names_and_types()}
    first, *others = (service.name.removeprefix('~') for service in interface.SERVICES)
    names = {name.removesuffix(first) for name in services if name.endswith(first)}
    return tuple(sorted(name for name in names if services.issuperset(name + other for other in others)))


def other_nodes(node: Node, known: tuple[str, ...], prefix: str) -> tuple[str, ...]:
    """Full names of the other nodes in the graph, sorted, without those whose name begins with a prefix."""
    names = {full_name(space, name) for name, space in node.get_node_names_and_namespaces()}
    hidden = ('_', prefix)
    return tuple(sorted(name for name in names - {*known} if not name.rpartition('/')[2].startswith(hidden)))


def full_name(namespace: str, name: str) -> str:
    """The full name of a node."""
    return f'{namespace.rstrip("/")}/{name}'
