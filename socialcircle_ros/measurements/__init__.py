# SPDX-License-Identifier: Apache-2.0
"""Measurements as data: one row per cloud in Parquet files, and DuckDB as the database over them.

The schema of a row, the files and the queries live here. Rows are made elsewhere: `archive` makes them of
recordings, the node of live clouds. Nothing here reads recordings.
"""

from .database import open_measurements
from .files import FOLDER, write_rows
from .row import SCHEMA_VERSION, MeasurementRow, Origin, refused_row, row_of, schema_table
from .settings_text import SettingsText

__all__ = [
    'FOLDER',
    'SCHEMA_VERSION',
    'MeasurementRow',
    'Origin',
    'SettingsText',
    'open_measurements',
    'refused_row',
    'row_of',
    'schema_table',
    'write_rows',
]
