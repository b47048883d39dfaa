# SPDX-License-Identifier: Apache-2.0
"""What the page shows, for any order of actions and messages; and the settings that a node loses by a restart."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule
from panel.fake import descriptors

from socialcircle_ros.messages.diagnostics import Status
from socialcircle_ros.messages.header import Header, stamp_of, stamp_text
from socialcircle_ros.messages.point_cloud import encode_point_cloud
from socialcircle_ros.panel.link import Presence, ShownCloud
from socialcircle_ros.panel.recorded import RecordedCloud
from socialcircle_ros.panel.state import OpenRecording, Sent, State
from socialcircle_ros.settings import PARAMETERS, CircleSettings

SCALE, WINDOW = 'circle.radius_scale', 'circle.window'
DEFAULTS = {name: row.default for name, row in PARAMETERS.items()}


class Node:
    def __init__(self):
        self.state = State()

    @property
    def snapshot(self):
        return self.state.snapshot

    def follow(self, **changes):
        self.state = self.state.followed(dataclasses.replace(self.snapshot, **changes))
        return {name: value for name, (value, _) in self.state.lost.items()}

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
    node.state = node.state.keeping_new_settings()
    assert node.follow(sentence='The next one.') == {}


def small_cloud(stamp):
    return encode_point_cloud(Header.at(stamp, 'part'), np.full((*size_of(stamp), 3), stamp, np.float32))


def size_of(stamp):
    return (3, 2) if stamp == 9 else (2, 3)


RECORDINGS = {
    Path('/night/a.mcap'): [small_cloud(number) for number in (1, 2, 3)],
    Path('/night/b.mcap'): [small_cloud(number) for number in (4, 2)],
}
LIVE = [small_cloud(number) for number in (2, 9)]
SETTINGS = st.sampled_from((SCALE, WINDOW)), st.sampled_from((3, 5, 7))


class PageOfANode(RuleBasedStateMachine):
    """A page, and a node that answers later, refuses, is changed from elsewhere, and starts again.

    The model keeps in plain variables what a person should see.
    """

    def __init__(self):
        super().__init__()
        self.values = dict(DEFAULTS)
        self.starts, self.refusals, self.number = 1, 0, 0
        self.waiting, self.last = [], None  # clouds on their way to the node, and the last one that it filtered
        self.wanted = dict(self.values)  # what a person has set, or kept
        self.asked, self.sent, self.filtered = None, None, None
        self.region = ()
        self.state = State()
        self.tell(presence=Presence.ACTIVE, descriptors=descriptors())

    def tell(self, **changes):
        """The page gets a snapshot of the node."""
        before = self.state.snapshot
        self.state = self.state.followed(
            dataclasses.replace(
                before, revision=before.revision + 1, starts=self.starts, values=dict(self.values),
                refusals=self.refusals, last_reason='It is flat.', **changes,
            )
        )  # fmt: skip

    def answer(self, cloud):
        """The node filters a cloud with its settings."""
        self.number += 1
        size = size_of(stamp_of(cloud))
        if self.filtered is not None and size != size_of(stamp_of(self.filtered[0])):
            self.region = ()
        circle = {name: str(value) for name, value in CircleSettings.from_ros(self.values).to_ros().items()}
        status = Status(0, 'social_circle', '', '', circle)
        self.last = cloud
        self.filtered = (cloud, dict(self.values), self.starts)
        self.tell(shown_cloud=ShownCloud(self.number, cloud, np.zeros(size, np.uint8), status))

    @rule(path=st.sampled_from(list(RECORDINGS)))
    def open(self, path):
        first = RecordedCloud('/points', 1)
        self.state = self.state.opened(OpenRecording(path, len(RECORDINGS[path]), 1, first))
        self.send(path, 1)

    @rule()
    def open_what_is_no_recording(self):
        before = self.state
        self.state = self.state.not_opened('/nowhere does not exist.')
        assert dataclasses.replace(self.state, open_problem=before.open_problem) == before

    @precondition(lambda self: self.asked)
    @rule(data=st.data())
    def step(self, data):
        path, _ = self.asked
        self.send(path, data.draw(st.integers(1, len(RECORDINGS[path]))))

    def send(self, path, number):
        self.asked = path, number
        self.state = self.state.asked(number, RecordedCloud('/points', number))
        self.sent = (path, number, RECORDINGS[path][number - 1])
        sent = Sent(path, len(RECORDINGS[path]), number, None, self.sent[2])
        self.state = self.state.sending(sent).delivered(sent, '')
        self.waiting.append(self.sent[2])

    @precondition(lambda self: self.waiting)
    @rule()
    def the_node_answers(self):
        self.answer(self.waiting.pop(0))

    @precondition(lambda self: self.waiting)
    @rule()
    def the_node_refuses(self):
        self.waiting.pop(0)
        self.refusals += 1
        self.tell()

    @rule(cloud=st.sampled_from(LIVE))
    def another_publisher_sends_a_cloud(self, cloud):
        self.answer(cloud)

    @rule(name=SETTINGS[0], value=SETTINGS[1], again=st.booleans())
    def a_setting_is_changed(self, name, value, again):
        value = type(DEFAULTS[name])(value)
        if self.values[name] != value:  # else the page learns of no decision
            self.values[name] = self.wanted[name] = value
        self.tell()
        if again and self.last is not None:
            self.answer(self.last)

    @rule(kept=st.booleans())
    def the_node_is_started_again(self, kept):
        self.starts += 1
        self.waiting, self.last = [], None
        self.refusals = 0
        if not kept:
            self.values = dict(DEFAULTS)
        self.tell()

    @rule()
    def the_new_settings_are_kept(self):
        self.state = self.state.keeping_new_settings()
        self.wanted = dict(self.values)

    @rule(a=st.sampled_from(('', 'fine')), b=st.sampled_from(('', 'wide')))
    def two_settings_are_compared(self, a, b):
        self.state = self.state.comparing(a, b)

    @precondition(lambda self: self.state.must_compare)
    @rule(refused=st.booleans())
    def the_comparison_is_computed(self, refused):
        of = self.state.to_compare
        result = None if refused else dataclasses.make_dataclass('Result', ['of'])(of)
        self.state = self.state.with_comparison(of, result, 'It is flat.' if refused else '')
        assert not self.state.must_compare

    @rule()
    def the_comparison_is_closed(self):
        self.state = self.state.not_comparing()
        assert self.state.comparison is None

    @precondition(lambda self: self.filtered)
    @rule(drawn=st.sampled_from(((), (0, 1, 2, 1))))
    def a_region_of_interest_is_drawn_or_closed(self, drawn):
        self.region = drawn
        self.state = self.state.looking_at(drawn)

    @precondition(lambda self: self.filtered)
    @rule(row=st.integers(0, 1), column=st.integers(0, 1))
    def a_point_is_clicked(self, row, column):
        self.state = self.state.picking((row, column))
        self.picked_of = self.filtered[0]

    @invariant()
    def the_cloud_that_is_shown_is_the_last_that_the_node_filtered_and_the_title_names_it(self):
        if self.filtered is None:
            assert (self.state.shown, self.state.title) == (None, '')
            return
        cloud, _, _ = self.filtered
        assert self.state.shown.cloud == cloud
        if self.sent is not None and self.sent[2] == cloud:
            path, number, _ = self.sent
            assert self.state.title == f'Cloud {number} of {len(RECORDINGS[path])} of {path.name}'
        else:
            stamp = next(number for number in range(10) if small_cloud(number) == cloud)
            assert self.state.title == f'The cloud with the stamp {stamp_text(stamp)} s'

    @invariant()
    def a_result_of_other_settings_than_those_in_force_is_said_to_be_one(self):
        if self.filtered is None:
            assert self.state.caveat == ''
            return
        _, values, starts = self.filtered
        differing = {name for name in (SCALE, WINDOW) if values[name] != self.values[name]}
        assert set(self.state.differing) == differing
        assert bool(self.state.caveat) == bool(differing or starts != self.starts)

    @invariant()
    def the_recording_stands_where_it_was_asked_to(self):
        if self.asked is None:
            assert self.state.stepping == ''
            return
        path, number = self.asked
        assert self.state.stepping.startswith(f'Cloud {number} of {len(RECORDINGS[path])} of {path.name},')
        waits = self.filtered is None or self.filtered[0] != self.sent[2]
        assert bool(self.state.stepping_problem) == waits

    @invariant()
    def a_comparison_is_of_what_is_shown(self):
        if self.state.comparison is not None:
            cloud, values = self.state.comparison.of
            assert cloud == self.filtered[0]
            assert values in ({}, self.values)
            assert (values == {}) == bool(self.state.compared.a and self.state.compared.b)

    @invariant()
    def what_a_person_has_set_and_a_restart_has_lost_is_offered(self):
        lost = {name: value for name, value in self.wanted.items() if value != self.values[name]}
        assert {name: value for name, (value, _) in self.state.lost.items()} == lost

    @invariant()
    def a_point_that_was_clicked_is_of_the_cloud_that_is_shown(self):
        if self.state.picked is not None:
            assert self.picked_of == self.filtered[0]

    @invariant()
    def the_region_of_interest_stays_until_a_cloud_of_another_size_comes(self):
        assert self.state.region_of_interest == self.region


TestPageOfANode = PageOfANode.TestCase
TestPageOfANode.settings = hypothesis_settings(max_examples=40, stateful_step_count=30, deadline=None)
