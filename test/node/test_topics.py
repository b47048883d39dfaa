# SPDX-License-Identifier: Apache-2.0
"""The publishers of several topics together."""

import rclpy
from rclpy.lifecycle import LifecycleNode, LifecyclePublisher

from socialcircle_ros.interface import FILTERED, MASK
from socialcircle_ros.node.rclpy_internals import RCLError
from socialcircle_ros.node.topics import Publishers


def test_publishers_are_destroyed_where_the_middleware_does_not_tell_what_has_arrived(monkeypatch, capfd):
    def wait_for_all_acked(*_):
        raise RCLError('not supported')

    context = rclpy.Context()
    rclpy.init(context=context)
    node = LifecycleNode('publishers', context=context)
    publishers = Publishers(node, (FILTERED, MASK))
    monkeypatch.setattr(LifecyclePublisher, 'wait_for_all_acked', wait_for_all_acked)
    publishers.destroy()
    assert not {FILTERED.name, MASK.name} & {each.topic_name.strip('/') for each in node.publishers}
    assert 'Whether the last messages have arrived is not known: not supported' in capfd.readouterr().err
    node.destroy_node()
    rclpy.shutdown(context=context)
