"""Values as text: what is typed is what is set, or refused."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.errors import SettingError
from socialcircle_ros.panel.controls import text_of, value_of
from socialcircle_ros.panel.link import Descriptor, Kind

ROWS = {kind: Descriptor('some.name', kind, 'A sentence.') for kind in Kind}


@given(value=st.one_of(st.floats(allow_nan=False), st.integers(), st.lists(st.integers(), min_size=1)))
def test_what_is_shown_can_be_typed(value):
    kind = {float: Kind.REAL, int: Kind.WHOLE, list: Kind.WHOLES}[type(value)]
    typed = value_of(text_of(value), ROWS[kind])
    assert typed == value
    assert type(typed) is type(value)


@pytest.mark.parametrize(
    ('kind', 'text', 'value'),
    [
        (Kind.REAL, '1e-6', 1e-6),
        (Kind.REAL, ' 2 ', 2.0),
        (Kind.WHOLE, '-3', -3),
        (Kind.WHOLES, '[1, 2, 3, 4]', [1, 2, 3, 4]),
        (Kind.WHOLES, '1,2', [1, 2]),
    ],
)
def test_numbers_may_be_written_in_several_ways(kind, text, value):
    assert value_of(text, ROWS[kind]) == value


@pytest.mark.parametrize(
    ('kind', 'text', 'wanted'),
    [
        (Kind.REAL, 'wide', 'a number'),
        (Kind.REAL, '', 'a number'),
        (Kind.WHOLE, '3.5', 'a whole number'),
        (Kind.WHOLES, '1, x', 'whole numbers'),
        (Kind.WHOLES, '1, 2.5', 'whole numbers'),
        (Kind.WHOLES, '1: [', 'whole numbers'),
        (Kind.WHOLES, '1, true', 'whole numbers'),
    ],
)
def test_what_is_no_number_is_told(kind, text, wanted):
    with pytest.raises(SettingError, match=re.escape(f'some.name must be {wanted}, not {text!r}.')):
        value_of(text, ROWS[kind])
