# SPDX-License-Identifier: Apache-2.0
"""X3P and SDF: against a reading value by value, against SurfaceTopography, and the variants of the standards."""

import hashlib
import struct
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from naive import surface_files
from surfaces import same_bits, surfaces

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.formats import MeasuredSurface, read_file, write_surface

NAIVE = {'.x3p': surface_files.read_x3p, '.sdf': surface_files.read_sdf}
SINGLE, DOUBLE = np.finfo(np.float32), np.finfo(np.float64)
HEIGHTS = np.array([[1, 2, 3], [4, np.nan, 6]])


@pytest.mark.parametrize('suffix', NAIVE)
@settings(max_examples=25)
@given(surface=surfaces(marks=False))
def test_a_reading_value_by_value_finds_the_same(suffix, surface):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f'a{suffix}'
        write_surface(path, surface)
        heights, dx, dy = NAIVE[suffix](path)
    assert (dx, dy) == surface.pitch
    assert same_bits(np.array(heights).astype(surface.heights.dtype), surface.heights)


@pytest.mark.parametrize('suffix', NAIVE)
@settings(max_examples=25)
@given(surface=surfaces(('f8',)))
def test_surface_topography_reads_the_same(suffix, surface):
    io = pytest.importorskip('SurfaceTopography.IO')
    surface = MeasuredSurface(np.clip(surface.heights, -1, 1), surface.pitch, 'm')
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f'a{suffix}'
        write_surface(path, surface)
        with io.open_topography(str(path), format=suffix[1:]) as reader:
            read = reader.topography()
            heights, size = np.ma.filled(np.ma.masked_invalid(read.heights()), np.nan).T, read.pixel_size
    factor = {'m': 1, 'µm': 1e-6}[read.unit]
    np.testing.assert_allclose(heights * factor, surface.heights, rtol=1e-12)
    np.testing.assert_allclose(np.array(size) * factor, surface.pitch, rtol=1e-12)


def test_surfalize_reads_the_x3p_with_its_checksums(tmp_path):
    surfalize = pytest.importorskip('surfalize', reason='surfalize, which reads x3p files, is not installed')
    write_surface(tmp_path / 'a.x3p', MeasuredSurface(HEIGHTS, (0.5, 0.25), 'm'))
    read = surfalize.Surface.load(tmp_path / 'a.x3p')  # in µm
    np.testing.assert_allclose(read.data * 1e-6, HEIGHTS)
    np.testing.assert_allclose((read.step_x * 1e-6, read.step_y * 1e-6), (0.5, 0.25))


def test_the_checksums_of_an_x3p_are_those_that_md5sum_prints(tmp_path):
    write_surface(tmp_path / 'a.x3p', MeasuredSurface(HEIGHTS, (1.0, 1.0), 'm'))
    with zipfile.ZipFile(tmp_path / 'a.x3p') as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    sums = {name: hashlib.md5(each, usedforsecurity=False).hexdigest() for name, each in content.items()}
    assert content['md5checksum.hex'].decode() == f'{sums["main.xml"]} *main.xml\n'
    stated = f'<MD5ChecksumPointData>{sums["bindata/data.bin"]}</MD5ChecksumPointData>'
    assert stated in content['main.xml'].decode()


@pytest.mark.parametrize('case', [str.lower, str.upper])
def test_the_checksum_of_an_x3p_may_be_in_either_case(tmp_path, case):
    checksum = case(hashlib.md5(np.arange(6, dtype='<i4').tobytes(), usedforsecurity=False).hexdigest())
    assert read_file(x3p(tmp_path / 'a.x3p', checksum=checksum)).heights.tolist() == [[1, 3, 5], [7, 9, 11]]


def test_the_x3p_of_an_instrument_reads_as_surface_topography_reads_it(real_measurements):
    io = pytest.importorskip('SurfaceTopography.IO')
    path = real_measurements / 'vendor/x3p-2.x3p'
    with io.open_topography(str(path)) as reader:
        read = reader.topography()
    surface = read_file(path)
    assert same_bits(surface.heights, np.asarray(read.heights()).T)
    np.testing.assert_allclose(surface.pitch, read.pixel_size, rtol=1e-15)
    assert (surface.unit, read.unit) == ('m', 'm')


