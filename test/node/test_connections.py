# SPDX-License-Identifier: Apache-2.0
"""The sentences about publishers that cannot be heard."""

from types import SimpleNamespace

from socialcircle_ros.node.connections import node_of


def test_a_publisher_is_told_by_its_node():
    assert node_of(SimpleNamespace(node_namespace='/cell', node_name='camera')) == '/cell/camera'
    assert node_of(SimpleNamespace(node_namespace='/', node_name='camera')) == '/camera'


def test_a_publisher_whose_node_is_not_yet_discovered_is_not_given_a_name():
    publisher = SimpleNamespace(node_namespace='_NODE_NAMESPACE_UNKNOWN_', node_name='_NODE_NAME_UNKNOWN_')
    assert node_of(publisher) == '(of a node not yet known by name)'
