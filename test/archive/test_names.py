# SPDX-License-Identifier: Apache-2.0
"""Cell and part from a pattern on the name."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.archive import NamePattern
from socialcircle_ros.errors import SettingError

WORDS = st.text(st.sampled_from('ab1.+ü ('), min_size=1).filter(lambda text: text != '.')


@pytest.mark.parametrize(
    ('pattern', 'path', 'found'),
    [
        ('{cell}/{part}_*.mcap', 'a/nights/cell1/lid_007.mcap', ('cell1', 'lid')),
        ('{cell}/{part}_*.mcap', 'cell1/lid_007.mcap', ('cell1', 'lid')),
        ('{cell}/{part}_*.mcap', 's3://bucket/cell1/lid_7.mcap', ('cell1', 'lid')),
        ('{cell}/{part}_*.mcap', 'cell1/lid.mcap', (None, None)),
        ('{cell}/*', '/x/cell 2/a.mcap', ('cell 2', None)),
        ('{part}.mcap', '/x/a+b.mcap', (None, 'a+b')),
        ('', '/x/a.mcap', (None, None)),
    ],
)
def test_the_end_of_a_path_matches(pattern, path, found):
    assert NamePattern(pattern).read(path) == found


@given(WORDS, WORDS, WORDS)
def test_any_name_is_found(folder, cell, part):
    assert NamePattern('{cell}/{part}_*.mcap').read(f'{folder}/{cell}/{part}_1.mcap') == (cell, part)


@pytest.mark.parametrize('pattern', ['*.mcap', '{cell}/{cell}_*.mcap'])
def test_a_pattern_without_a_field_or_with_one_twice_is_refused(pattern):
    with pytest.raises(SettingError, match='must have {cell} or {part} once'):
        NamePattern(pattern)


@pytest.mark.parametrize('pattern', [5, None, 0, b'{cell}'])
def test_what_is_no_text_is_refused(pattern):
    with pytest.raises(SettingError, match='must be a text, not'):
        NamePattern(pattern)
