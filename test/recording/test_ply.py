# SPDX-License-Identifier: Apache-2.0
"""PLY files, as PCL, CloudCompare and Open3D write them."""

import struct

import numpy as np
import pytest
from recording.point_samples import COLUMNS, POINTS, RECORD, ROWS, lines, ply, ply_header

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.recording.ply import read_ply

ENCODINGS = ('ascii', 'binary_little_endian', 'binary_big_endian')
FACES = 'element face 2\nproperty uchar flag\nproperty list uchar int vertex_indices\n'
CAMERA = """\
element camera 1
property float view_px
property float view_py
property int viewportx
property int viewporty
property float k1
"""


def read(tmp_path, content):
    path = tmp_path / 'cloud.ply'
    path.write_bytes(content)
    return read_ply(path)


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
    table = read(tmp_path, header + body)
    assert table.places.tolist() == grid
    for length in range(len(header), len(header + body) - 3, 5):
        with pytest.raises(ImportFileError):
            read(tmp_path, (header + body)[:length])


def test_the_faces_of_a_ply_are_skipped(tmp_path):
    extra = 'element face 1\nproperty list uchar int vertex_indices\n'
    content = ply_header('ascii', extra=extra) + lines(POINTS) + b'3 0 1 2\n'
    assert len(read(tmp_path, content).columns['x']) == POINTS.size


def test_a_comment_may_give_the_size_of_a_ply(tmp_path):
    header = ply_header('ascii', info=False).replace(b'element', b'comment width 4\ncomment Height: 3\nelement', 1)
    assert read(tmp_path, header + lines(POINTS)).shape == (3, 4)
    assert read(tmp_path, ply_header('ascii', info=False) + lines(POINTS)).shape is None


@pytest.mark.parametrize(
    ('old', 'new', 'sentence'),
    [
        (b'format ascii', b'format binary', 'invalid PLY header'),
        (b'vertex 12', b'vertex -2', 'invalid PLY header'),
        (b'vertex 12', b'vertex 13', 'should have 13 lines'),
        (b'vertex 12', b'vertex 99999999999999999999', 'is cut off'),
        (b'float x', b'quad x', 'invalid PLY header'),
        (b'element vertex', b'element corner', 'has no vertices: save it with an element vertex'),
    ],
)
def test_a_ply_that_contradicts_itself_is_refused(tmp_path, old, new, sentence):
    with pytest.raises(ImportFileError, match=sentence):
        read(tmp_path, ply('ascii').replace(old, new, 1))


@pytest.mark.parametrize('element', ['element face 0\n', 'element edge 0\nproperty int a\n'])
@pytest.mark.parametrize('encoding', ENCODINGS)
@pytest.mark.parametrize('before', [True, False])
def test_an_element_without_entries_takes_no_line(tmp_path, element, encoding, before):
    content = ply(encoding)
    at = content.index(b'element' if before else b'end_header')
    table = read(tmp_path, content[:at] + element.encode() + content[at:])
    np.testing.assert_array_equal(table.columns['z'], POINTS['z'])


@pytest.mark.parametrize('encoding', ENCODINGS)
def test_faces_before_the_vertices_are_skipped(tmp_path, encoding):
    content = ply(encoding)
    at, end = content.index(b'element'), content.index(b'end_header\n') + len(b'end_header\n')
    order = '<' if encoding == 'binary_little_endian' else '>'
    faces = [(7, [0, 1, 2]), (8, [0, 1, 2, 3])]
    body = (
        b''.join(f'{flag} {len(face)} {" ".join(map(str, face))}\n'.encode() for flag, face in faces)
        if encoding == 'ascii'
        else b''.join(struct.pack(f'{order}BB{len(face)}i', flag, len(face), *face) for flag, face in faces)
    )
    table = read(tmp_path, content[:at] + FACES.encode() + content[at:end] + body + content[end:])
    np.testing.assert_array_equal(table.columns['z'], POINTS['z'])


def camera(encoding, width, height):
    content = ply_header(encoding, info=False, extra=CAMERA) + ply(encoding)[len(ply_header(encoding)) :]
    if encoding == 'ascii':
        return content + f'0 0 {width} {height} 1.5\n'.encode()
    return content + struct.pack(
        f'{"<" if encoding == "binary_little_endian" else ">"}ffiif', 0, 0, width, height, 1.5
    )


@pytest.mark.parametrize('encoding', ENCODINGS)
def test_the_size_is_in_the_viewport_of_the_camera_as_pcl_writes_it(tmp_path, encoding):
    assert read(tmp_path, camera(encoding, COLUMNS, ROWS)).shape == (ROWS, COLUMNS)


@pytest.mark.parametrize('viewport', [(12, 1), (1920, 1080), (-4, -3), (0, 0)])
def test_a_viewport_that_is_not_the_size_of_the_grid_is_ignored(tmp_path, viewport):
    assert read(tmp_path, camera('ascii', *viewport)).shape is None


def test_a_property_that_is_there_twice_has_two_names(tmp_path):
    content = ply('ascii').replace(b'property float32 y', b'property float32 intensity')
    table = read(tmp_path, content)
    assert list(table.columns) == ['x', 'intensity', 'z', 'intensity_2']
    assert table.notes == ['the field intensity is there again, and becomes intensity_2']
    with pytest.raises(ImportFileError, match='has the coordinate x twice'):
        read(tmp_path, ply('ascii').replace(b'float32 y', b'float32 x'))


def test_lists_in_vertices_are_refused(tmp_path):
    content = ply('ascii').replace(b'property float x', b'property list uchar float x')
    with pytest.raises(ImportFileError, match='has lists in its vertices'):
        read(tmp_path, content)


def test_lines_may_end_as_on_windows(tmp_path):
    table = read(tmp_path, ply('ascii').replace(b'\n', b'\r\n'))
    np.testing.assert_array_equal(table.columns['z'], POINTS['z'])


def test_a_binary_body_may_begin_with_white_space(tmp_path):
    header = b'ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty int x\nend_header\n'
    assert read(tmp_path, header + b'\n\r \t\n\r \t').columns['x'].tolist() == [0x09200D0A] * 2
