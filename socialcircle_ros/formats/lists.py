# SPDX-License-Identifier: Apache-2.0
"""Lists of points as text, x, y and z per line, onto the grid on which they were measured.

Many programs leave points out that were not measured. Where the grid is certain, these places are NaN.
"""

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import NamedTuple, TextIO, cast

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.digits import size_text
from socialcircle_ros.errors import ImportFileError

from .surface import SOURCE_FORMAT, OrganizedCloud
from .text import open_text

_MOST_HEADER_LINES = 100
_LARGEST_DEVIATION = 1e-2  # of the pitch, from a regular grid
_LEAST_FILLED = 0.25  # of the places of the grid; fewer points do not make a grid certain
_MOST_DIGITS = 12
_FARTHEST = 1e150  # coordinate, so that the fit of the spacing can square it

LIST = 'text file with x, y and z per line'
"""What a list of points is, as `SOURCE_FORMAT`."""


class _ListLayout(NamedTuple):
    """How a list is written.

    Attributes:
        skipped: lines before the first point.
        separator: between the numbers; None: spaces or tabs.
        comma: whether a comma is the decimal point.
    """

    skipped: int
    separator: str | None
    comma: bool


class _Spacing(NamedTuple):
    """Evenly spaced coordinates, and the largest deviation from these."""

    start: float
    pitch: float
    deviation: float


def read_list(path: Path, *, matrix_wanted: bool = False) -> OrganizedCloud | None:
    """Read a list of points; None if the file is a matrix of heights.

    Lines of other than three numbers are a matrix. Lines of three numbers are points if these lie on a regular
    grid, some of them on one row of it and some on one column; the three lines of a small matrix hardly do.

    Args:
        path: of the file.
        matrix_wanted: whether lines of three numbers without a certain grid are a matrix; else they are refused.

    Raises:
        ImportFileError: the points do not lie on a regular grid, or too few of them to be certain of it.
    """
    try:
        return _read_list(path)
    except ImportFileError:
        if matrix_wanted:
            return None
        raise


def _read_list(path: Path) -> OrganizedCloud | None:
    with open_text(path) as file:
        layout = _layout(file)
        if layout is None:
            return None
        file.seek(0)
        lines = _lines(file, layout)
        try:
            table = np.loadtxt(lines, np.float64, delimiter=layout.separator, ndmin=2, comments='#')
        except ValueError:
            return None
    if table.shape[1] != 3:
        return None
    table = table[np.isfinite(table[:, :2]).all(axis=1)]
    farthest = np.abs(table[:, :2]).max(initial=0)
    if farthest > _FARTHEST:
        raise _uncertain(path, f'x or y reaches {farthest:.2g}')
    for place, line in enumerate(('column', 'row')):
        if len(np.unique(table[:, place])) == len(table):  # as in the few lines of a matrix of heights
            raise _uncertain(path, f'no two points lie on one {line} of it')
    columns, rows = (_places(path, table[:, place], axis) for place, axis in enumerate('xy'))
    shape = int(rows.max()) + 1, int(columns.max()) + 1
    places = rows * shape[1] + columns
    if len(table) < _LEAST_FILLED * shape[0] * shape[1]:
        raise _uncertain(path, f'{len(table)} points lie on {size_text(*shape)}')
    if len(np.unique(places)) != len(places):
        raise _uncertain(path, 'two of its points lie on the same place of the grid')
    points = np.full((shape[0] * shape[1], 3), np.nan)
    points[places] = table
    with np.errstate(over='ignore'):
        single = points.astype(np.float32)
    exact = np.array_equal(single.astype(np.float64), points, equal_nan=True)
    return OrganizedCloud((single if exact else points).reshape(*shape, 3), metadata={SOURCE_FORMAT: LIST})


