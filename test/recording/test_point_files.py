import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.recording.point_files import _lzf, read_pcd, read_ply

ROWS, COLUMNS = 3, 4
RECORD = np.dtype([('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('intensity', '<u2')])
POINTS = np.zeros(ROWS * COLUMNS, RECORD)
for _place, _name in enumerate(RECORD.names):
    POINTS[_name] = np.arange(POINTS.size) + 100 * _place
POINTS['z'][5] = np.nan


def lines(points):
    return '\n'.join(' '.join(str(value) for value in point) for point in points.tolist()).encode() + b'\n'


def lzf_literals(data):
    return b''.join(bytes([len(data[i : i + 32]) - 1]) + data[i : i + 32] for i in range(0, len(data), 32))


def pcd_header(kind, height=ROWS, width=COLUMNS):
    return (
        '# .PCD v0.7\nVERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 2\nTYPE F F F U\nCOUNT 1 1 1 1\n'
        f'WIDTH {width}\nHEIGHT {height}\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {ROWS * COLUMNS}\nDATA {kind}\n'
    ).encode()


def pcd(kind):
    if kind == 'ascii':
        return pcd_header(kind) + lines(POINTS)
    if kind == 'binary':
        return pcd_header(kind) + POINTS.tobytes()
    columns = b''.join(POINTS[name].tobytes() for name in RECORD.names)
    packed = lzf_literals(columns)
    return pcd_header(kind) + struct.pack('<II', len(packed), len(columns)) + packed


def ply_header(kind, *, info=True, count=ROWS * COLUMNS, extra=''):
    size = f'obj_info num_cols {COLUMNS}\nobj_info num_rows {ROWS}\n' if info else ''
    return (
        f'ply\nformat {kind} 1.0\n{size}element vertex {count}\nproperty float x\nproperty float32 y\n'
        f'property float z\nproperty ushort intensity\n{extra}end_header\n'
    ).encode()


def ply(kind):
    if kind == 'ascii':
        return ply_header(kind) + lines(POINTS)
    order = '<' if kind == 'binary_little_endian' else '>'
    return ply_header(kind) + POINTS.astype(RECORD.newbyteorder(order)).tobytes()


FILES = {
    **{f'pcd {kind}': pcd(kind) for kind in ('ascii', 'binary', 'binary_compressed')},
    **{f'ply {kind}': ply(kind) for kind in ('ascii', 'binary_little_endian', 'binary_big_endian')},
}


def read(tmp_path, content, kind='pcd'):
    path = tmp_path / f'cloud.{kind}'
    path.write_bytes(content)
    return (read_pcd if kind == 'pcd' else read_ply)(path)


@pytest.mark.parametrize('name', FILES)
def test_every_encoding_gives_the_same_columns(tmp_path, name):
    table = read(tmp_path, FILES[name], name[:3])
    assert table.shape == (ROWS, COLUMNS)
    assert list(table.columns) == list(RECORD.names)
    for column in RECORD.names:
        np.testing.assert_array_equal(table.columns[column], POINTS[column])


@pytest.mark.parametrize('name', FILES)
def test_a_file_cut_off_at_any_byte_is_refused(tmp_path, name):
    content = FILES[name]
    # An ascii file is still valid without its last line break or its last digits.
    for length in range(len(content) - 5):
        with pytest.raises(ImportFileError, match=f'cloud.{name[:3]} '):
            read(tmp_path, content[:length], name[:3])


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
        (b'WIDTH 4', b'WIDTH 5', r'a header with 12 points, but 5 × 3 places'),
        (b'WIDTH 4', b'WIDTH four', r'invalid PCD header'),
        (b'SIZE 4 4 4 2', b'SIZE 4 4 4', r'invalid PCD header'),
        (b'TYPE F F F U', b'TYPE F F F X', r'invalid PCD header'),
        (b'y z', b'x z', r'invalid PCD header'),
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


@pytest.mark.parametrize('order', ['ascii', 'binary_little_endian', 'binary_big_endian'])
def test_a_range_grid_places_the_vertices(tmp_path, order):
    grid = [-1, 0, 1, -1, 2, 3, -1, -1, 4, 5, 6, -1]
    extra = 'element range_grid 12\nproperty list uchar int vertex_indices\n'
    header = ply_header(order, count=7, extra=extra)
    if order == 'ascii':
        body = lines(POINTS[:7]) + b''.join(b'0\n' if i < 0 else f'1 {i}\n'.encode() for i in grid)
    else:
        sign = '<' if order == 'binary_little_endian' else '>'
        body = POINTS[:7].astype(RECORD.newbyteorder(sign)).tobytes()
        body += b''.join(b'\0' if i < 0 else struct.pack(f'{sign}Bi', 1, i) for i in grid)
    table = read(tmp_path, header + body, 'ply')
    assert table.places.tolist() == grid
    for length in range(len(header), len(header + body) - 3, 5):
        with pytest.raises(ImportFileError):
            read(tmp_path, (header + body)[:length], 'ply')


def test_the_faces_of_a_ply_are_skipped(tmp_path):
    extra = 'element face 1\nproperty list uchar int vertex_indices\n'
    content = ply_header('ascii', extra=extra) + lines(POINTS) + b'3 0 1 2\n'
    assert len(read(tmp_path, content, 'ply').columns['x']) == POINTS.size


def test_a_comment_may_give_the_size_of_a_ply(tmp_path):
    header = ply_header('ascii', info=False).replace(b'element', b'comment width 4\ncomment Height: 3\nelement', 1)
    assert read(tmp_path, header + lines(POINTS), 'ply').shape == (3, 4)
    assert read(tmp_path, ply_header('ascii', info=False) + lines(POINTS), 'ply').shape is None


@pytest.mark.parametrize(
    ('old', 'new', 'sentence'),
    [
        (b'format ascii', b'format binary', 'invalid PLY header'),
        (b'vertex 12', b'vertex -2', 'invalid PLY header'),
        (b'vertex 12', b'vertex 13', 'should have 13 lines'),
        (b'vertex 12', b'vertex 99999999999999999999', 'is cut off'),
        (b'float x', b'quad x', 'invalid PLY header'),
        (b'element vertex', b'element corner', 'has no vertices'),
    ],
)
def test_a_ply_that_contradicts_itself_is_refused(tmp_path, old, new, sentence):
    with pytest.raises(ImportFileError, match=sentence):
        read(tmp_path, ply('ascii').replace(old, new, 1), 'ply')


@pytest.mark.parametrize('kind', ['pcd', 'ply'])
@given(content=st.binary(max_size=200))
def test_garbage_is_refused(kind, content, tmp_path_factory):
    path = tmp_path_factory.mktemp('garbage')
    with pytest.raises(ImportFileError):
        read(path, content, kind)


def test_source_and_target_of_an_lzf_copy_may_overlap():
    packed = np.frombuffer(bytes([0, 7, 0b11100000, 3, 0]), np.uint8)  # a 7, then 12 copies of it
    out = np.empty(13, np.uint8)
    assert _lzf(packed, out) == 13
    assert (out == 7).all()


@given(packed=st.binary(max_size=80))
def test_lzf_stays_inside_its_buffers(packed):
    out = np.zeros(64, np.uint8)
    assert -1 <= _lzf(np.frombuffer(packed, np.uint8), out) <= 64
