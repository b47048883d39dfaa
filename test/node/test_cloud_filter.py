# SPDX-License-Identifier: Apache-2.0
"""What the node counts of its clouds, without a node of its own process."""

import threading

import pytest
import rclpy
from examples import cloud
from rclpy.lifecycle import LifecycleNode

from socialcircle_ros.interface import FILTERED, MASK
from socialcircle_ros.node.cloud_filter import CloudFilter
from socialcircle_ros.node.health import Health, InputCounts
from socialcircle_ros.node.parameters import Configuration

NOWHERE, SOMEWHERE = {'circle.vote_region': [900, 900, 60, 60]}, {}


class Clouds(CloudFilter):
    """What a node does with clouds, under settings that can be changed."""

    def __init__(self, node):
        self.health, self.values = Health(), {}
        self.begun, self.through = threading.Event(), threading.Event()
        self.through.set()
        super().__init__(node, self.settings, self.health)
        self.node, self.rows = node, []
        self._rows.put = lambda *row: self.rows.append(row)

    def settings(self):
        self.begun.set()
        self.through.wait()
        return Configuration.from_ros({'circle.mode': 'paper', **self.values})

    def begin(self):
        """Filter a cloud until the settings are asked for; `through` lets it go on."""
        self.through.clear()
        self.begun.clear()  # the settings are also asked for when it is made
        self.filter(cloud())
        assert self.begun.wait(60)

    def outcome(self):
        """How many clouds count as published and as dropped, and how many have a row."""
        self.through.set()
        self._worker.drain()
        return self.health.counts.published, self.health.counts.dropped, len(self.rows)

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
    node.trigger_configure()
    node.trigger_activate()
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
    clouds.begin()
    for _ in range(2):
        clouds.filter(cloud())
    assert clouds.outcome() == (2, 1, 2)
    assert 'a newer one arrived' in clouds.health.last_reason


@pytest.mark.parametrize('values', [SOMEWHERE, NOWHERE, None])
def test_a_cloud_at_hand_at_a_reset_is_not_counted_and_not_the_last_one(clouds, monkeypatch, values):
    monkeypatch.setattr('socialcircle_ros.node.cloud_filter._FORGETTING_S', 0.01)
    if values is None:
        monkeypatch.setattr('socialcircle_ros.node.cloud_filter.process_cloud', lambda *args, **named: 1 / 0)
    clouds.values = values or {}
    clouds.begin()
    clouds.forget()
    clouds.health.reset()
    clouds.through.set()
    clouds._worker.drain()
    assert clouds.health.counts == InputCounts()
    assert not clouds.health.in_trouble()
    assert not clouds.publish_last()


def test_a_cloud_that_waits_when_the_node_is_deactivated_counts_as_dropped(clouds, monkeypatch):
    health = clouds.health

    def dropped(reason):
        Health.dropped(health, reason)
        clouds.through.set()

    monkeypatch.setattr(health, 'dropped', dropped)
    clouds.begin()
    clouds.filter(cloud())
    clouds.finish()
    assert clouds.outcome() == (1, 1, 1)
    assert health.last_reason == 'A cloud was dropped: it waited when the node was deactivated.'


def test_a_cloud_that_is_not_filtered_in_time_counts_as_dropped_and_has_no_row(clouds, monkeypatch):
    monkeypatch.setattr('socialcircle_ros.node.cloud_filter.DRAINING_S', 0.01)
    clouds.begin()
    clouds.finish()
    clouds.node.trigger_deactivate()
    assert clouds.outcome() == (0, 1, 0)
    assert clouds.health.last_reason.endswith('it was still being filtered when the node was no longer active.')


def test_a_cloud_whose_first_outputs_were_not_published_has_no_measurement(clouds, monkeypatch):
    """As where the node is deactivated and activated again while the cloud is filtered."""
    published, real = [], clouds._publishers.publish

    def publish(topic, message):
        published.append(topic)
        return real(topic, message) and topic != FILTERED

    monkeypatch.setattr(clouds._publishers, 'publish', publish)
    clouds.filter(cloud())
    assert clouds.outcome() == (0, 1, 0)
    assert published == [FILTERED, MASK]


def test_a_cloud_that_waits_when_the_node_ends_is_told(clouds):
    clouds.begin()
    clouds.filter(cloud())
    clouds.close(lambda: clouds.through.set() or True)
    assert clouds.outcome() == (1, 1, 1)
    assert clouds.health.last_reason == 'A cloud was dropped: it waited when the node ended.'


def test_a_cloud_that_is_at_hand_when_the_node_ends_is_told(clouds):
    clouds.begin()
    assert not clouds.close(lambda: False)
    assert clouds.health.counts.dropped == 1
    assert clouds.health.last_reason.endswith('it was still being filtered when the node ended.')
