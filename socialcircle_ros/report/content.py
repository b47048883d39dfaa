"""What an experiment has to show: sentences, tables and pictures, for the page, the CSV files and the terminal."""

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

Cell = str | int | float | None
"""None: does not apply."""


@dataclass(frozen=True)
class Column:
    """A column of a table: its head, and how numbers are written in it (a format specification)."""

    name: str
    form: str = ''


@dataclass(frozen=True)
class Table:
    """Rows of cells under named columns.

    Attributes:
        name: of the CSV file, without its ending.
        title: one line above it.
        columns: from left to right.
        rows: each as long as `columns`.
        note: what a reader must know to read it.
        links: for each row the anchor that its first cell leads to; none: no row leads anywhere.
    """

    name: str
    title: str
    columns: Sequence[Column]
    rows: Sequence[Sequence[Cell]]
    note: str = ''
    links: Sequence[str] = ()

    def texts(self) -> list[list[str]]:
        """The cells as they are shown."""
        return [
            [_text(cell, column.form) for cell, column in zip(row, self.columns, strict=True)] for row in self.rows
        ]

    def csv(self) -> str:
        """The table as CSV, numbers in full."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator='\n')
        writer.writerow([column.name for column in self.columns])
        writer.writerows([['' if cell is None else cell for cell in row] for row in self.rows])
        return out.getvalue()


@dataclass(frozen=True)
class Picture:
    """A PNG, the name of its file without the ending, and the sentence below it."""

    name: str
    png: bytes
    caption: str


@dataclass(frozen=True)
class Panels:
    """Small pictures side by side that show the same points.

    Attributes:
        pictures: a title and a PNG each.
        aspect: width by height of each on the part.
        scale: what the ends of the colour bar stand for, and the bar as a PNG; None: no bar.
    """

    pictures: Sequence[tuple[str, bytes]]
    aspect: float
    scale: tuple[str, str, bytes] | None = None


@dataclass(frozen=True)
class Beside:
    """Small tables side by side."""

    tables: Sequence[Table]


Item = Table | Picture | Panels | Beside


@dataclass(frozen=True)
class Section:
    """A part of the page.

    Attributes:
        title: its head.
        text: paragraphs, above the tables.
        findings: sentences that follow from the numbers; shown together at the top of the page as well.
        items: tables and pictures, in order.
        warnings: sentences that must not be overlooked, below the head.
        anchor: where links lead to; empty: none does. A section that has one is kept on one sheet of paper.
    """

    title: str
    text: Sequence[str] = ()
    findings: Sequence[str] = ()
    items: Sequence[Item] = field(default_factory=tuple)
    warnings: Sequence[str] = ()
    anchor: str = ''

    @property
    def tables(self) -> list[Table]:
        """The tables among the items."""
        return [item for item in self.items if isinstance(item, Table)]

    @property
    def pictures(self) -> list[Picture]:
        """The pictures among the items."""
        return [item for item in self.items if isinstance(item, Picture)]


def _text(cell: Cell, form: str) -> str:
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return '–'
    return cell if isinstance(cell, str) else f'{cell:{form}}'
