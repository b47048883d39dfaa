"""The settings that a node has lost by a restart."""

import dataclasses

import pytest
from panel.fake import descriptors

from socialcircle_ros.panel.link import Snapshot
from socialcircle_ros.panel.restart_offer import LostSettings
from socialcircle_ros.settings import PARAMETERS

SCALE, WINDOW = 'circle.radius_scale', 'circle.window'
DEFAULTS = {name: row.default for name, row in PARAMETERS.items()}


class Node:
    def __init__(self):
        self.lost = LostSettings()
        self.snapshot = Snapshot()

    def follow(self, **changes):
        before, self.snapshot = self.snapshot, dataclasses.replace(self.snapshot, **changes)
        self.lost.follow(before, self.snapshot)
        return self.lost.values

    def start(self, **values):
        named = {name.replace('__', '.'): value for name, value in values.items()}
        return self.follow(starts=self.snapshot.starts + 1, descriptors=descriptors(), values=DEFAULTS | named)

    def set(self, **values):
        named = {name.replace('__', '.'): value for name, value in values.items()}
        return self.follow(values={**self.snapshot.values, **named})


@pytest.fixture
def node():
    node = Node()
    assert node.start() == {}
    return node


def test_the_first_start_and_a_restart_with_the_same_settings_lose_nothing(node):
    node.set(circle__window=5)
    assert node.start(circle__window=5) == {}


def test_what_a_restart_loses_is_kept_until_it_is_restored(node):
    node.set(circle__radius_scale=2.5, circle__window=7)
    assert node.start(circle__window=5) == {SCALE: 2.5, WINDOW: 7}
    assert node.follow(sentence='The next one.') == {SCALE: 2.5, WINDOW: 7}
    assert node.set(circle__radius_scale=2.5) == {WINDOW: 7}
    assert node.set(circle__window=9) == {}  # somebody has decided otherwise


def test_a_second_restart_does_not_lose_what_the_first_one_lost(node):
    node.set(circle__radius_scale=2.5, circle__window=7)
    node.start()
    node.set(circle__window=9)
    assert node.start() == {SCALE: 2.5, WINDOW: 9}
    assert node.start(circle__radius_scale=2.5) == {WINDOW: 9}


def test_what_is_fixed_at_the_start_is_not_offered(node):
    fixed = next(row.name for row in PARAMETERS.values() if row.read_only and row.kind is bool)
    node.follow(values={**node.snapshot.values, fixed: not DEFAULTS[fixed]})
    assert node.start() == {}


def test_a_parameter_that_only_one_of_the_two_has_is_not_offered(node):
    node.set(circle__flank=1.0)
    assert node.start() == {}
    assert node.follow(starts=9, values={**DEFAULTS, 'circle.slope': 1.0}) == {}


def test_the_offer_can_be_declined(node):
    node.set(circle__window=7)
    node.start()
    node.lost.forget()
    assert node.follow(sentence='The next one.') == {}
