# SPDX-License-Identifier: Apache-2.0
"""The client that waits for a node: what it says where none appears."""

from types import SimpleNamespace

import pytest

pytest.importorskip('rclpy', reason='the client needs ROS 2')

from socialcircle_ros.clients import cloud_client
from socialcircle_ros.clients.cloud_client import Client
from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.interface import ACTIVE

pytestmark = pytest.mark.live


@pytest.fixture
def client(monkeypatch):
    monkeypatch.setattr(cloud_client, '_DISCOVERY_S', 0.2)
    with Client('/nobody') as client:
        yield client


@pytest.fixture
def process(tmp_path):
    """A process that runs, with an empty log."""
    log = tmp_path / 'node.log'
    log.touch()
    return SimpleNamespace(process=SimpleNamespace(poll=lambda: None), log=log)


def test_a_node_that_is_active_and_not_found_is_told_before_the_time_is_up(client, process):
    process.log.write_text(f'[INFO] {ACTIVE} /nobody/points.')
    with pytest.raises(SocialCircleError, match=r'The node runs .*ip link set lo up.*ROS_LOCALHOST_ONLY'):
        client.wait_for_node(process, 60.0)


def test_a_node_that_is_not_active_yet_is_waited_for(client, process):
    with pytest.raises(SocialCircleError, match=r'The node is not ready after 1 s; read .*node\.log'):
        client.wait_for_node(process, 1.0)


def test_a_node_that_was_found_in_part_is_waited_for(client, process, monkeypatch):
    process.log.write_text(f'[INFO] {ACTIVE} /nobody/points.')
    monkeypatch.setattr(client._clouds, 'get_subscription_count', lambda: 1, raising=False)
    with pytest.raises(SocialCircleError, match='The node is not ready after 1 s'):
        client.wait_for_node(process, 1.0)
