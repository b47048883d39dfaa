"""Values as text: what is typed is what is set, or refused."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.errors import SettingError
from socialcircle_ros.panel.link import Descriptor, ParameterKind
from socialcircle_ros.panel.widgets import text_of, value_of

ROWS = {kind: Descriptor('some.name', kind, 'A sentence.') for kind in ParameterKind}


@given(value=st.one_of(st.floats(allow_nan=False), st.integers(), st.lists(st.integers(), min_size=1)))
def test_what_is_shown_can_be_typed(value):
    kind = {float: ParameterKind.REAL, int: ParameterKind.INTEGER, list: ParameterKind.INTEGERS}[type(value)]
    typed = value_of(text_of(value), ROWS[kind])
    assert typed == value
    assert type(typed) is type(value)


@pytest.mark.parametrize(
    ('kind', 'text', 'value'),
    [
        (ParameterKind.REAL, '1e-6', 1e-6),
        (ParameterKind.REAL, ' 2 ', 2.0),
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
def test_what_is_no_number_is_told(kind, text, wanted):
    with pytest.raises(SettingError, match=re.escape(f'some.name must be {wanted}, not {text!r}.')):
        value_of(text, ROWS[kind])
