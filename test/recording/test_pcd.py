# SPDX-License-Identifier: Apache-2.0
"""PCD files, as PCL, CloudCompare and Open3D write them."""

import struct
import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recording.point_samples import POINTS, RECORD, lines, pcd, pcd_header

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.recording.compression import LIMIT_VARIABLE
from socialcircle_ros.recording.pcd import _lzf, read_pcd

ENCODINGS = ('ascii', 'binary', 'binary_compressed')


def read(tmp_path, content):
    path = tmp_path / 'cloud.pcd'
    path.write_bytes(content)
    return read_pcd(path)


def test_a_pcd_of_one_row_is_not_organized(tmp_path):
    assert read(tmp_path, pcd_header('ascii', 1, 12) + lines(POINTS)).shape is None


def test_padding_in_a_pcd_is_skipped_and_counts_become_columns(tmp_path):
    header = (
        b'FIELDS x _ y z normal _\nSIZE 4 1 4 4 4 1\nTYPE F U F F F U\nCOUNT 1 4 1 1 3 2\n'
        b'WIDTH 1\nHEIGHT 2\nPOINTS 2\nDATA binary\n'
    )
    record = np.dtype([('x', 'f4'), ('p', 'V4'), ('y', 'f4'), ('z', 'f4'), ('normal', 'f4', 3), ('q', 'V2')])
    points = np.zeros(2, record)
    points['normal'] = [[1, 2, 3], [4, 5, 6]]
    table = read(tmp_path, header + points.tobytes())
    assert list(table.columns) == ['x', 'y', 'z', 'normal']
    np.testing.assert_array_equal(table.columns['normal'], points['normal'])


@pytest.mark.parametrize(
    ('old', 'new', 'sentence'),
    [
        (b'WIDTH 4', b'WIDTH 5', r'a header with 12 points, but 3 rows × 5 columns'),
        (b'WIDTH 4', b'WIDTH four', r'invalid PCD header'),
        (b'SIZE 4 4 4 2', b'SIZE 4 4 4', r'invalid PCD header'),
        (b'TYPE F F F U', b'TYPE F F F X', r'invalid PCD header'),
        (b'y z', b'x z', r'has the coordinate x twice'),
        (b'COUNT 1 1 1 1', b'COUNT 1 1 1 -1', r'invalid PCD header'),
        (b'COUNT 1 1 1 1', b'COUNT 1 1 1 99999999999', r'invalid PCD header'),
        (b'SIZE 4 4 4 2', b'SIZE 16 4 4 2', r'invalid PCD header'),
        (b'WIDTH 4', b'WIDTH 0', r'12 points, but 3 rows × 0 columns'),
        (b'DATA ascii', b'DATA zip', r"unknown type 'zip'"),
        (b'1.0', b'one', r'has a line without 4 numbers'),
        (b'1.0', b'', r'has a line without 4 numbers|should have'),
    ],
)
def test_a_pcd_that_contradicts_itself_is_refused(tmp_path, old, new, sentence):
    content = pcd('ascii')
    assert old in content
    with pytest.raises(ImportFileError, match=sentence):
        read(tmp_path, content.replace(old, new, 1))


def test_damaged_compressed_data_are_refused(tmp_path):
    content = pcd('binary_compressed')
    start = len(pcd_header('binary_compressed'))
    damaged = content[: start + 8] + b'\xff' + content[start + 9 :]
    with pytest.raises(ImportFileError, match='damaged compressed data'):
        read(tmp_path, damaged)


def test_columns_is_another_word_for_fields_as_in_the_first_files_of_pcl(tmp_path):
    content = pcd('ascii').replace(b'FIELDS', b'COLUMNS').replace(b'COUNT 1 1 1 1\n', b'')
    assert list(read(tmp_path, content).columns) == list(RECORD.names)


def test_a_header_may_leave_out_what_follows_from_the_rest(tmp_path):
    for left_out in (b'POINTS 12\n', b'WIDTH 12\n', b'HEIGHT 1\n'):
        content = pcd_header('ascii', 1, 12).replace(left_out, b'') + lines(POINTS)
        assert len(read(tmp_path, content).columns['x']) == 12


