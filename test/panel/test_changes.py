# SPDX-License-Identifier: Apache-2.0
"""Changes: rapid changes are merged, each change can be undone, refusals change nothing."""

import pytest
from panel.fake import FakeLink

from socialcircle_ros.errors import SettingError
from socialcircle_ros.panel.changes import Changes

SCALE = 'circle.radius_scale'


class Desk:
    def __init__(self):
        self.link = FakeLink()
        self.refusals, self.acceptances = [], []
        self.changes = Changes(
            self.link,
            lambda names, reason: self.refusals.append((names, reason)),
            self.acceptances.append,
        )


@pytest.fixture
def desk():
    desk = Desk()
    yield desk
    desk.changes.stop()


def test_only_the_newest_of_rapid_values_is_sent(desk):
    for value in (1.5, 2.5, 3.5):
        desk.changes.ask(SCALE, value, 0.2)
    assert desk.changes.settling(SCALE)
    desk.link.wait_for(lambda values: values[SCALE] == 3.5)
    assert desk.link.asked == [{SCALE: 3.5}]


def test_parameters_do_not_wait_for_each_other(desk):
    desk.changes.ask(SCALE, 9.0, 3600)
    desk.changes.ask('circle.window', 5, 0)
    desk.link.wait_for(lambda values: values['circle.window'] == 5)
    assert desk.link.snapshot.values[SCALE] == 1.0
    assert not desk.changes.settling('circle.radius')


def test_a_gesture_and_a_preset_are_each_undone_in_one_step(desk):
    desk.changes.apply({SCALE: 2.0}, gesture=True)
    desk.changes.apply({SCALE: 3.0}, gesture=True)
    desk.changes.apply({SCALE: 4.0, 'circle.window': 5})
    assert desk.changes.undoable == 2
    assert desk.changes.undo() == ({SCALE: 3.0, 'circle.window': 3}, '')
    assert desk.changes.undo() == ({SCALE: 1.0}, '')
    assert desk.link.snapshot.values[SCALE] == 1.0
    assert desk.changes.undo() == ({}, 'There is no change of this page to undo.')


def test_a_refusal_is_reported_with_its_reason_and_leaves_nothing_to_undo(desk):
    reason = desk.changes.apply({'circle.window': 4})
    assert 'must be odd' in reason
    assert desk.refusals == [(('circle.window',), reason)]
    assert desk.changes.undoable == 0


def test_a_value_that_is_already_current_is_not_sent(desk):
    assert desk.changes.apply({SCALE: 1.0}) == ''
    assert desk.link.asked == []
    assert desk.acceptances == []


def test_a_change_stays_undoable_if_its_undo_is_refused(desk):
    desk.changes.apply({SCALE: 2.0})
    desk.link.change = lambda values: 'The node is away.'
    assert desk.changes.undo() == ({SCALE: 1.0}, 'The node is away.')
    assert desk.changes.undoable == 1


def test_an_invalid_text_is_refused_only_if_it_is_not_replaced_in_time(desk):
    desk.changes.ask(SCALE, SettingError('1e is no number.'), 0.2)
    desk.changes.ask(SCALE, 1e-1, 0.2)
    desk.link.wait_for(lambda values: values[SCALE] == 1e-1)
    assert desk.refusals == []
    desk.changes.ask('circle.window', SettingError('3. is no whole number.'), 0)
    desk.changes.ask(SCALE, 2.0, 0.1)
    desk.link.wait_for(lambda values: values[SCALE] == 2.0)
    assert desk.refusals == [(('circle.window',), '3. is no whole number.')]
