# SPDX-License-Identifier: Apache-2.0
"""Lesson files."""

import json
import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.errors import SettingError
from socialcircle_ros.settings.lessons import TRAITS, WEIGHTS, Lesson, read_lesson

NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


def numbers(count, least=None):
    return st.lists(st.floats(least, 1e300) if least else NUMBERS, min_size=count, max_size=count).map(tuple)


LESSONS = st.builds(
    Lesson,
    taught_on=st.lists(st.text(st.characters(exclude_categories=['Cs']), max_size=9), max_size=3).map(tuple),
    spread=st.tuples(st.floats(0, 1), st.floats(1, 9)),
    judge=st.sampled_from(['network', 'rules']),
    least=st.floats(-1, 1),
    mean=numbers(len(TRAITS)),
    scale=numbers(len(TRAITS), 1e-300),
    weights=numbers(WEIGHTS),
    threshold=st.floats(0.01, 0.99),
    check=st.dictionaries(st.sampled_from(['f1_before', 'f1_after']), st.floats(0, 1)),
)
_NUMBERS = (0.0,) * len(TRAITS), (1.0,) * len(TRAITS), (0.0,) * WEIGHTS
PLAIN = Lesson(('a',), (1.0, 2.0), 'network', 0.2, *_NUMBERS, 0.5, {})


@given(LESSONS)
def test_a_lesson_comes_back_as_it_was_written(lesson):
    assert Lesson.from_text(lesson.to_text()) == lesson


@pytest.mark.parametrize(
    ('change', 'reason'),
    [
        ({'socialcircle_lesson': 1}, 'not a lesson of this version'),
        ({'weights': [0.0]}, f'its weights are not {WEIGHTS} numbers'),
        ({'mean': [float('nan')] * len(TRAITS)}, 'finite'),
        ({'mean': ['a'] * len(TRAITS)}, 'finite'),
        ({'scale': [0.0] * len(TRAITS)}, 'not above 0'),
        ({'spread': [2.0, 1.0]}, 'not above 0'),
        ({'spread': None}, 'its spread are not 2 numbers'),
        ({'judge': 'table'}, 'rules or the network'),
        ({'judge': ['rules']}, 'rules or the network'),
        ({'least': None}, 'finite'),
        ({'threshold': None}, 'finite'),
        ({'threshold': 1.0}, 'between 0 and 1'),
        ({'taught_on': 'a'}, 'taught on'),
        ({'check': None}, 'taught on'),
        ({'check': {'f1_before': 'much'}}, 'finite'),
        ({'check': {'f1_before': None}}, 'finite'),
    ],
)
def test_what_is_no_lesson_is_refused_with_the_reason(tmp_path, change, reason):
    path = tmp_path / 'part.teach'
    path.write_text(json.dumps(json.loads(PLAIN.to_text()) | change))
    with pytest.raises(SettingError, match=reason) as refusal:
        read_lesson(str(path))
    assert 'socialcircle teach' in str(refusal.value)


@pytest.mark.parametrize('content', [b'', b'{', b'[1]', b'\xff\xfe', b'"' * 5, b'[' * 100_000, b' ' * 1_000_001])
def test_other_files_are_refused(tmp_path, content):
    path = tmp_path / 'other'
    path.write_bytes(content)
    with pytest.raises(SettingError, match='other cannot be used'):
        read_lesson(str(path))
    with pytest.raises(SettingError, match='cannot be used'):
        read_lesson(str(tmp_path))


@pytest.mark.parametrize('make', [os.mkfifo, lambda path: path.symlink_to('/dev/zero')])
def test_what_is_not_a_file_is_refused_at_once(tmp_path, make):
    path = tmp_path / 'other'
    make(path)
    with pytest.raises(SettingError, match=r'other cannot be used \(it is not a file\)'):
        read_lesson(str(path))


def test_a_file_that_has_not_changed_is_not_read_again(tmp_path):
    path = tmp_path / 'part.teach'
    path.write_text(PLAIN.to_text())
    first = read_lesson(str(path))
    assert read_lesson(str(path)) is first
    path.write_text(PLAIN.to_text().replace('"a"', '"b"'))
    os.utime(path, ns=(1, 1))
    assert read_lesson(str(path)).taught_on == ('b',)