def test_a_field_that_is_there_twice_has_two_names(tmp_path):
    content = pcd('ascii').replace(b'FIELDS x y z intensity', b'FIELDS z_2 x y z')
    assert list(read(tmp_path, content).columns) == ['z_2', 'x', 'y', 'z']
    header = pcd_header('binary').replace(b'z intensity', b'z a a a_2')
    header = (
        header.replace(b'SIZE 4 4 4 2', b'SIZE 4 4 4 1 1 1')
        .replace(b'F U', b'F U U U')
        .replace(b'1 1 1 1', b'1 ' * 6)
    )
    record = np.dtype([('x', 'f4'), ('y', 'f4'), ('z', 'f4'), ('a', 'u1'), ('b', 'u1'), ('c', 'u1')])
    points = np.zeros(12, record)
    points['a'], points['b'], points['c'] = 1, 2, 3
    table = read(tmp_path, header + points.tobytes())
    assert {name: values[0] for name, values in table.columns.items() if 'a' in name} == {
        'a': 1,
        'a_3': 2,
        'a_2': 3,
    }
    assert table.notes == ['the field a is there again, and becomes a_3']


def test_a_field_whose_name_begins_with_the_name_of_padding_is_kept(tmp_path):
    content = pcd('binary').replace(b'z intensity', b'z _intensity')
    assert list(read(tmp_path, content).columns) == ['x', 'y', 'z', '_intensity']


@pytest.mark.parametrize('encoding', ENCODINGS)
@pytest.mark.parametrize('kind', ['u8', 'i8'])
def test_64_bit_numbers_keep_every_digit(tmp_path, encoding, kind):
    values = 1726578368464684544 + np.arange(12, dtype=kind)
    header = (
        f'FIELDS x t\nSIZE 4 8\nTYPE F {kind[0].upper()}\nCOUNT 1 1\nWIDTH 4\nHEIGHT 3\nPOINTS 12\n'
        f'DATA {encoding}\n'
    ).encode()
    x = np.arange(12, dtype='f4')
    points = np.rec.fromarrays([x, values], dtype=[('x', 'f4'), ('t', kind)])
    if encoding == 'ascii':
        body = ''.join(f'{one} {other}\n' for one, other in zip(x, values, strict=True)).encode()
    elif encoding == 'binary':
        body = points.tobytes()
    else:
        columns = x.tobytes() + values.tobytes()
        packed = b''.join(
            bytes([len(columns[i : i + 32]) - 1]) + columns[i : i + 32] for i in range(0, len(columns), 32)
        )
        body = struct.pack('<II', len(packed), len(columns)) + packed
    found = read(tmp_path, header + body).columns['t']
    assert found.dtype == kind
    np.testing.assert_array_equal(found, values)


def test_compressed_data_above_the_limit_are_not_expanded(tmp_path, monkeypatch):
    monkeypatch.setenv(LIMIT_VARIABLE, '0.0001')
    with pytest.raises(ImportFileError, match=r'is not read, because it expands to 0 MB, above the limit'):
        read(tmp_path, pcd('binary_compressed'))


def test_a_small_file_that_states_much_allocates_nothing(tmp_path):
    points = 2**30
    header = pcd_header('binary_compressed', 1, points).replace(b'POINTS 12', f'POINTS {points}'.encode())
    header = header.replace(b'SIZE 4 4 4 2', b'SIZE 1 1 1 1').replace(b'TYPE F F F U', b'TYPE U U U U')
    header = header.replace(b'COUNT 1 1 1 1', b'COUNT 1 1 1 0')
    tracemalloc.start()
    with pytest.raises(ImportFileError, match='damaged compressed data'):
        read(tmp_path, header + struct.pack('<II', 100, 3 * points) + bytes(100))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1e6


def test_source_and_target_of_an_lzf_copy_may_overlap():
    packed = np.frombuffer(bytes([0, 7, 0b11100000, 3, 0]), np.uint8)  # a 7, then 12 copies of it
    out = np.empty(13, np.uint8)
    assert _lzf(packed, out) == 13
    assert (out == 7).all()


@given(packed=st.binary(max_size=80))
def test_lzf_stays_inside_its_buffers(packed):
    out = np.zeros(64, np.uint8)
    assert -1 <= _lzf(np.frombuffer(packed, np.uint8), out) <= 64
