# SPDX-License-Identifier: Apache-2.0
"""What the node counts of its clouds, without a node of its own process."""

import threading

import pytest
import rclpy
from examples import cloud
from rclpy.lifecycle import LifecycleNode

from socialcircle_ros.node.cloud_filter import CloudFilter
from socialcircle_ros.node.health import Health
from socialcircle_ros.node.parameters import Configuration

NOWHERE, SOMEWHERE = {'circle.vote_region': [900, 900, 60, 60]}, {}


class Clouds(CloudFilter):
    """What a node does with clouds, under settings that can be changed."""

    def __init__(self, node):
        self.health, self.values = Health(), {}
        self.begun, self.through = threading.Event(), threading.Event()
        self.through.set()
        super().__init__(node, self.settings, self.health)

    def settings(self):
        self.begun.set()
        self.through.wait()
        return Configuration.from_ros({'circle.mode': 'paper', **self.values})

    def again(self, values):
        self.values = values
        self.filter_again()
        self._worker.drain()


@pytest.fixture
def clouds():
    context = rclpy.Context()
    rclpy.init(context=context)
    node = LifecycleNode('clouds', context=context)
    clouds = Clouds(node)
    yield clouds
    clouds.through.set()
    clouds.close()
    node.destroy_node()
    rclpy.shutdown(context=context)


@pytest.mark.parametrize('fault', ['refused', 'failed'])
def test_a_cloud_that_is_filtered_again_is_counted_once_and_is_no_trouble_once_it_passes(
    clouds, fault, monkeypatch
):
    health, bad = clouds.health, NOWHERE
    with monkeypatch.context() as patch:
        if fault == 'failed':
            patch.setattr('socialcircle_ros.node.cloud_filter.process_cloud', lambda *args, **named: 1 / 0)
        clouds.values = bad
        clouds.filter(cloud())
        clouds._worker.drain()
        assert health.in_trouble()
        for _ in range(3):
            clouds.again(bad)
        assert getattr(health.counts, fault) == 1
        assert health.in_trouble()
    clouds.again(SOMEWHERE)
    assert getattr(health.counts, fault) == 1
    assert not health.in_trouble()


def test_a_cloud_that_passes_again_does_not_end_the_trouble_with_frames(clouds):
    clouds.filter(cloud())
    clouds._worker.drain()
    clouds.health.frame_refused('The frame is cut off.')
    clouds.again(SOMEWHERE)
    assert clouds.health.in_trouble()


def test_a_cloud_that_a_newer_one_replaces_is_told(clouds):
    clouds.listen()
    clouds.through.clear()
    clouds.begun.clear()  # the settings are also asked for when it is made
    clouds.filter(cloud())
    assert clouds.begun.wait(60)
    for _ in range(2):
        clouds.filter(cloud())
    clouds.through.set()
    clouds._worker.drain()
    assert clouds.health.counts.dropped == 1
    assert 'a newer one arrived' in clouds.health.last_reason


def test_a_cloud_that_waits_when_the_node_is_deactivated_counts_as_dropped(clouds, monkeypatch):
    health = clouds.health

    def dropped(reason):
        Health.dropped(health, reason)
        clouds.through.set()

    monkeypatch.setattr(health, 'dropped', dropped)
    clouds.through.clear()
    clouds.begun.clear()
    clouds.filter(cloud())
    assert clouds.begun.wait(60)
    clouds.filter(cloud())
    clouds.finish()
    assert (health.counts.published, health.counts.dropped) == (1, 1)
    assert health.last_reason == 'A cloud was dropped: it waited when the node was deactivated.'
