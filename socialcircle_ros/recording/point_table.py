# SPDX-License-Identifier: Apache-2.0
"""The points of a PLY or PCD file as columns of numbers, and how text becomes numbers without loss."""

import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.errors import ImportFileError

FieldValues = NDArray[np.generic]
"""One value for each point, of any type."""

Number = TypeVar('Number', bound=np.generic)

# How the C libraries of Microsoft, IBM and others print NaN and infinity. With few digits 1.#IND becomes 1.#J.
_ODD_NUMBER = re.compile(rb'[(#]|nan[qs]|[qs]nan', re.IGNORECASE)
_ODD_NAN = re.compile(rb'[+-]?(?:1\.#(?!inf)\w+|nan\([^)\s]*\)|nan[qs]\b|[qs]nan\b)', re.IGNORECASE)
_ODD_INFINITY = re.compile(rb'1\.#inf\w*', re.IGNORECASE)


@dataclass(eq=False)
class PointTable:
    """The points of a file as columns.

    Attributes:
        columns: the values by name, (N,) each, or (N, count) if a point has several values.
        shape: (rows, columns) of the grid; None if the file does not hold it.
        places: (rows · columns,) the index of the point at each place of the grid, row by row; -1: no point. None:
            the points are in the order of the grid.
        notes: what was not taken literally, one sentence each.
    """

    columns: dict[str, FieldValues]
    shape: tuple[int, int] | None
    places: NDArray[np.int64] | None = None
    notes: list[str] = field(default_factory=list)


def unique_names(path: Path, names: Sequence[str], notes: list[str]) -> list[str]:
    """Names of columns, in which a name that occurs again has a number.

    Args:
        path: for the message.
        names: as the file has them.
        notes: receives a sentence for each name that is changed.

    Raises:
        ImportFileError: a coordinate occurs twice.
    """
    unique: list[str] = []
    for name in names:
        if name in ('x', 'y', 'z') and name in unique:
            raise ImportFileError(f'{path} has the coordinate {name} twice: save it with one.')
        free, number = name, 1
        while free in unique or (number > 1 and free in names):
            number += 1
            free = f'{name}_{number}'
        if free != name:
            notes.append(f'the field {name} is there again, and becomes {free}')
        unique.append(free)
    return unique


def ascii_columns(path: Path, text: bytes, rows: int, kinds: Sequence[str]) -> list[FieldValues]:
    """Read lines of numbers.

    A value that its type cannot hold is not changed to one that it can: the column becomes float64 then.

    Args:
        path: for the message.
        text: the lines.
        rows: number of lines.
        kinds: NumPy type of each column.

    Returns:
        (rows,) values of each column.

    Raises:
        ImportFileError: a line has something else, or the number of lines or columns differs.
    """
    if not text.strip():
        raise cut_off(path)  # np.loadtxt only warns
    if _ODD_NUMBER.search(text):
        text = _ODD_INFINITY.sub(b'inf', _ODD_NAN.sub(b'nan', text))
    whole = [place for place, kind in enumerate(kinds) if kind in ('i8', 'u8')]
    try:
        table = _loaded(text, np.dtype(np.float64), 2)
    except ValueError:
        raise ImportFileError(
            f'{path} has a line without {len(kinds)} numbers: save it again, or remove that line.'
        ) from None
    if table.shape != (rows, len(kinds)):
        raise ImportFileError(
            f'{path} should have {rows} lines of {len(kinds)} numbers, but has {table.shape[0]} of '
            f'{table.shape[1]}: it is cut off or its header is wrong; save it again.'
        )
    columns = [_as_stated(table[:, place], kind) for place, kind in enumerate(kinds)]
    if whole and (exact := _whole_columns(text, kinds)) is not None:
        for place in whole:  # float64 does not hold all of these
            columns[place] = exact[f'f{place}']
    return columns


def first(path: Path, data: bytes, size: int) -> bytes:
    """The first `size` bytes.

    Raises:
        ImportFileError: there are fewer.
    """
    if len(data) < size:
        raise cut_off(path)
    return data[:size]


def cut_off(path: Path) -> ImportFileError:
    """The error for a file that ends too early."""
    return ImportFileError(f'{path} is cut off: it has fewer points than its header says; save it again.')


def _as_stated(values: NDArray[np.float64], kind: str) -> FieldValues:
    """The values in the type of the header, if that holds them."""
    with np.errstate(invalid='ignore', over='ignore'):
        stated = values.astype(kind)
    if kind[0] == 'f':
        return stated if np.array_equal(np.isinf(stated), np.isinf(values)) else values
    return stated if np.array_equal(stated.astype(np.float64), values) else values


def _whole_columns(text: bytes, kinds: Sequence[str]) -> NDArray[np.void] | None:
    """The columns of 64-bit whole numbers exactly; None if one has something else."""
    record = np.dtype([(f'f{place}', kind if kind in ('i8', 'u8') else 'f8') for place, kind in enumerate(kinds)])
    try:
        return _loaded(text, record, 1)
    except ValueError:
        return None


def _loaded(text: bytes, kind: np.dtype[Number], dimensions: Literal[1, 2]) -> NDArray[Number]:
    """Load lines of numbers.

    Raises:
        ValueError: there are none, or a line has something else; older NumPy reads 1.5 as 1 and warns.
    """
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        try:
            return np.loadtxt(BytesIO(text), kind, ndmin=dimensions, comments=None)
        except Warning as warning:
            raise ValueError(warning) from None
