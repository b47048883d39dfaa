# SPDX-License-Identifier: Apache-2.0
"""Lists of points, x, y and z per line, onto their grid, with and without the points that are missing."""

import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.formats import read_file, surface_of
from socialcircle_ros.recording import import_cloud

HEIGHTS = np.arange(12.0).reshape(3, 4) / 10
POINTS = [(column * 0.5, row * 0.25, HEIGHTS[row, column]) for row in range(3) for column in range(4)]


@pytest.fixture(autouse=True)
def without_library(monkeypatch):
    monkeypatch.setitem(sys.modules, 'SurfaceTopography', None)
    monkeypatch.setitem(sys.modules, 'SurfaceTopography.IO', None)


@pytest.mark.parametrize('suffix', ['.xyz', '.csv', '.txt', '.asc'])
@pytest.mark.parametrize(
    ('separator', 'header'),
    [(' ', ''), ('\t', '# made by a program\n\n'), (',', 'x,y,z\n'), (';', 'x / µm; y / µm; z / µm\n')],
)
def test_points_that_are_left_out_are_not_measured(tmp_path, suffix, separator, header):
    rows = [separator.join(f'{value:g}' for value in point) for point in POINTS[:5] + POINTS[6:]]
    if separator == ';':
        rows = [row.replace('.', ',') for row in rows]
    (tmp_path / f'a{suffix}').write_text(header + '\n'.join(rows) + '\n', encoding='utf-8')
    found = read_file(tmp_path / f'a{suffix}')
    expected = HEIGHTS.copy()
    expected[1, 1] = np.nan
    with pytest.raises(ImportFileError, match='states its own coordinates'):
        read_file(tmp_path / f'a{suffix}', pitch=(1.0, 1.0))
    surface = surface_of(found).surface
    np.testing.assert_array_equal(surface.heights, expected)
    assert (surface.pitch, found.unit) == ((0.5, 0.25), None)
    assert read_file(tmp_path / f'a{suffix}', unit='um').unit == 'um'


@given(
    rows=st.integers(2, 8),
    columns=st.integers(2, 8),
    digits=st.integers(3, 9),
    pitch=st.tuples(st.floats(0.1, 9), st.floats(0.1, 9)),
    offset=st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3)),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_shuffled_list_with_holes_becomes_its_grid_with_the_numbers_of_the_file(
    rows, columns, digits, pitch, offset, seed
):
    rng = np.random.default_rng(seed)
    row, column = np.mgrid[:rows, :columns]
    x, y = (
        np.round(start + step * at, digits) for start, step, at in zip(offset, pitch, (column, row), strict=True)
    )
    cloud = np.dstack([x, y, rng.normal(0, 1e-3, (rows, columns))])
    missing = rng.random((rows, columns)) < 0.3
    missing[:, 0] = missing[0] = False  # so that no row or column is missing
    cloud[missing] = np.nan
    listed = rng.permutation(cloud[~missing])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'a.xyz'
        np.savetxt(path, listed, '%.17g')
        found = read_file(path)
    np.testing.assert_array_equal(found.points, cloud.astype(found.points.dtype))


def test_a_column_without_a_point_is_a_column_that_is_not_measured(tmp_path):
    (tmp_path / 'a.xyz').write_text(lines([(x, y, x + y) for x in (0, 1, 2, 4, 6, 8, 10) for y in range(4)]))
    found = read_file(tmp_path / 'a.xyz').points
    assert found.shape == (4, 11, 3)
    assert np.isnan(found[:, [3, 5, 7, 9]]).all()
    assert found[2, 4].tolist() == [4, 2, 6]


def lines(points):
    return '\n'.join(' '.join(f'{value:.9g}' for value in point) for point in points)


@pytest.mark.parametrize(
    ('points', 'reason'),
    [
        ([*POINTS, (0.5, 0.25, 9.0)], 'two of its points lie on the same place'),
        ([(x + 0.1 * (x == 0.5), y, z) for x, y, z in POINTS], 'x is off even spacing'),
        ([(x, 1.0, z) for x, _, z in POINTS], 'all its points have the same y'),
        ([(x * 1e300, y, z) for x, y, z in POINTS], 'x or y reaches 1.5e'),
        (np.random.default_rng(0).random((50, 3)), 'off even spacing|lie on'),
        (np.round(np.random.default_rng(0).random((50, 3)), 2) * 100, 'points lie on|off even spacing'),
    ],
)
def test_points_without_a_certain_grid_are_refused_in_one_sentence(tmp_path, points, reason):
    (tmp_path / 'a.xyz').write_text(lines(points))
    with pytest.raises(ImportFileError, match=rf'no certain grid: .*({reason}).*Export it as a matrix'):
        read_file(tmp_path / 'a.xyz')


@pytest.mark.parametrize('suffix', ['.xyz', '.csv', '.txt', '.asc'])
def test_the_first_point_behind_a_byte_order_mark_is_read(tmp_path, suffix):
    (tmp_path / f'a{suffix}').write_text(lines(POINTS), encoding='utf-8-sig')
    found = read_file(tmp_path / f'a{suffix}').points
    np.testing.assert_array_equal(found[..., 2], HEIGHTS.astype(found.dtype))


