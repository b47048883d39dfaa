# SPDX-License-Identifier: Apache-2.0
"""Files of points in every encoding become the same columns, and text becomes numbers without loss."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from recording.point_samples import COLUMNS, POINTS, RECORD, ROWS, pcd, ply

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.recording.pcd import read_pcd
from socialcircle_ros.recording.ply import read_ply
from socialcircle_ros.recording.point_table import ascii_columns, unique_names

PATH = Path('cloud.pcd')
READERS = {'pcd': read_pcd, 'ply': read_ply}
SAMPLES = {
    **{('pcd', encoding): pcd(encoding) for encoding in ('ascii', 'binary', 'binary_compressed')},
    **{('ply', encoding): ply(encoding) for encoding in ('ascii', 'binary_little_endian', 'binary_big_endian')},
}
every_encoding = pytest.mark.parametrize('sample', SAMPLES, ids='-'.join)
# As the C libraries of GNU, Microsoft (old and new), IBM and others print them, also with few digits.
NANS = """
nan -nan NaN NAN +nan nan(ind) -nan(ind) nan(snan) -nan(snan) NaN(0x7ff8) 1.#QNAN -1.#QNAN 1.#SNAN 1.#IND -1.#IND
1.#QNAN0 -1.#IND00 1.#QO 1.#R -1.#J NaNQ NANS -NaNQ qnan
""".split()  # noqa: SIM905 - too many to quote
INFINITIES = ['inf', '-inf', 'Infinity', '-Infinity', 'INF', '1.#INF', '-1.#INF', '1.#INF00']


def read(folder, suffix, content):
    path = folder / f'cloud.{suffix}'
    path.write_bytes(content)
    return READERS[suffix](path)


@every_encoding
def test_every_encoding_gives_the_same_columns(tmp_path, sample):
    table = read(tmp_path, sample[0], SAMPLES[sample])
    assert table.shape == (ROWS, COLUMNS)
    assert list(table.columns) == list(RECORD.names)
    for column in RECORD.names:
        np.testing.assert_array_equal(table.columns[column], POINTS[column])
    assert table.notes == []


@every_encoding
def test_a_file_cut_off_at_any_byte_is_refused(tmp_path, sample):
    content = SAMPLES[sample]
    # An ascii file is still valid without its last line break or its last digits.
    for length in range(len(content) - 5):
        with pytest.raises(ImportFileError, match=rf'cloud\.{sample[0]} '):
            read(tmp_path, sample[0], content[:length])


@pytest.mark.parametrize('suffix', READERS)
@given(content=st.binary(max_size=200))
def test_garbage_is_refused(content, suffix, tmp_path_factory):
    with pytest.raises(ImportFileError):
        read(tmp_path_factory.getbasetemp(), suffix, content)


@settings(max_examples=400)
@given(data=st.data(), sample=st.sampled_from(list(SAMPLES)))
def test_changed_bytes_give_columns_or_a_refusal(data, sample, tmp_path_factory):
    content = bytearray(SAMPLES[sample])
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    try:
        table = read(tmp_path_factory.getbasetemp(), sample[0], bytes(content))
    except ImportFileError:
        return
    assert len({len(values) for values in table.columns.values()}) == 1


@pytest.mark.parametrize('text', NANS)
def test_every_spelling_of_nan_is_read(text):
    one, other = ascii_columns(PATH, f'{text} 1\n2 {text}\n'.encode(), 2, ['f4', 'f8'])
    np.testing.assert_array_equal(one, [np.nan, 2])
    np.testing.assert_array_equal(other, [1, np.nan])


@pytest.mark.parametrize('text', INFINITIES)
def test_every_spelling_of_infinity_is_read(text):
    (column,) = ascii_columns(PATH, f'{text}\n1\n'.encode(), 2, ['f4'])
    np.testing.assert_array_equal(column, [-np.inf if text.startswith('-') else np.inf, 1])


kinds = st.sampled_from(['i1', 'u1', 'i2', 'u2', 'i4', 'u4', 'i8', 'u8', 'f4', 'f8'])


@given(columns=st.lists(kinds.flatmap(lambda kind: arrays.arrays(kind, 4)), min_size=1, max_size=4))
def test_columns_of_any_type_are_read_exactly(columns):
    text = '\n'.join(' '.join(repr(value.item()) for value in row) for row in zip(*columns, strict=True)).encode()
    found = ascii_columns(PATH, text, 4, [column.dtype.str[1:] for column in columns])
    for one, other in zip(found, columns, strict=True):
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(
    ('kind', 'text'), [('u1', '300'), ('u1', '-1'), ('i4', '1.5'), ('u2', 'nan'), ('f4', '1e39'), ('u8', '1.5')]
)
def test_a_value_that_its_type_does_not_hold_is_not_changed(kind, text):
    (column,) = ascii_columns(PATH, f'{text}\n1\n'.encode(), 2, [kind])
    np.testing.assert_array_equal(column, [float(text), 1])


@pytest.mark.parametrize('text', ['one', '1,5', '0x10', '1_0', 'None', '#', '1.#', '(1)', 'nan()x', '', '1 2'])
def test_what_is_no_number_is_refused(text):
    with pytest.raises(ImportFileError, match=r'cloud\.pcd (has a line|should have|is cut off)'):
        ascii_columns(PATH, f'{text}\n'.encode(), 1, ['f8'])


@given(text=st.binary(max_size=80))
def test_garbage_is_read_or_refused(text):
    try:
        columns = ascii_columns(PATH, text, 2, ['f8', 'i8'])
    except ImportFileError:
        return
    assert [len(column) for column in columns] == [2, 2]


@given(names=st.lists(st.sampled_from(['a', 'a_2', 'a_3', 'b', 'z_2']), max_size=8))
def test_names_become_unique_and_only_repeated_ones_change(names):
    notes = []
    unique = unique_names(PATH, names, notes)
    assert len(set(unique)) == len(names)
    assert len(notes) == sum(one != other for one, other in zip(unique, names, strict=True))
    assert all(name in unique for name in names)
