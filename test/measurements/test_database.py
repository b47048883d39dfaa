# SPDX-License-Identifier: Apache-2.0
"""Rows in files, and queries on them."""

import builtins
from datetime import date
from pathlib import Path

import pytest
from measurements.row_examples import NOON, origin, row

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.measurements import MeasurementRow, open_measurements, refused_row, write_rows

pytest.importorskip('pyarrow')
pytest.importorskip('duckdb')

DAY_NS = 86_400_000_000_000


def test_rows_come_back_as_they_were(tmp_path):
    rows = [row(), refused_row(origin(number=4), 'It is not organized.')]
    write_rows(tmp_path, 'a', rows)
    database = open_measurements(tmp_path)
    found = database.sql('select * from measurements order by number').fetchall()
    names = [column.name for column in MeasurementRow.columns()]
    for cells, original in zip(found, rows, strict=True):
        for name, cell in zip(names, cells, strict=True):
            wanted = getattr(original, name)
            assert cell == (wanted.replace(tzinfo=None) if name == 'time' else wanted), name
    ((unit,),) = [
        [field.metadata[b'unit'].decode()] for field in schema_of(tmp_path) if field.name == 'latency_ms'
    ]
    assert unit == 'ms'
    assert schema_of(tmp_path).metadata[b'socialcircle_schema'] == b'2'


def schema_of(folder):
    from pyarrow import parquet

    return parquet.read_schema(next(Path(folder).rglob('*.parquet')))


@pytest.mark.parametrize('cell', ['cell1', '01', 'a b', 'line 3/ü', '../../x', "it's", '%2e', '*', '=', '..'])
def test_files_are_partitioned_by_day_and_cell_whatever_the_cell_is_called(tmp_path, cell):
    rows = [row(cell=cell), row(stamp=NOON + DAY_NS, cell=cell), row(stamp=NOON + DAY_NS, cell='other')]
    folder = tmp_path / "it's [1] *"
    written = write_rows(folder, 'a', rows)
    assert len(written) == 3
    assert all(Path(name).parts[:1] == ('measurements',) and len(Path(name).parts) == 4 for name in written)
    assert sorted(path for path in tmp_path.rglob('*.parquet')) == sorted(folder / name for name in written)
    database = open_measurements(folder)
    database.execute('select cell, day from measurements order by day, cell = ?', ['other'])
    assert database.fetchall() == [
        (cell, date(2026, 9, 21)),
        (cell, date(2026, 9, 22)),
        ('other', date(2026, 9, 22)),
    ]


def test_a_file_of_the_same_name_is_replaced(tmp_path):
    for _ in range(2):
        write_rows(tmp_path, 'a', [row()])
    write_rows(tmp_path, 'b', [row(number=7)])
    database = open_measurements(tmp_path)
    assert database.sql('select number from measurements order by 1').fetchall() == [(3,), (7,)]
    write_rows(tmp_path, 'c', [row(number=9)])
    assert database.sql('select count(*) from measurements').fetchall() == [(3,)]


def test_rows_of_another_version_are_read_together(tmp_path):
    import pyarrow as pa
    from pyarrow import parquet

    (name,) = write_rows(tmp_path, 'a', [row()])
    table = parquet.read_table(tmp_path / name, partitioning=None)
    later = table.append_column('ssk', pa.array([0.5]))
    parquet.write_table(later, (tmp_path / name).with_name('b.parquet'))
    database = open_measurements(tmp_path)
    assert database.sql('select ssk from measurements order by ssk').fetchall() == [(0.5,), (None,)]


def test_a_column_that_an_older_version_did_not_write_is_null_also_before_and_after_newer_rows_come(tmp_path):
    from pyarrow import parquet

    (name,) = write_rows(tmp_path, 'a', [row()])
    table = parquet.read_table(tmp_path / name, partitioning=None)
    parquet.write_table(table.drop_columns(['unit']), tmp_path / name)
    database = open_measurements(tmp_path)
    query = 'select sq, unit from measurements order by number'
    assert database.sql(query).fetchall() == [(0.2, None)]
    write_rows(tmp_path, 'b', [row(number=4, unit='um')])
    assert database.sql(query).fetchall() == [(0.2, None), (0.2, 'um')]
    names = [column.name for column in MeasurementRow.columns()]
    assert [each[0] for each in database.sql('describe measurements').fetchall()] == names


def test_only_the_days_that_a_query_asks_for_are_read(tmp_path):
    write_rows(tmp_path, 'a', [row(stamp=NOON + number * DAY_NS) for number in range(3)])
    asked = "explain analyze select sq from measurements where day = date '2026-09-22'"
    ((_, plan),) = open_measurements(tmp_path).sql(asked).fetchall()
    assert 'day=2026-09-22' in plan
    assert 'day=2026-09-21' not in plan


def test_a_folder_without_measurements_is_told(tmp_path):
    with pytest.raises(SocialCircleError, match='has no measurements: give the output of `socialcircle batch`'):
        open_measurements(tmp_path)


@pytest.mark.parametrize(('module', 'call'), [('pyarrow', 'write'), ('duckdb', 'open')])
def test_a_missing_library_is_told_with_its_extra(tmp_path, monkeypatch, module, call):
    real = builtins.__import__

    def without(name, *rest, **options):
        if name == module:
            raise ImportError(name)
        return real(name, *rest, **options)

    monkeypatch.setattr(builtins, '__import__', without)
    with pytest.raises(SocialCircleError, match=r'need (DuckDB|pyarrow): pip install '):
        write_rows(tmp_path, 'a', [row()]) if call == 'write' else open_measurements(tmp_path)


def test_a_file_that_cannot_be_written_is_one_sentence(tmp_path):
    (tmp_path / 'measurements').write_text('a file')
    with pytest.raises(SocialCircleError, match='cannot be written'):
        write_rows(tmp_path, 'a', [row()])
