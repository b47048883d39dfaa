# SPDX-License-Identifier: Apache-2.0
"""Files of instruments, against the same surfaces in the data folder."""

import sys

import numpy as np
import pytest
from formats import vendor_files

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.formats import read_file
from socialcircle_ros.lengths import metres_per
from socialcircle_ros.recording import import_cloud

PAIRS = {
    'al3d-1.al3d': 'alicona_fv_al3d1',
    'opd-1.opd': 'wyko_opd_st1',
    'metropro-1.dat': 'zygo_dat_metropro1',
}
SHAPES = {'plu-1.plu': (576, 768), 'x3p-2.x3p': (650, 650)}


@pytest.mark.parametrize('name', PAIRS)
def test_heights_pitch_unit_and_orientation_are_those_of_the_data_folder(real_measurements, name):
    pytest.importorskip('SurfaceTopography')
    surface = read_file(real_measurements / 'vendor' / name)
    with np.load(real_measurements / f'{PAIRS[name]}.npz') as known:
        expected, dx, dy = known['z'].astype(float), float(known['dx']), float(known['dy'])
        expected += float(known['z_offset_um']) if 'z_offset_um' in known else 0.0
    um = metres_per(surface.unit) / 1e-6
    heights = surface.heights.astype(float) * um
    np.testing.assert_array_equal(np.isnan(heights), np.isnan(expected))
    # The data folder holds float32 in µm; the file of the Alicona holds float32 in m, far from 0.
    np.testing.assert_allclose(heights, expected, atol=max(1e-5, np.nanmax(np.abs(expected)) * 2**-23))
    np.testing.assert_allclose(np.array(surface.pitch) * um, (dx, dy), rtol=1e-12)


@pytest.mark.parametrize('name', SHAPES)
def test_the_other_vendor_files_are_read(real_measurements, name):
    pytest.importorskip('SurfaceTopography')
    surface = read_file(real_measurements / 'vendor' / name)
    assert surface.heights.shape == SHAPES[name]
    assert surface.unit in ('um', 'm')
    assert np.isfinite(surface.heights).all()


@pytest.mark.parametrize(
    ('name', 'date'), [('opd-1.opd', '2015-07-07T16:19:48'), ('plu-1.plu', '2023-03-10T16:35:59')]
)
def test_the_date_of_the_measurement_is_read(real_measurements, name, date):
    pytest.importorskip('SurfaceTopography')
    assert read_file(real_measurements / 'vendor' / name).metadata['date'] == date


MADE = {
    '.sur': vendor_files.sur,
    '.plux': vendor_files.plux,
    '.nms': vendor_files.nms,
    '.os3d': vendor_files.os3d,
    '.datx': vendor_files.datx,
    '.vk4': vendor_files.vk4,
    '.vk6': vendor_files.vk6,
}


@pytest.mark.parametrize('suffix', MADE)
def test_a_file_written_by_the_description_of_its_format_is_read(tmp_path, suffix):
    pytest.importorskip('SurfaceTopography')
    z = np.arange(35).reshape(5, 7) * 0.25 + 1
    if not suffix.startswith('.vk'):
        z[2, 3] = np.nan
    MADE[suffix](tmp_path / f'a{suffix}', z, 0.5, 0.75)
    surface = read_file(tmp_path / f'a{suffix}')
    um = metres_per(surface.unit) / 1e-6
    np.testing.assert_allclose(surface.heights * um, z, rtol=1e-6)
    np.testing.assert_allclose(np.array(surface.pitch) * um, (0.5, 0.75), rtol=1e-6)
    content = (tmp_path / f'a{suffix}').read_bytes()
    (tmp_path / f'cut{suffix}').write_bytes(content[: len(content) - 50])
    with pytest.raises(ImportFileError, match=r'cut\.'):
        read_file(tmp_path / f'cut{suffix}')


def test_without_the_library_a_sentence_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, 'SurfaceTopography', None)
    monkeypatch.setitem(sys.modules, 'SurfaceTopography.IO', None)
    (tmp_path / 'a.al3d').write_bytes(b'x')
    with pytest.raises(ImportFileError, match=r'a\.al3d needs SurfaceTopography: pip install '):
        read_file(tmp_path / 'a.al3d')


@pytest.mark.parametrize('suffix', ['.npy', '.asc', '.txt', '.dat'])
def test_a_file_without_pitch_takes_the_pitch_that_is_given(tmp_path, suffix, monkeypatch):
    monkeypatch.setitem(sys.modules, 'SurfaceTopography', None)
    heights = np.arange(12.0).reshape(3, 4)
    path = tmp_path / f'a{suffix}'
    np.save(path, heights) if suffix == '.npy' else np.savetxt(path, heights)
    with pytest.raises(ImportFileError, match='does not state its pitch'):
        read_file(path)
    surface = read_file(path, pitch=(2.0, 3.0), unit='um')
    np.testing.assert_array_equal(surface.heights, heights)
    assert (surface.pitch, surface.unit) == ((2.0, 3.0), 'um')
    cloud = import_cloud(path, pitch=(2.0, 3.0))
    assert (cloud.kind, cloud.notes) == ('' if suffix == '.npy' else 'text file with a matrix of heights', ())


def test_a_byte_order_mark_before_an_ascii_matrix_is_no_part_of_it(tmp_path):
    (tmp_path / 'a.asc').write_text('0 1 2 3\n4 5 6 7\n8 9 10 11\n', encoding='utf-8-sig')
    surface = read_file(tmp_path / 'a.asc', pitch=(2.0, 3.0), unit='um')
    np.testing.assert_array_equal(surface.heights, np.arange(12).reshape(3, 4))


@pytest.mark.parametrize('text', ['# Width: 8 um\n{}', '{}\nRMS = 3', '1 BAD 3 4\n{}', '1\n2\n3\n'])
def test_a_matrix_with_more_than_numbers_needs_the_library(tmp_path, monkeypatch, text):
    monkeypatch.setitem(sys.modules, 'SurfaceTopography.IO', None)
    (tmp_path / 'a.asc').write_text(text.format('0 1 2 3\n4 5 6 7'))
    with pytest.raises(
        ImportFileError, match=r'a\.asc needs SurfaceTopography: .*checkout: pip install -e "\.\[formats'
    ):
        read_file(tmp_path / 'a.asc', pitch=(2.0, 3.0))


def test_a_matrix_with_commas_is_read_without_the_library(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, 'SurfaceTopography', None)
    (tmp_path / 'a.csv').write_text('# heights\n0,1,2,3\n4,,6,nan\n')
    surface = read_file(tmp_path / 'a.csv', pitch=(2.0, 3.0), unit='um')
    np.testing.assert_array_equal(surface.heights, [[0, 1, 2, 3], [4, np.nan, 6, np.nan]])
    assert read_file(tmp_path / 'a.csv', pitch=np.array([2.0, 3.0])).pitch == (2.0, 3.0)
    with pytest.raises(ImportFileError, match='must be two numbers above 0'):
        read_file(tmp_path / 'a.csv', pitch=np.array([2.0]))
    (tmp_path / 'a.csv').write_text('0,1,2,3\n4,,6,nan\n', encoding='utf-8-sig')  # as Excel writes it
    marked = read_file(tmp_path / 'a.csv', pitch=(2.0, 3.0), unit='um')
    np.testing.assert_array_equal(marked.heights, surface.heights)
    (tmp_path / 'b.csv').write_text('0,1,2,3\n4,five,6,7\n')
    with pytest.raises(ImportFileError, match='is no matrix of numbers'):
        read_file(tmp_path / 'b.csv', pitch=(2.0, 3.0))
