# SPDX-License-Identifier: Apache-2.0
"""`socialcircle measurements`."""

import csv
import json
import math
import sys
from collections.abc import Mapping, Sequence
from typing import Literal

import click

# Lengths of known units are compared in m; where the units of a cell cannot be compared, it has no median.
_SUMMARY = """
with known(unit, metres) as (values {}),
    compared as (
        select measurements.*, sq * coalesce(metres, 1) as length,
            case when sq is not null then if(metres is null, coalesce(unit, 'not known'), 'm') end as common
        from measurements left join known using (unit)
    )
select cell, count(*) filter (where status <> 'failed') as clouds,
    count(*) filter (where status = 'warning') as warnings,
    count(*) filter (where status = 'refused') as refused, count(*) filter (where status = 'failed') as failed,
    count(*) filter (where not limits_passed) as limits_failed,
    min(time) as first, max(time) as last, median(outlier_share) as outlier_share,
    if(count(distinct common) < 2, median(length), null) as sq,
    string_agg(distinct common, ', ' order by common) as unit
from compared group by cell order by cell
"""


@click.command(
    'measurements',
    epilog='Example: socialcircle measurements out "select cell, day, avg(outlier_share) from measurements'
    ' group by all order by all"',
)
@click.argument('folder')
@click.argument('query', required=False)
@click.option(
    '--format', 'form', type=click.Choice(['table', 'csv', 'json']), default='table', show_default=True,
    help='How the rows are printed.',
)  # fmt: skip
def command(folder: str, query: str | None, form: Literal['table', 'csv', 'json']) -> None:
    """Ask the measurements in FOLDER with SQL.

    FOLDER is the output of `socialcircle batch`, also its URL, or the measurements.folder of nodes. QUERY is SQL
    of DuckDB on the table `measurements`, which has one row per cloud. Without QUERY, one row per cell is printed.

    \b
    socialcircle measurements out "describe measurements"
    socialcircle measurements out "select recording, reason from measurements where status = 'failed'"
    socialcircle measurements out "copy (from measurements) to 'all.csv'"

    docs/archives.md lists the columns.
    """  # noqa: D301 - click reads \b
    from socialcircle_ros.errors import SocialCircleError
    from socialcircle_ros.measurements import open_measurements

    database = open_measurements(folder)
    import duckdb

    try:
        result = database.execute(query or _summary())
        names, rows = [column[0] for column in result.description], result.fetchall()
    except duckdb.Error as error:
        raise SocialCircleError(f'DuckDB cannot answer the query: {error}') from None
    _print(names, rows, form)


def _summary() -> str:
    from socialcircle_ros.lengths import METRES

    return _SUMMARY.format(', '.join(f"('{unit}', {metres})" for unit, metres in METRES.items()))


def _print(names: Sequence[str], rows: Sequence[Sequence[object]], form: Literal['table', 'csv', 'json']) -> None:
    if form == 'csv':
        writer = csv.writer(sys.stdout, lineterminator='\n')
        writer.writerow(names)
        writer.writerows(['' if cell is None else cell for cell in row] for row in rows)
    elif form == 'json':
        keys = _different(names)
        for row in rows:
            values = dict(zip(keys, map(_without_nan, row), strict=True))
            click.echo(json.dumps(values, default=str, ensure_ascii=False, allow_nan=False))
    else:
        from rich.table import Table

        from .console import CommandConsole

        table = Table(*names)
        for row in rows:
            table.add_row(*('' if cell is None else _text(cell) for cell in row))
        CommandConsole(width=None if sys.stdout.isatty() else 1000, markup=False, highlight=False).print(table)


def _different(names: Sequence[str]) -> list[str]:
    """The names of columns, with a number where several have one: an object of JSON would lose all but one."""
    from socialcircle_ros.formats.fields import free_name

    taken = set(names)
    found: list[str] = []
    for name in names:
        found.append(free_name(name, taken) if name in found else name)
        taken.add(found[-1])
    return found


def _without_nan(cell: object) -> object:
    """A value with null for numbers that JSON does not have, also in lists and maps."""
    if isinstance(cell, float):
        return cell if math.isfinite(cell) else None
    if isinstance(cell, Mapping):
        return {str(key): _without_nan(value) for key, value in cell.items()}
    if isinstance(cell, (list, tuple)):
        return [_without_nan(value) for value in cell]
    return cell


def _text(cell: object) -> str:
    return f'{cell:.6g}' if isinstance(cell, float) else str(cell)
