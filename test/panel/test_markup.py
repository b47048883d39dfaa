# SPDX-License-Identifier: Apache-2.0
"""The texts and tables of the page."""

import numpy as np
import pytest
from examples import cloud

from socialcircle_ros.interface import MeasurementValues
from socialcircle_ros.messages.diagnostics import OK, WARN, Status
from socialcircle_ros.panel import markup
from socialcircle_ros.panel.link import LogEntry, ShownCloud

VALUES = {
    **MeasurementValues('1.000000000', 5600, 5594, 5568, 26, 0, 39, 50, 2.25).to_text(),
    'time_vote_ms': '8.000', 'time_mask_ms': '2.000', 'time_late_ms': 'x', 'time_total_ms': '11.000',
}  # fmt: skip


def shown(values, level=OK):
    status = Status(level, 'name', 'The seed is doubtful.', 'microscope', values)
    return ShownCloud(1, cloud(), np.zeros((1, 1), np.uint8), status)


def test_the_counts_and_their_share_are_shown():
    html = markup.measurement(shown(VALUES))
    for text in ('5,568', '26', '0.46 %'):
        assert f'<b>{text}</b>' in html
    assert 'doubtful' not in html


def test_a_warning_of_the_node_is_shown_with_the_counts():
    assert 'The seed is doubtful.' in markup.measurement(shown(VALUES, WARN))


def test_the_stage_times_are_shown_in_their_order_with_the_total_last():
    html = markup.details(shown(VALUES))
    assert html.index('vote') < html.index('mask') < html.index('total')
    assert 'late' not in html
    assert 'width:25.0%' in html
    assert '11.0 ms' in html
    assert '39, 50' in html


@pytest.mark.parametrize(
    ('unit', 'text'), [('m', '149 nm'), ('um', '0.149 pm'), (None, '1.49 × 10⁻⁷ (unit not known)')]
)
def test_the_radius_has_the_unit_of_the_cloud(unit, text):
    assert f'>{text}<' in markup.details(shown(VALUES | {'radius': '1.49e-07'}), unit)


@pytest.mark.parametrize('values', [{}, VALUES | {'measured': 'all'}])
def test_a_measurement_that_cannot_be_read_gives_no_numbers_but_says_so(values):
    assert 'cannot be read' in markup.measurement(shown(values))
    assert markup.details(shown(values)) == ''


def test_before_the_first_measurement_there_are_no_numbers():
    assert 'No measurement yet.' in markup.measurement(None)
    assert markup.details(None) == ''


def test_text_from_outside_is_escaped():
    for html in (markup.note('<b>'), markup.refusal('<b>'), markup.log([LogEntry(0.0, '<b>')])):
        assert '&lt;b&gt;' in html


def test_text_from_outside_can_be_sent_to_every_browser():
    html = markup.note('\udcff' + 'long ' * 100_000)
    assert html.encode().startswith(b'<div class="sc "><div class="sc-card sc-idle">\\udcfflong')
    assert len(html) < 3000
