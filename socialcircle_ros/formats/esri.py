# SPDX-License-Identifier: Apache-2.0
"""ASCII grids of ESRI: a header with the pitch and the mark of what was not measured, then rows from the top."""

from pathlib import Path
from typing import TextIO

import numpy as np

from socialcircle_ros.digits import size_text
from socialcircle_ros.errors import ImportFileError

from .surface import SOURCE_FORMAT, MeasuredSurface
from .text import open_text

_NAMES = (
    *('ncols', 'nrows', 'xllcorner', 'yllcorner', 'xllcenter', 'yllcenter', 'cellsize', 'dx', 'dy'),
    'nodata_value',
)
_CORNERS = ('xllcorner', 'yllcorner', 'xllcenter', 'yllcenter')
_NO_DATA = -9999.0  # in a file that names none
_NO_HEIGHT = 1e30  # a mark beyond is the end of float32, which the header and the numbers may round differently

GRID = 'ASCII grid of ESRI'
"""What an ASCII grid is, as `SOURCE_FORMAT`."""


def is_esri_grid(path: Path) -> bool:
    """Whether a text begins with the numbers of columns and rows, as an ASCII grid does."""
    with open_text(path) as file:
        return {'ncols', 'nrows'} <= set(_header(file))


def read_esri_grid(path: Path) -> MeasuredSurface:
    """Read an ASCII grid; it does not name its unit.

    The file begins with the row of the greatest y, the surface with that of the least: y is row · dy. The place of
    the lower left corner is kept as metadata.

    Raises:
        ImportFileError: the header lacks something, or the file has other numbers than it states.
    """
    with open_text(path) as file:
        entries = _header(file)
        words = file.read().split()
    try:
        rows, columns = int(entries['nrows']), int(entries['ncols'])
        dx, dy = (float(entries.get(name) or entries['cellsize']) for name in ('dx', 'dy'))
        no_data = float(entries.get('nodata_value', _NO_DATA))
        heights = np.array(words, np.float64)
    except (ValueError, KeyError):
        raise ImportFileError(
            f'{path} is an ASCII grid with a word that is no number, or without a cell size: save it again.'
        ) from None
    if min(rows, columns) < 1 or not all(0 < each < np.inf for each in (dx, dy)):
        raise ImportFileError(f'{path} is an ASCII grid without rows and columns, or without a cell size above 0.')
    if heights.size != rows * columns:
        raise ImportFileError(
            f'{path} has {heights.size} heights, not {size_text(rows, columns)}: it is damaged or cut off;'
            ' save it again.'
        )
    heights[np.abs(heights) > _NO_HEIGHT if abs(no_data) > _NO_HEIGHT else heights == no_data] = np.nan
    metadata = {SOURCE_FORMAT: GRID} | {name: entries[name] for name in _CORNERS if name in entries}
    return MeasuredSurface(
        np.ascontiguousarray(heights.reshape(rows, columns)[::-1]), (dx, dy), None, {}, metadata
    )


def _header(file: TextIO) -> dict[str, str]:
    """The entries before the numbers, by their names in lower case; the file is left at the first number."""
    entries: dict[str, str] = {}
    while True:
        place = file.tell()
        line = file.readline(200)
        words = line.split()
        if not line or (words and (len(words) != 2 or words[0].lower() not in _NAMES)):
            file.seek(place)
            return entries
        if words:
            entries[words[0].lower()] = words[1]
