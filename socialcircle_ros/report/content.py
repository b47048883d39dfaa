"""The content of a page: sections with sentences, tables and pictures. Tables are also written as CSV."""

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

Cell = str | int | float | None
"""A value of a table; None where it does not apply."""


@dataclass(frozen=True)
class Column:
    """A column of a table: its heading, and the format specification of its numbers."""

    name: str
    form: str = ''


@dataclass(frozen=True)
class Table:
    """Rows of cells under named columns.

    Attributes:
        name: name of the CSV file without its suffix.
        title: one line above the table.
        columns: the columns from left to right.
        rows: the rows; each has one cell per column.
        note: what a reader must know, below the table.
        links: for each row, the anchor that its first cell links to; empty where rows have no links.
    """

    name: str
    title: str
    columns: Sequence[Column]
    rows: Sequence[Sequence[Cell]]
    note: str = ''
    links: Sequence[str] = ()

    def texts(self) -> list[list[str]]:
        """The cells as text, formatted by their columns."""
        return [
            [_text(cell, column.form) for cell, column in zip(row, self.columns, strict=True)] for row in self.rows
        ]

    def csv(self) -> str:
        """The table as CSV, with numbers at full precision."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator='\n')
        writer.writerow([column.name for column in self.columns])
        writer.writerows([['' if cell is None else cell for cell in row] for row in self.rows])
        return out.getvalue()


@dataclass(frozen=True)
class Picture:
    """A PNG picture, the name of its file without the suffix, and its caption."""

    name: str
    png: bytes
    caption: str


@dataclass(frozen=True)
class Panels:
    """Small pictures of the same points, side by side.

    Attributes:
        pictures: title and PNG of each picture.
        aspect: width divided by height of the measured field.
        scale: lowest value, highest value and PNG of the colour bar; None for no bar.
    """

    pictures: Sequence[tuple[str, bytes]]
    aspect: float
    scale: tuple[str, str, bytes] | None = None


@dataclass(frozen=True)
class Beside:
    """Small tables, side by side."""

    tables: Sequence[Table]


Item = Table | Picture | Panels | Beside


@dataclass(frozen=True)
class Section:
    """A part of the page.

    Attributes:
        title: its heading.
        text: paragraphs above the items.
        findings: conclusions from the numbers; the page lists those of all sections at its top.
        items: tables and pictures, in order.
        warnings: warnings below the heading.
        anchor: target of links, or empty. A section with an anchor is printed on one sheet of paper.
    """

    title: str
    text: Sequence[str] = ()
    findings: Sequence[str] = ()
    items: Sequence[Item] = field(default_factory=tuple)
    warnings: Sequence[str] = ()
    anchor: str = ''

    @property
    def tables(self) -> list[Table]:
        """All items that are tables."""
        return [item for item in self.items if isinstance(item, Table)]

    @property
    def pictures(self) -> list[Picture]:
        """All items that are pictures."""
        return [item for item in self.items if isinstance(item, Picture)]


def _text(cell: Cell, form: str) -> str:
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return '–'
    return cell if isinstance(cell, str) else f'{cell:{form}}'