def no_list(path: Path) -> ImportFileError:
    """The error for a text that is neither a list of points nor a matrix with commas: which line is wrong.

    Raises:
        OSError: it cannot be read.
    """
    with open_text(path) as file:
        layout = _layout(file)
        if layout is None:
            return ImportFileError(
                f'{path} has neither lines with x, y and z nor a matrix with commas: save it as one of these.'
            )
        file.seek(0)
        for number, line in enumerate(_lines(file, layout), layout.skipped + 1):
            numbers = line.partition('#')[0]
            if numbers.strip() and _numbers(numbers, layout) != 3:
                return ImportFileError(
                    f'{path} has other than x, y and z in line {number}: it is damaged or cut off; save it again.'
                )
    return ImportFileError(f'{path} has a number that cannot be read: save it again.')


def _layout(file: TextIO) -> _ListLayout | None:
    """How the first line with three numbers is written; None if there is none, or one with more comes first."""
    for number, line in enumerate(islice(file, _MOST_HEADER_LINES)):
        if not line.strip() or line.lstrip().startswith('#'):
            continue
        for layout in (
            _ListLayout(number, ';', comma=True),
            _ListLayout(number, ',', comma=False),
            _ListLayout(number, None, comma=False),
        ):
            numbers = _numbers(line, layout)
            if numbers:
                return layout if numbers == 3 else None
    return None


def _numbers(line: str, layout: _ListLayout) -> int:
    """The number of values in a line; 0 if one of them is no number."""
    text = line.replace(',', '.') if layout.comma else line
    words = text.strip().split(layout.separator)
    try:
        return len([float(word) for word in words])
    except ValueError:
        return 0


def _lines(file: TextIO, layout: _ListLayout) -> Iterator[str]:
    for line in islice(file, layout.skipped, None):
        yield line.replace(',', '.') if layout.comma else line


def _places(path: Path, values: NDArray[np.float64], axis: str) -> NDArray[np.intp]:
    """The place of each point along an axis of the grid, from 0, in ascending order of the coordinates.

    Raises:
        ImportFileError: the coordinates are not evenly spaced.
    """
    distinct = np.unique(values)
    gaps = np.diff(distinct)
    if not gaps.size:
        raise _uncertain(path, f'all its points have the same {axis}')
    # Coordinates of one column may differ by rounding; such gaps are far below those between columns. A column
    # without a point makes a wider gap, so the least gap is tried as well.
    between = gaps[gaps > gaps.max() * _LARGEST_DEVIATION]
    fits = [_even_spacing(distinct, float(guess)) for guess in (np.median(between), between.min())]
    best = min(fits, key=lambda fit: fit.deviation / fit.pitch)
    if not best.deviation <= max(_LARGEST_DEVIATION * best.pitch, min(_rounding(distinct), best.pitch / 10)):
        raise _uncertain(path, f'{axis} is off even spacing by {best.deviation / best.pitch:.2g} of the pitch')
    places = np.round((values - best.start) / best.pitch).astype(np.intp)
    return cast('NDArray[np.intp]', places - places.min())


def _even_spacing(distinct: NDArray[np.float64], pitch: float) -> _Spacing:
    """The even spacing that fits coordinates best, from a first guess of the pitch."""
    for _ in range(3):
        places = np.round((distinct - distinct[0]) / pitch)
        pitch = float(np.polyfit(places, distinct - distinct[0], 1)[0])
    start = float(np.mean(distinct - places * pitch))
    return _Spacing(start, pitch, float(np.abs(distinct - start - places * pitch).max()))


def _rounding(values: NDArray[np.float64]) -> float:
    """Half a unit of the last decimal digit in which values are written, with some room."""
    for digits in range(_MOST_DIGITS):
        scaled = values * 10.0**digits
        if np.allclose(scaled, np.round(scaled), rtol=1e-12, atol=1e-4):
            return 0.51 * 10.0**-digits
    return 0.0


def _uncertain(path: Path, why: str) -> ImportFileError:
    heights = '' if path.suffix.lower() == '.xyz' else ' If each line is three heights, import it with --pitch.'
    return ImportFileError(
        f'{path} has x, y and z per line, but no certain grid: {why}. Export it as a matrix, with every point, or'
        f' as ply or x3p.{heights}'
    )
