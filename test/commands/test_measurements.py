# SPDX-License-Identifier: Apache-2.0
"""`socialcircle measurements`."""

import csv
import io
import json
from dataclasses import replace

import pytest
from measurements.row_examples import origin, row

from socialcircle_ros.measurements import refused_row, write_rows

pytest.importorskip('pyarrow')
pytest.importorskip('duckdb')


@pytest.fixture
def out(tmp_path):
    cell2 = origin(cell='cell2')
    failed = refused_row(cell2, 'It is no recording.', 'failed')
    rows = [row(), row(number=4), refused_row(cell2, 'It is not organized.'), failed]
    write_rows(tmp_path / 'out', 'a', rows)
    return tmp_path / 'out'


def test_without_a_query_it_prints_one_row_per_cell(run, out):
    done = run('measurements', out, '--format', 'csv')
    assert done.code == 0, done.err
    rows = list(csv.DictReader(io.StringIO(done.out)))
    assert [[each[name] for name in ('cell', 'clouds', 'refused', 'failed')] for each in rows] == [
        ['cell1', '2', '0', '0'],
        ['cell2', '1', '1', '1'],
    ]


def test_the_median_of_sq_compares_lengths_in_metres_only(run, tmp_path):
    example = row()
    for cell, values in {
        'both': [(1.0, 'um'), (3e-6, 'm'), (2000.0, 'nm'), (None, None)],
        'not comparable': [(1.0, 'um'), (1.0, None)],
        'pixels': [(5.0, 'px')],
        'unknown': [(1.0, None), (3.0, None)],
    }.items():
        rows = [replace(example, cell=cell, sq=sq, unit=unit) for sq, unit in values]
        write_rows(tmp_path / 'out', 'a', rows)
    done = run('measurements', 'out', '--format', 'csv')
    rows = list(csv.DictReader(io.StringIO(done.out)))
    medians = [float(each['sq']) if each['sq'] else None for each in rows]
    assert [(each['cell'], each['clouds'], each['unit']) for each in rows] == [
        ('both', '4', 'm'),
        ('not comparable', '2', 'm, not known'),
        ('pixels', '1', 'px'),
        ('unknown', '2', 'not known'),
    ]
    assert medians == [pytest.approx(2e-6), None, 5.0, 2.0]


def test_a_query_is_answered_as_a_table_or_as_json(run, out):
    query = 'select number, round(outlier_share, 4) as share, reason from measurements order by all'
    table = run('measurements', out, query)
    assert '0.0046' in table.out
    assert 'It is not organized.' in table.out
    done = run('measurements', out, query, '--format', 'json')
    rows = [json.loads(line) for line in done.out.splitlines()]
    assert rows[0] == {'number': 3, 'share': 0.0046, 'reason': None}


def test_json_has_every_column_and_no_number_that_json_does_not_have(run, out):
    query = (
        "select 1 as a, 2 as a, 3 as a_2, 4 as a, 'nan'::double as b, [1.5, '-inf'::double] as c,"
        " map([date '2026-09-21'], ['nan'::double]) as d, {'x': 'inf'::float} as e, date '2026-09-21' as f"
    )
    done = run('measurements', out, query, '--format', 'json')
    assert done.code == 0, done.err
    assert json.loads(done.out, parse_constant=pytest.fail) == {
        'a': 1, 'a_3': 2, 'a_2': 3, 'a_4': 4, 'b': None, 'c': [1.5, None], 'd': {'2026-09-21': None},
        'e': {'x': None}, 'f': '2026-09-21',
    }  # fmt: skip


def test_a_bad_query_is_told_by_duckdb(run, out):
    done = run('measurements', out, 'select nothing from measurements')
    assert done.code == 1
    assert 'DuckDB cannot answer the query' in done.err
    assert 'nothing' in done.err
    assert 'Traceback' not in done.err
