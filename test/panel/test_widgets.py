# SPDX-License-Identifier: Apache-2.0
"""Widgets: values as text and as places on a slider."""

import dataclasses
import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st
from panel.fake import descriptors

from socialcircle_ros.errors import SettingError
from socialcircle_ros.panel.link import Descriptor, ParameterKind
from socialcircle_ros.panel.widgets import _SliderScale, _whole_marks, hint_of, text_of, value_of

ROWS = {kind: Descriptor('some.name', kind, 'A sentence.') for kind in ParameterKind}


INTEGERS = st.integers(-(2**63), 2**63 - 1)


@given(value=st.one_of(st.floats(allow_nan=False), INTEGERS, st.lists(INTEGERS, min_size=1)))
def test_a_shown_value_can_be_typed(value):
    kind = {float: ParameterKind.REAL, int: ParameterKind.INTEGER, list: ParameterKind.INTEGERS}[type(value)]
    typed = value_of(text_of(value), ROWS[kind])
    assert typed == value
    assert type(typed) is type(value)


@pytest.mark.parametrize(
    ('kind', 'text', 'value'),
    [
        (ParameterKind.REAL, '1e-6', 1e-6),
        (ParameterKind.REAL, ' 2 ', 2.0),
        (ParameterKind.REAL, '1,25e-6', 1.25e-6),
        (ParameterKind.INTEGER, '-3', -3),
        (ParameterKind.INTEGERS, '[1, 2, 3, 4]', [1, 2, 3, 4]),
        (ParameterKind.INTEGERS, '1,2', [1, 2]),
    ],
)
def test_numbers_may_be_written_in_several_ways(kind, text, value):
    assert value_of(text, ROWS[kind]) == value


@pytest.mark.parametrize(
    ('kind', 'text', 'wanted'),
    [
        (ParameterKind.REAL, 'wide', 'a number'),
        (ParameterKind.REAL, '', 'a number'),
        (ParameterKind.INTEGER, '3.5', 'a whole number'),
        (ParameterKind.INTEGERS, '1, x', 'whole numbers'),
        (ParameterKind.INTEGERS, '1, 2.5', 'whole numbers'),
        (ParameterKind.INTEGERS, '1: [', 'whole numbers'),
        (ParameterKind.INTEGERS, '1, true', 'whole numbers'),
    ],
)
def test_a_text_that_is_no_number_is_refused(kind, text, wanted):
    with pytest.raises(SettingError, match=re.escape(f'some.name must be {wanted}, not {text!r}.')):
        value_of(text, ROWS[kind])


@pytest.mark.parametrize('text', ['1' * 20, '-9223372036854775809'])
@pytest.mark.parametrize('kind', [ParameterKind.INTEGER, ParameterKind.INTEGERS])
def test_a_whole_number_that_ros_cannot_hold_is_refused(kind, text):
    with pytest.raises(SettingError, match='at most 64 bits'):
        value_of(text, ROWS[kind])


@pytest.mark.parametrize('kind', [ParameterKind.REAL, ParameterKind.INTEGER, ParameterKind.INTEGERS])
@pytest.mark.parametrize('text', ['{' * 5000, '1' * 5000 + 'x', '*a', '&a [*a]'])
def test_a_text_that_is_made_to_break_the_page_is_refused(kind, text):
    with pytest.raises(SettingError, match='some.name must be'):
        value_of(text, ROWS[kind])


@given(place=st.floats(0, 1), low=st.floats(-5, 5), width=st.floats(1e-3, 1e6))
def test_a_place_on_a_slider_has_the_value_that_has_this_place(place, low, width):
    scale = _SliderScale(low, low + width)
    first, last = scale.place(scale.low), scale.place(scale.high)
    value = scale.value(first + place * (last - first))
    assert scale.low <= value <= scale.high
    assert scale.place(value) == pytest.approx(first + place * (last - first), abs=0.01 * (abs(first) + abs(last)))


def test_a_wide_range_has_marks_at_powers_of_ten_and_a_narrow_one_at_its_ends():
    assert _SliderScale(0.01, 100.0).marks() == ((-2, '0.01'), (-1, '0.1'), (0, '1'), (1, '10'), (2, '100'))
    assert [label for _, label in _SliderScale(1.0, 1e5).marks()] == ['1', '', '100', '', '10000', '']
    assert _SliderScale(0.0, 1.0).marks() == ((0.0, '0'), (1.0, '1'))


@given(low=st.integers(-9, 9), steps=st.integers(1, 200), step=st.integers(1, 3))
def test_the_marks_of_whole_numbers_are_values_that_can_be_chosen(low, steps, step):
    marks = [place for place, _ in _whole_marks(low, low + steps * step, step)]
    assert (marks[0], marks[-1]) == (low, low + steps * step)
    assert all((mark - low) % step == 0 for mark in marks)
    assert len(marks) <= 5


def test_a_value_that_is_chosen_by_the_filter_is_called_as_in_reports():
    depth = dataclasses.replace(ROWS[ParameterKind.REAL], name='circle.depth_of_field')
    assert text_of(0.0, depth.name) == 'automatic'
    assert text_of([0, 0, 0, 0], 'circle.vote_region') == 'automatic'
    assert text_of(0.0, 'limits.sq_max') == 'none'
    assert text_of(0.0, 'circle.radius_scale') == '0.0'
    assert value_of('automatic', depth) == value_of('0', depth) == 0.0


def test_the_help_of_a_parameter_is_one_sentence():
    for row in descriptors():
        hint = hint_of(row)
        assert hint.endswith('.')
        assert len(re.findall(r'\.(?= [A-Z])', hint)) == 0, hint
    hints = {row.name: hint_of(row) for row in descriptors()}
    assert hints['circle.window'] == 'Side of the search window (odd, 3 to 31).'
    assert hints['circle.mode'] == 'Method: paper or adaptive.'


def test_only_real_numbers_in_a_range_and_without_a_unit_have_a_slider():
    real = Descriptor('some.name', ParameterKind.REAL, 'A sentence.', low=0.0, high=1.0)
    assert _SliderScale.of(real) == _SliderScale(0.0, 1.0)
    for other in (
        {'unit': 'µm'},
        {'low': None},
        {'high': 0.0},
        {'high': math.inf},
        {'kind': ParameterKind.INTEGER},
    ):
        assert _SliderScale.of(dataclasses.replace(real, **other)) is None
