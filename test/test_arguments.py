# SPDX-License-Identifier: Apache-2.0
"""What callers hand over."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.arguments import several
from socialcircle_ros.errors import SettingError

names = st.text() | st.text(st.characters(exclude_categories=['Cs', 'Cc'])).map(Path)


@given(names)
def test_a_single_name_is_a_list_of_one(name):
    assert several(name) == (name,) == several([name])


@given(st.lists(names))
def test_several_names_stay_as_they_are(given_names):
    assert several(given_names) == several(iter(given_names)) == tuple(given_names)


def test_nothing_is_no_name():
    assert several(None) == several(()) == ()


def test_what_is_no_name_is_refused():
    with pytest.raises(SettingError, match='A name or several names must be given, not 5'):
        several(5)
