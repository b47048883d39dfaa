# SPDX-License-Identifier: Apache-2.0
"""The node's filter for clouds, without the rest of the node."""

import threading

import pytest
import rclpy
from examples import cloud
from rclpy.lifecycle import LifecycleNode

from socialcircle_ros.node.cloud_filter import CloudFilter
from socialcircle_ros.node.health import Health
from socialcircle_ros.node.parameters import Configuration

pytestmark = pytest.mark.live


def test_others_give_way_to_a_cloud_before_it_is_filtered_and_once_more_after_it():
    context = rclpy.Context()
    rclpy.init(context=context)
    node = LifecycleNode('filter', context=context)
    came, filtered = threading.Event(), threading.Event()

    def give_way():
        (filtered if came.is_set() else came).set()

    clouds = CloudFilter(node, lambda: Configuration.from_ros({}), Health(), give_way)
    try:
        clouds.filter(cloud())
        assert filtered.wait(60)
    finally:
        clouds.close()
        node.destroy_node()
        rclpy.shutdown(context=context)