def x3p(
    path, *, kind='L', increment='2', offset='1', raw=None, valid=None, axis='I', feature='SUR', checksum=None
):
    data = np.arange(6, dtype={'I': '<i2', 'L': '<i4', 'F': '<f4', 'D': '<f8'}[kind]) if raw is None else raw
    link = '<ValidPointsLink>bindata/valid.bin</ValidPointsLink>' if valid is not None else ''
    checksum = checksum or hashlib.md5(data.tobytes(), usedforsecurity=False).hexdigest()
    header = (
        '<?xml version="1.0"?><p:ISO5436_2 xmlns:p="http://www.opengps.eu/2008/ISO5436_2"><Record1>'
        f'<Revision>ISO5436 - 2000</Revision><FeatureType>{feature}</FeatureType><Axes>'
        f'<CX><AxisType>{axis}</AxisType><DataType>L</DataType><Increment>0.5</Increment></CX>'
        '<CY><AxisType>I</AxisType><DataType>L</DataType><Increment>0.25</Increment></CY>'
        f'<CZ><AxisType>A</AxisType><DataType>{kind}</DataType><Increment>{increment}</Increment>'
        f'<Offset>{offset}</Offset></CZ></Axes></Record1><Record3><MatrixDimension><SizeX>3</SizeX><SizeY>2</SizeY>'
        '<SizeZ>1</SizeZ></MatrixDimension><DataLink><PointDataLink>bindata/data.bin</PointDataLink>'
        f'<MD5ChecksumPointData>{checksum}</MD5ChecksumPointData>{link}</DataLink></Record3></p:ISO5436_2>'
    )
    with zipfile.ZipFile(path, 'w') as archive:
        archive.writestr('main.xml', header)
        archive.writestr('bindata/data.bin', data.tobytes())
        if valid is not None:
            archive.writestr('bindata/valid.bin', valid)
    return path


@pytest.mark.parametrize(('kind', 'code'), [('I', '<i2'), ('L', '<i4'), ('F', '<f4'), ('D', '<f8')])
def test_the_increment_and_offset_of_x3p_heights_are_applied(tmp_path, kind, code):
    raw = np.array([-(2**15), -1, 0, 1, 2, 2**15 - 1], code)
    surface = read_file(x3p(tmp_path / 'a.x3p', kind=kind, raw=raw))
    assert surface.heights.tolist() == [[1 - 2**16, -1, 1], [3, 5, 2**16 - 1]]
    assert (surface.pitch, surface.unit) == ((0.5, 0.25), 'm')


def test_the_valid_points_of_an_x3p_are_honoured(tmp_path):
    surface = read_file(x3p(tmp_path / 'a.x3p', valid=bytes([0b101111])))
    assert np.isnan(surface.heights).tolist() == [[False] * 3, [False, True, False]]


@pytest.mark.parametrize(
    ('changes', 'sentence'),
    [
        ({'feature': 'PRF'}, 'holds no height map, but a profile'),
        ({'axis': 'A'}, 'has no regular grid'),
        ({'increment': 'two'}, 'invalid numbers'),
        ({'raw': np.arange(5, dtype='<i4')}, 'has 20 bytes of heights'),
        ({'valid': b''}, 'too few bytes'),
        ({'checksum': '0' * 32}, 'checksum of bindata/data.bin does not match'),
    ],
)
def test_an_x3p_that_is_no_height_map_is_refused(tmp_path, changes, sentence):
    with pytest.raises(ImportFileError, match=sentence):
        read_file(x3p(tmp_path / 'a.x3p', **changes))


@pytest.mark.parametrize(
    ('kind', 'code', 'missing'),
    [
        *[(3, '<f4', value) for value in (np.nan, np.inf, -np.inf, SINGLE.min, SINGLE.max)],
        *[(7, '<f8', value) for value in (np.nan, np.inf, -np.inf, DOUBLE.min, DOUBLE.max)],
        (4, '<i1', -(2**7)), (5, '<i2', -(2**15)), (6, '<i4', -(2**31)), (1, '<u2', 2**16 - 1),
        (2, '<u4', 2**32 - 1),
    ],
)  # fmt: skip
@pytest.mark.parametrize('scale', [1.0, 1e-9])
def test_what_was_not_measured_in_a_binary_sdf_is_no_height(tmp_path, kind, code, missing, scale):
    raw = np.where(np.isnan(HEIGHTS), missing, HEIGHTS).astype(code)
    (tmp_path / 'a.sdf').write_bytes(sdf_head(kind, 3, 2, scale) + raw.tobytes())
    surface = read_file(tmp_path / 'a.sdf')
    np.testing.assert_array_equal(surface.heights, HEIGHTS * scale)
    assert surface.pitch == (0.5, 0.25)


def sdf_head(kind, columns, rows, scale):
    entries = (b'bISO-1.0', b'x', b'', b'', columns, rows, 0.5, 0.25, scale, -1.0, 0, kind, 0)
    return struct.pack('<8s10s12s12sHHddddBBB', *entries)


