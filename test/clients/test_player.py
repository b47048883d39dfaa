# SPDX-License-Identifier: Apache-2.0
"""Parts of the player that need no graph; test/commands/test_live.py plays recordings."""

import pytest

from socialcircle_ros.clients.message_types import message_class
from socialcircle_ros.clients.player import topic_prefix
from socialcircle_ros.errors import RecordingError, SettingError


@pytest.mark.parametrize(
    ('namespace', 'prefix'), [('', ''), ('/', ''), ('cell1', '/cell1'), ('/cell1/', '/cell1'), ('a/b', '/a/b')]
)
def test_a_namespace_becomes_a_prefix(namespace, prefix):
    assert topic_prefix(namespace) == prefix


@pytest.mark.parametrize('namespace', ['bad x', '1st', 'a//b'])
def test_a_namespace_that_ros_does_not_allow_is_refused(namespace):
    with pytest.raises(SettingError, match=f"'{namespace}' is not a valid namespace"):
        topic_prefix(namespace)


@pytest.mark.parametrize('name', ['sensor_msgs/msg/PointCloud2', 'sensor_msgs/PointCloud2'])
def test_a_message_class_is_found_by_its_name(name):
    assert message_class(name).__name__ == 'PointCloud2'


@pytest.mark.parametrize('name', ['odd_msgs/msg/Odd', 'sensor_msgs/msg/Odd', 'PointCloud2', ''])
def test_a_type_that_is_not_installed_is_named(name):
    with pytest.raises(RecordingError, match=f"Type '{name}' is not installed"):
        message_class(name)
