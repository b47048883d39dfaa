# SPDX-License-Identifier: Apache-2.0
"""Rows in Parquet files."""

import pytest
from measurements.row_examples import row

from socialcircle_ros.measurements import open_measurements, write_rows

pytest.importorskip('pyarrow')


@pytest.mark.parametrize('cell', ['c' * 250, 'c' * 251, 'c' * 4000, '測' * 27, '測' * 28, '../' * 90])
def test_a_cell_whose_folder_would_have_too_long_a_name_is_cut(tmp_path, cell):
    pytest.importorskip('duckdb')
    fits = len(cell) in (250, 27)
    for number, name in enumerate((cell, f'{cell[:-1]}x')):
        write_rows(tmp_path, str(number), [row(cell=name)])
    found = [each for (each,) in open_measurements(tmp_path).sql('select cell from measurements').fetchall()]
    assert len(set(found)) == 2
    assert (cell in found) is fits
    assert all(each.startswith(cell[:20]) for each in found)
