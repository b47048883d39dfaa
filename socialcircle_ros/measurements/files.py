# SPDX-License-Identifier: Apache-2.0
"""Rows in Parquet files, partitioned by day and cell: `measurements/day=2026-11-28/cell=cell1/NAME.parquet`."""

import os
from collections.abc import Sequence
from dataclasses import replace
from hashlib import blake2b
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from socialcircle_ros.errors import SocialCircleError, install_command
from socialcircle_ros.storage import write_file

from .row import SCHEMA_VERSION, MeasurementRow

if TYPE_CHECKING:
    from datetime import date

    import pyarrow as pa

FOLDER = 'measurements'
"""The folder of the files, in the folder of the results."""

_LONGEST_NAME = 255  # bytes, on nearly all file systems


def write_rows(folder: Path, name: str, rows: Sequence[MeasurementRow]) -> list[str]:
    """Write rows to one file for each day and cell; a file of the same name is replaced.

    Each file is written whole or not at all. The name of a cell that is too long for a folder is cut, and ends in
    a hash of the whole.

    Args:
        folder: of the results; the files are in `measurements` in it.
        name: of the files, without a suffix; another name for each source of rows.
        rows: in the order in which they are written.

    Returns:
        The files, relative to `folder`.

    Raises:
        SocialCircleError: a file cannot be written, or pyarrow is not installed.
    """
    partitions: dict[tuple[date, str], list[MeasurementRow]] = {}
    for row in rows:
        cell = _cell_that_fits(row.cell)
        partitions.setdefault((row.day, cell), []).append(replace(row, cell=cell))
    written = []
    for (day, cell), members in partitions.items():
        path = Path(FOLDER, f'day={day}', _folder_of(cell), f'{name}.parquet')
        content = _parquet(members)
        try:
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise SocialCircleError(f'{folder / path} cannot be written: {error.strerror}.') from None
        write_file(folder / path, content)
        written.append(str(path))
    return written


def folder_fault(folder: Path) -> str:
    """Why no rows can be written to a folder of results, which is made; empty if nothing speaks against it."""
    path = folder / FOLDER
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        return f'{path} cannot be made: {error.strerror}.'
    return '' if os.access(path, os.W_OK | os.X_OK) else f'{path} cannot be written: Permission denied.'


def _folder_of(cell: str) -> str:
    """Without quoting, a cell such as `../x` would name another folder."""
    return f'cell={quote(cell, safe=" ")}'


def _cell_that_fits(cell: str) -> str:
    """The cell, or its beginning with a hash: DuckDB takes the cell from the folder, where letters can be long."""
    if len(_folder_of(cell)) <= _LONGEST_NAME:
        return cell
    digest = blake2b(cell.encode(), digest_size=4).hexdigest()
    kept = cell[:_LONGEST_NAME]
    while len(_folder_of(f'{kept}-{digest}')) > _LONGEST_NAME:
        kept = kept[:-1]
    return f'{kept}-{digest}'


def _parquet(rows: Sequence[MeasurementRow]) -> bytes:
    try:
        import pyarrow as pa  # noqa: PLC0415 - an extra
        from pyarrow import parquet  # noqa: PLC0415
    except ImportError:
        raise SocialCircleError(f'Rows of measurements need pyarrow: {install_command("measurements")}.') from None
    columns = [[getattr(row, column.name) for row in rows] for column in MeasurementRow.columns()]
    # A map is a list of pairs; stages are the only one.
    arrays = [
        [None if cell is None else list(cell.items()) for cell in cells]
        if column.type == 'number by name'
        else cells
        for column, cells in zip(MeasurementRow.columns(), columns, strict=True)
    ]
    schema = arrow_schema()
    table = pa.Table.from_arrays(
        [pa.array(cells, field.type) for cells, field in zip(arrays, schema, strict=True)], schema=schema
    )
    sink = pa.BufferOutputStream()
    parquet.write_table(table, sink, compression='zstd')
    content: bytes = sink.getvalue().to_pybytes()
    return content


def arrow_schema() -> 'pa.Schema':
    """The schema of the files; each column has its description and its unit as metadata."""
    import pyarrow as pa  # noqa: PLC0415 - an extra

    types = {
        'text': pa.string(),
        'whole number': pa.int64(),
        'number': pa.float64(),
        'true or false': pa.bool_(),
        'time': pa.timestamp('us'),
        'date': pa.date32(),
        'number by name': pa.map_(pa.string(), pa.float64()),
    }
    fields = [
        pa.field(column.name, types[column.type], metadata={'description': column.sentence, 'unit': column.unit})
        for column in MeasurementRow.columns()
    ]
    return pa.schema(fields, metadata={'socialcircle_schema': str(SCHEMA_VERSION)})
