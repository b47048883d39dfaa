# SPDX-License-Identifier: Apache-2.0
"""Teaching on the page: clouds are called good, and the node gets the lesson."""

import pytest
from good_parts import part, pitted

from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.point_cloud import encode_point_cloud
from socialcircle_ros.panel.state import MOST_GOOD, State
from socialcircle_ros.settings.lessons import read_lesson

for library in ('matplotlib', 'jinja2'):
    pytest.importorskip(library)


def publish(tuning, heights):
    points = part(heights).points
    tuning.link.publish(encode_point_cloud(Header.at(1_000_000_000, 'camera'), points))
    assert tuning.visitor.sees(f'{points[..., 2].size:,}')


def test_a_visitor_calls_clouds_good_and_teaches_the_node(tuning):
    visitor, link = tuning.visitor, tuning.link
    visitor.open_tab('Teach')
    visitor.press('This is good')
    assert visitor.sees('There is no cloud to call good yet.')
    publish(tuning, pitted())
    visitor.press('This is good')
    assert visitor.sees('Called good: 1')
    visitor.press('This is good')  # the same cloud
    publish(tuning, pitted(seed=5))
    visitor.press('This is good')
    assert visitor.sees('Called good: 2')
    visitor.field('lesson name').fill('../out')
    visitor.press('Teach')
    assert visitor.sees("'../out' cannot be the name of a preset")
    for name in ('lid', 'lid-2'):  # a lesson that a node has read is not replaced
        visitor.field('lesson name').fill('lid')
        visitor.press('Teach')
        path = tuning.presets.folder / f'{name}.teach'
        assert visitor.sees(f'Saved as {path}. The node uses it.')
        assert link.snapshot.values['circle.lesson'] == str(path)
        assert link.snapshot.values['circle.mode'] == 'adaptive'
        assert len(read_lesson(str(path)).taught_on) == 2
    with visitor.page.expect_download() as download:
        visitor.press('Save the page of the check')
    assert download.value.suggested_filename == 'lid-2.html'
    assert b'The lesson helps on the fields kept back.' in download.value.path().read_bytes()
    visitor.press('Forget these clouds')
    assert visitor.no_longer_sees('Called good')


def test_the_reason_is_shown_where_a_lesson_helps_nothing(tuning):
    visitor = tuning.visitor
    visitor.open_tab('Teach')
    publish(tuning, pitted(60, 70))
    visitor.press('This is good')
    assert visitor.sees('Called good: 1')
    visitor.press('Teach')
    assert visitor.sees('give larger clouds, or more of them.')
    assert not list(tuning.presets.folder.glob('*.teach'))
    assert tuning.link.snapshot.values['circle.lesson'] == ''


def test_the_newest_clouds_stay_called_good():
    state, cloud = State(), part(pitted(60, 70))
    for number in range(MOST_GOOD + 3):
        state = state.calling_good(b'%d' % number, cloud)
    assert list(state.good) == [b'%d' % number for number in range(3, MOST_GOOD + 3)]
    assert not state.forgetting_good().good
