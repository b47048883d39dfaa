# SPDX-License-Identifier: Apache-2.0
"""`socialcircle trend`."""

from dataclasses import replace

import pytest
from measurements.row_examples import row

from socialcircle_ros.measurements import write_rows

for library in ('bokeh', 'pyarrow', 'duckdb'):
    pytest.importorskip(library)


def test_it_tells_what_drifts_and_what_failed(run, tmp_path):
    example = row()
    rows = [replace(example, number=number, sq=1.0 + (number % 2) * (1 + number // 60)) for number in range(120)]
    rows.append(replace(example, status='failed', reason='It is no recording.'))
    write_rows(tmp_path / 'out', 'a', rows)
    done = run('trend', 'out')
    assert done.code == 0, done.err
    assert '120 clouds in 1 series.' in done.out
    assert 'cell1, lid, 1 failure: It is no recording.' in done.err
    assert (tmp_path / 'trend.html').exists()
    refused = run('trend', 'out', '-o', 'a.png')
    assert refused.code == 1
    assert 'a.png is not the name of a page' in refused.err
    assert not (tmp_path / 'a.png').exists()