@pytest.mark.parametrize(
    ('kind', 'code', 'least', 'most'),
    [
        (0, '<u1', 0, 2**8 - 1), (1, '<u2', 0, 2**16 - 2), (2, '<u4', 0, 2**32 - 2),
        (4, '<i1', 1 - 2**7, 2**7 - 1), (5, '<i2', 1 - 2**15, 2**15 - 1), (6, '<i4', 1 - 2**31, 2**31 - 1),
    ],
)  # fmt: skip
@settings(max_examples=25)
@given(data=st.data())
def test_every_other_value_of_a_binary_sdf_is_a_height(kind, code, least, most, data):
    shape = st.tuples(st.integers(1, 5), st.integers(1, 5))
    raw = data.draw(hnp.arrays(np.dtype(code), shape, elements=st.integers(least, most)))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'a.sdf'
        path.write_bytes(sdf_head(kind, raw.shape[1], raw.shape[0], 1.0) + raw.tobytes())
        np.testing.assert_array_equal(read_file(path).heights, raw.astype(np.float64))


@pytest.mark.parametrize(
    ('kind', 'mark'),
    [(3, '-3.402823466e+38'), (7, '-1.797693e+308'), (7, '-1.79769313486232E+308'), (5, '-32768'), (7, 'BAD')],
)
def test_a_mark_as_text_in_an_sdf_is_no_height(tmp_path, kind, mark):
    write_surface(tmp_path / 'a.sdf', MeasuredSurface(HEIGHTS, (1.0, 1.0), 'm'))
    text = (tmp_path / 'a.sdf').read_text().replace('BAD', mark).replace('DataType    = 7', f'DataType = {kind}')
    (tmp_path / 'a.sdf').write_text(text)
    np.testing.assert_array_equal(read_file(tmp_path / 'a.sdf').heights, HEIGHTS)


@pytest.mark.parametrize('kind', [SINGLE, DOUBLE])
def test_numbers_that_are_marks_in_an_sdf_are_written_as_not_measured(tmp_path, kind):
    heights = np.array([[kind.min, kind.max, np.inf], [1, np.nan, 3]], kind.dtype)
    write_surface(tmp_path / 'a.sdf', MeasuredSurface(heights, (1.0, 1.0), 'm'))
    assert '\nBAD BAD BAD\n1 BAD 3\n' in (tmp_path / 'a.sdf').read_text()


def test_an_sdf_of_surfalize_is_read_with_its_holes(tmp_path):
    surfalize = pytest.importorskip('surfalize', reason='surfalize, which writes sdf files, is not installed')
    surfalize.Surface(HEIGHTS.copy(), 0.5, 0.5).save(tmp_path / 'a.sdf')
    surface = read_file(tmp_path / 'a.sdf')
    np.testing.assert_allclose(surface.heights, HEIGHTS * 1e-6)
    np.testing.assert_allclose(surface.pitch, 0.5e-6)


def test_surfalize_reads_the_sdf_with_its_holes(tmp_path):
    surfalize = pytest.importorskip('surfalize', reason='surfalize, which reads sdf files, is not installed')
    write_surface(tmp_path / 'a.sdf', MeasuredSurface(HEIGHTS, (0.5, 0.5), 'm'))
    np.testing.assert_allclose(surfalize.Surface.load(tmp_path / 'a.sdf').data * 1e-6, HEIGHTS)


def test_a_damaged_place_of_the_directory_of_an_x3p_is_told_as_damage(tmp_path):
    write_surface(tmp_path / 'a.x3p', MeasuredSurface(HEIGHTS, (1.0, 1.0), 'm'))
    content = bytearray((tmp_path / 'a.x3p').read_bytes())
    content[-6:-2] = struct.pack('<I', 0x7F000000)
    (tmp_path / 'a.x3p').write_bytes(content)
    with pytest.raises(ImportFileError, match=r'a\.x3p is not an X3P file, or is damaged'):
        read_file(tmp_path / 'a.x3p')


def test_a_compressed_sdf_is_refused(tmp_path):
    write_surface(tmp_path / 'a.sdf', MeasuredSurface(HEIGHTS, (1.0, 1.0), 'm'))
    text = (tmp_path / 'a.sdf').read_text().replace('Compression = 0', 'Compression = 1')
    (tmp_path / 'a.sdf').write_text(text)
    with pytest.raises(ImportFileError, match='is compressed'):
        read_file(tmp_path / 'a.sdf')
