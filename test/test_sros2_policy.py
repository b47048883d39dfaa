# SPDX-License-Identifier: Apache-2.0
"""The policy of SROS 2 allows what the node uses, and no more."""

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from socialcircle_ros import interface

POLICY = Path(__file__).resolve().parents[1] / 'config/sros2_policy.xml'
NAMESPACE = '/cell1'
OF_EVERY_NODE = {'/rosout', '/parameter_events', f'{NAMESPACE}/social_circle/transition_event'}


def allowed(kind, permission):
    """The full names that the policy allows."""
    names = set()
    (profile,) = ET.parse(POLICY).iter('profile')  # noqa: S314 - our own file
    for group in profile.iter(f'{kind}s'):
        if group.get(permission) == 'ALLOW':
            names |= {full(element.text) for element in group.iter(kind)}
    return names


def full(name):
    name = name.replace('~', interface.NODE_NAME, 1)
    return name if name.startswith('/') else f'{NAMESPACE}/{name}'


def test_every_topic_and_service_of_the_interface_is_allowed():
    topics = {
        way: {each.within(NAMESPACE) for each in interface.TOPICS if each.direction == way}
        for way in ('in', 'out')
    }
    assert allowed('topic', 'subscribe') == topics['in'] | {'/clock'}
    assert allowed('topic', 'publish') == topics['out'] | OF_EVERY_NODE
    assert {full(each.name) for each in interface.SERVICES} < allowed('service', 'reply')


@pytest.mark.live
def test_all_that_a_live_node_uses_is_allowed(tmp_path):
    pytest.importorskip('rclpy')
    from live import Cell

    cell = Cell(tmp_path, {'use_sim_time': 'true', 'circle.mode': 'adaptive', 'output.score': 'true'})
    try:
        of_node = interface.NODE_NAME, cell.namespace
        cell.wait_for(lambda: of_node in cell.peer.get_node_names_and_namespaces())
        services = allowed('service', 'reply')
        cell.wait_for(lambda: names(cell, 'service', of_node) == services)
        assert names(cell, 'publisher', of_node) == allowed('topic', 'publish')
        assert names(cell, 'subscriber', of_node) <= allowed('topic', 'subscribe')
        assert names(cell, 'client', of_node) == set()
    finally:
        cell.close()


def names(cell, kind, of_node):
    """The names that the graph shows of the node, in the namespace of the policy."""
    listed = getattr(cell.peer, f'get_{kind}_names_and_types_by_node')(*of_node)
    return {name.replace(cell.namespace, NAMESPACE, 1) for name, _ in listed}
