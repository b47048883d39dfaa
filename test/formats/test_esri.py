# SPDX-License-Identifier: Apache-2.0
"""ASCII grids of ESRI."""

import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.formats import read_file
from socialcircle_ros.recording import import_cloud

HEADER = 'ncols 3\nnrows 2\nxllcorner 500.25\nyllcorner 0\ncellsize 0.5\nNODATA_value -9999\n'
ROWS = '1 2 3\n4 -9999 6\n'
HEIGHTS = [[4, np.nan, 6], [1, 2, 3]]  # the first row of a file is the top


@pytest.fixture(autouse=True)
def without_library(monkeypatch):
    monkeypatch.setitem(sys.modules, 'SurfaceTopography', None)
    monkeypatch.setitem(sys.modules, 'SurfaceTopography.IO', None)


@pytest.mark.parametrize('suffix', ['.asc', '.txt', '.dat'])
@pytest.mark.parametrize(
    'text',
    [
        HEADER + ROWS,
        '\ufeff' + HEADER + ROWS,
        (HEADER + ROWS).upper().replace('\n', '\r\n'),
        HEADER.replace(' ', '      ') + '1 2\n3 4 -9999 6',
        HEADER.replace('cellsize 0.5', 'dx 0.5\ndy 0.5') + ROWS,
        HEADER.replace('NODATA_value -9999\n', '') + ROWS,
        HEADER.replace('-9999', '-3.4028234663852886e+38') + ROWS.replace('-9999', '-3.40282e+38'),
        HEADER.replace('-9999', '0') + ROWS.replace('-9999', '0.000'),
        HEADER.replace('-9999', 'nan') + ROWS.replace('-9999', 'nan'),
    ],
)
def test_the_pitch_and_the_mark_of_the_header_are_taken(tmp_path, suffix, text):
    (tmp_path / f'a{suffix}').write_text(text, encoding='utf-8')
    surface = read_file(tmp_path / f'a{suffix}')
    np.testing.assert_array_equal(surface.heights, HEIGHTS)
    assert (surface.pitch, surface.unit, surface.metadata['xllcorner']) == ((0.5, 0.5), None, '500.25')
    assert import_cloud(tmp_path / f'a{suffix}', unit='um').kind == 'ASCII grid of ESRI'


def test_a_pitch_that_contradicts_the_file_is_refused(tmp_path):
    (tmp_path / 'a.asc').write_text(HEADER + ROWS)
    with pytest.raises(ImportFileError, match=r'a\.asc states its own coordinates: leave the pitch out'):
        read_file(tmp_path / 'a.asc', pitch=(2.0, 2.0))
    assert read_file(tmp_path / 'a.asc', pitch=(0.5, 0.5), unit='um').unit == 'um'


@settings(max_examples=50)
@given(data=st.data())
def test_every_grid_is_read_with_its_numbers(data):
    finite = st.floats(-1e6, 1e6) | st.just(-9999.0)
    heights = data.draw(hnp.arrays(np.float64, st.tuples(st.integers(1, 6), st.integers(1, 6)), elements=finite))
    rows, columns = heights.shape
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'a.asc'
        with path.open('w') as file:
            file.write(f'NCOLS {columns}\nNROWS {rows}\ndx 0.25\ndy 4\n')
            np.savetxt(file, heights, '%.17g')
        surface = read_file(path)
    np.testing.assert_array_equal(surface.heights, np.where(heights == -9999, np.nan, heights)[::-1])
    assert surface.pitch == (0.25, 4.0)


@pytest.mark.parametrize(
    ('text', 'sentence'),
    [
        (HEADER + '1 2 3\n4 5\n', 'has 5 heights, not 2 rows × 3 columns: it is damaged or cut off'),
        (HEADER + '1 2 3\n4 five 6\n', 'with a word that is no number'),
        (HEADER + 'zunits um\n' + ROWS, 'with a word that is no number'),
        (HEADER.replace('cellsize 0.5\n', '') + ROWS, 'without a cell size'),
        (HEADER.replace('0.5', '0,5') + ROWS, 'with a word that is no number'),
        (HEADER.replace('0.5', '0') + ROWS, 'without a cell size above 0'),
        (HEADER.replace('ncols 3', 'ncols 0') + ROWS, 'without rows and columns'),
    ],
)
def test_a_grid_that_contradicts_itself_is_refused(tmp_path, text, sentence):
    (tmp_path / 'a.asc').write_text(text)
    with pytest.raises(ImportFileError, match=rf'a\.asc .*{sentence}'):
        read_file(tmp_path / 'a.asc')
