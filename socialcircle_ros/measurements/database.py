# SPDX-License-Identifier: Apache-2.0
"""DuckDB over the files of measurements."""

import re
from pathlib import Path
from typing import TYPE_CHECKING

from socialcircle_ros.errors import SocialCircleError, install_command
from socialcircle_ros.storage import file_system, is_url

from .files import FOLDER
from .row import ColumnType, MeasurementRow

if TYPE_CHECKING:
    import duckdb

TABLE = 'measurements'
"""The name of the table in queries."""

_FILES = 'day=*/cell=*/*.parquet'
_TYPES: dict[ColumnType, str] = {
    'text': 'VARCHAR',
    'whole number': 'BIGINT',
    'number': 'DOUBLE',
    'true or false': 'BOOLEAN',
    'time': 'TIMESTAMP',
    'date': 'DATE',
    'number by name': 'MAP(VARCHAR, DOUBLE)',
}


def open_measurements(folder: str | Path) -> 'duckdb.DuckDBPyConnection':
    """Open the measurements of a folder as a database in memory with the table `measurements`.

    The files are read when a query needs them, by the columns, days and cells that it needs. Nothing is copied, so
    rows that are written later are in the next query. A column that an older version did not write is NULL.

    Args:
        folder: the results of `socialcircle batch`, also at a URL, or the `measurements.folder` of nodes.

    Returns:
        A connection of DuckDB. `connection.sql('select ...').df()` is a DataFrame, `.arrow()` a table of Arrow,
        `.fetchall()` a list of tuples.

    Raises:
        SocialCircleError: the folder has no measurements, or DuckDB is not installed.

    Example:
        >>> from socialcircle_ros import open_measurements
        >>> database = open_measurements('out')
        >>> database.sql('select cell, count(*), median(outlier_share) from measurements group by cell').fetchall()
    """
    try:
        import duckdb  # noqa: PLC0415 - an extra
    except ImportError:
        raise SocialCircleError(f'Queries need DuckDB: {install_command("measurements")}.') from None
    connection = duckdb.connect(':memory:')
    if is_url(folder):
        files, path = file_system(str(folder))
        connection.register_filesystem(files)
        top, has_rows = str(files.unstrip_protocol(path)), bool(files.glob(f'{path}/{FOLDER}/{_FILES}'))
    else:
        top = str(Path(str(folder).removeprefix('file://')).absolute())
        has_rows = next(Path(top, FOLDER).glob(_FILES), None) is not None
    if not has_rows:
        raise SocialCircleError(
            f'{folder} has no measurements: give the output of `socialcircle batch`, or'
            ' measurements.folder of a node.'
        )
    pattern = re.sub(r'([*?\[])', r'[\1]', f'{top}/{FOLDER}') + f'/{_FILES}'
    # Progress bars of DuckDB would mix with the output of commands.
    connection.execute('SET enable_progress_bar = false')
    quoted = pattern.replace("'", "''")
    # The empty table has all columns, also where files of this version are still to come.
    columns = ', '.join(f'NULL::{_TYPES[column.type]} AS {column.name}' for column in MeasurementRow.columns())
    connection.execute(
        f"CREATE VIEW {TABLE} AS SELECT * FROM read_parquet('{quoted}', union_by_name = true,"  # noqa: S608 - a path
        " hive_partitioning = true, hive_types = {'day': DATE, 'cell': VARCHAR})"
        f' UNION ALL BY NAME SELECT {columns} WHERE false'
    )
    return connection
