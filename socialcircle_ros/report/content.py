# SPDX-License-Identifier: Apache-2.0
"""The content of a page: sections with sentences, tables and pictures. Tables are also written as CSV."""

import base64
import csv
import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from socialcircle_ros.digits import decimal_text, share_text

Cell = str | int | float | None
"""A value of a table; None where it does not apply."""

_DECIMALS = re.compile(r'(?P<sign>\+?)\.(?P<decimals>\d+)(?P<kind>[f%])')


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        name: its heading.
        form: format specification of its numbers. Shares and decimals keep true digits, as `digits` writes them.
        wraps: whether its texts may be broken into lines.
    """

    name: str
    form: str = ''
    wraps: bool = True


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

    kind = 'table'
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

    def words(self) -> list[bool]:
        """Whether each column holds text in all of its rows; such a column is aligned to the left."""
        return [
            bool(self.rows) and all(isinstance(row[number], str) for row in self.rows)
            for number in range(len(self.columns))
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
    """A PNG picture.

    Attributes:
        name: of its file, without the suffix.
        png: the content of the file.
        caption: shown below it; '': it says itself what it shows.
        alt: what it shows, in words for a screen reader; '': as the caption says.
    """

    kind = 'picture'
    name: str
    png: bytes
    caption: str
    alt: str = ''

    def __post_init__(self) -> None:
        """Check that it has words: the button that enlarges it has no others.

        Raises:
            ValueError: it has neither a caption nor an alt.
        """
        if not self.alt and not self.caption:
            raise ValueError(f'The picture {self.name} has no words that say what it shows.')

    @property
    def source(self) -> str:
        """The picture as the address of an image."""
        return f'data:image/png;base64,{base64.b64encode(self.png).decode()}'


@dataclass(frozen=True)
class Pictures:
    """Pictures side by side; they have the same height."""

    kind = 'pictures'
    pictures: Sequence[Picture]


@dataclass(frozen=True)
class Beside:
    """Small tables, side by side."""

    kind = 'beside'
    tables: Sequence[Table]


@dataclass(frozen=True)
class Banner:
    """A verdict: one line, and the reasons below it. It stands at the top of its section."""

    kind = 'banner'
    state: Literal['passed', 'failed', 'none']
    title: str
    reasons: Sequence[str] = ()


Item = Table | Picture | Pictures | Beside | Banner


@dataclass(frozen=True)
class Section:
    """A part of the page.

    Attributes:
        title: its heading.
        text: paragraphs above the items.
        findings: conclusions from the numbers; the page lists those of all sections at its top.
        items: tables and pictures, in order.
        warnings: warnings below the heading.
        anchor: target of links, or empty. A section with an anchor begins a sheet of paper, and fills one.
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


def refusal_text(reason: str, count: int) -> str:
    """A warning of clouds or frames that were refused for one reason."""
    return f'Refused{f", {count} times" if count > 1 else ""}: {reason}'


def _text(cell: Cell, form: str) -> str:
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return '–'
    if isinstance(cell, str):
        return cell
    found = _DECIMALS.fullmatch(form)
    if found is None:
        return f'{cell:{form}}'.replace('-', '−')
    decimals = int(found['decimals'])
    signed = bool(found['sign'])
    if found['kind'] == '%':
        return share_text(cell, decimals, signed=signed)
    return f'{"+" if signed and cell > 0 else ""}{decimal_text(cell, decimals)}'
