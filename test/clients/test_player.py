# SPDX-License-Identifier: Apache-2.0
"""Parts of the player that need no graph; test/commands/test_live.py plays recordings."""

import pytest

from socialcircle_ros.clients.message_types import message_class
from socialcircle_ros.errors import RecordingError


@pytest.mark.parametrize('name', ['sensor_msgs/msg/PointCloud2', 'sensor_msgs/PointCloud2'])
def test_a_message_class_is_found_by_its_name(name):
    assert message_class(name).__name__ == 'PointCloud2'


@pytest.mark.parametrize('name', ['odd_msgs/msg/Odd', 'sensor_msgs/msg/Odd', 'PointCloud2', ''])
def test_a_type_that_is_not_installed_is_named(name):
    with pytest.raises(RecordingError, match=f"Type '{name}' is not installed"):
        message_class(name)