@pytest.mark.filterwarnings('error::RuntimeWarning')
def test_coordinates_beyond_float32_are_kept(tmp_path):
    (tmp_path / 'a.xyz').write_text(lines([(x * 1e60, y * 1e60, z * 1e300) for x, y, z in POINTS]))
    found = read_file(tmp_path / 'a.xyz').points
    assert found.dtype == np.float64
    np.testing.assert_allclose(found[..., 2], HEIGHTS * 1e300)


@pytest.mark.parametrize(
    ('content', 'sentence'),
    [
        (b'', 'is empty'),
        (b'\r\n \r\n', 'is empty'),
        ('0,0,1\n1,0,2\n'.encode('utf-16'), 'is text in UTF-16: save it as UTF-8'),
        (b'x,y,z\n0,0,1\n1,0,2\n0,1', 'has other than x, y and z in line 4: it is damaged or cut off'),
        (b'x,y,z\n0,0,1\n\n1,0,two\n0,1,3', 'has other than x, y and z in line 4'),
        (b'x,y,z\n', 'has neither lines with x, y and z nor a matrix'),
        (b'1,2\n3,4\n', 'has neither lines with x, y and z nor a matrix'),
        (bytes(range(256)), 'has neither lines with x, y and z nor a matrix'),
    ],
)
@pytest.mark.parametrize('suffix', ['.csv', '.xyz'])
def test_a_text_that_is_no_list_is_told_what_is_wrong_with_it(tmp_path, suffix, content, sentence):
    (tmp_path / f'a{suffix}').write_bytes(content)
    with pytest.raises(ImportFileError, match=rf'a\{suffix} {sentence}'):
        read_file(tmp_path / f'a{suffix}')


@pytest.mark.parametrize('suffix', ['.txt', '.asc', '.dat'])
def test_an_empty_text_needs_no_library(tmp_path, suffix):
    (tmp_path / f'a{suffix}').touch()
    with pytest.raises(ImportFileError, match='is empty'):
        read_file(tmp_path / f'a{suffix}')


@pytest.mark.parametrize('suffix', ['.txt', '.csv', '.asc', '.dat'])
@pytest.mark.parametrize('heights', [np.arange(9.0).reshape(3, 3), [[1, 2, 3], [1, 5, 6], [7, 8, 9]]])
def test_three_heights_in_a_line_are_not_taken_for_points(tmp_path, suffix, heights):
    path = tmp_path / f'a{suffix}'
    np.savetxt(path, heights, '%g', delimiter=',' if suffix == '.csv' else ' ')
    with pytest.raises(
        ImportFileError, match=r'no two points lie on one (column|row) .* import it with --pitch\.$'
    ):
        read_file(path)


def test_the_pitch_says_that_three_columns_are_heights(tmp_path):
    (tmp_path / 'a.csv').write_text('1,2,3\n4,5,6\n')
    surface = read_file(tmp_path / 'a.csv', pitch=(2.0, 2.0), unit='um')
    np.testing.assert_array_equal(surface.heights, [[1, 2, 3], [4, 5, 6]])
    imported = import_cloud(tmp_path / 'a.csv', pitch=(2.0, 2.0))
    assert imported.notes == ('it is taken as a text file with a matrix of heights',)


def test_a_list_with_semicolons_needs_no_header(tmp_path):
    text = '\n'.join(';'.join(f'{value:g}'.replace('.', ',') for value in point) for point in POINTS)
    (tmp_path / 'a.csv').write_text(text)
    np.testing.assert_array_equal(surface_of(read_file(tmp_path / 'a.csv')).surface.heights, HEIGHTS)


def test_what_the_lines_were_taken_for_is_said(tmp_path):
    (tmp_path / 'a.txt').write_text(lines(POINTS))
    imported = import_cloud(tmp_path / 'a.txt')
    assert imported.kind == 'text file with x, y and z per line'
    assert imported.notes == (f'it is taken as a {imported.kind}',)


def test_rounded_coordinates_are_kept_as_they_are(tmp_path):
    """A third of a micrometre in three digits is off even spacing by a thousandth of the pitch."""
    points = [(round(column / 3, 3), round(row / 7, 3), row * column) for row in range(5) for column in range(6)]
    (tmp_path / 'a.xyz').write_text(lines(points[3:]))
    found = read_file(tmp_path / 'a.xyz').points.reshape(-1, 3)
    np.testing.assert_array_equal(found[3:], np.array(points[3:], found.dtype))
    assert np.isnan(found[:3]).all()


@given(st.binary(max_size=200))
def test_any_bytes_are_read_or_refused(content):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'a.xyz'
        path.write_bytes(content)
        try:
            assert read_file(path).points.ndim == 3
        except ImportFileError as refusal:
            assert str(path) in str(refusal)
