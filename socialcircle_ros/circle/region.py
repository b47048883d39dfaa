# SPDX-License-Identifier: Apache-2.0
"""The choice of the vote region T (section 3.2.1), where the user gives none.

The paper lets the user select a smooth area of at least 60×60 points. Here it is selected by a rule that is the
same for each cloud:

1. Candidates of 60×60 points begin at each 30th row and column, and at the last possible ones.
2. At most 64 of them, evenly spread, are compared, so that the choice takes the same time for any cloud.
3. Candidates with less than 95 % of their points measured are dropped.
4. The smoothest of the others is chosen: that with the lowest median of the second differences of its heights. A
   tilt has no second difference, and a few outliers do not change a median. Candidates with one height only come
   last, since such patches are more often a fill value than a surface.
5. If step 3 drops more than half of them, the measured points of all candidates are counted. Candidates with at
   least 95 % of the highest count take the place of the evenly spread ones.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Cloud, Memory, flattened, is_measured, load_row
from socialcircle_ros.errors import NoSeedError
from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .arrays import Floats, Floats64, Indices, Integers
from .selection import select

Region = tuple[int, int, int, int]
"""Row and column of the first point, height and width, in points."""

SIDE = 60
"""Side of a chosen region: the paper asks for at least 60 points."""

NOTHING_MEASURED = (
    'No point of the cloud is measured: each has a NaN or Inf coordinate, or counts as not measured.'
)
"""The refusal of a cloud without a measured point."""

CANDIDATES = 64
"""Most candidates that are compared."""

_WELL_MEASURED = 0.95


@dataclass(frozen=True, eq=False)
class _Axis:
    """The candidates along rows or along columns."""

    side: int
    """Of a candidate."""
    starts: Integers
    """(C,) where each candidate begins."""
    edges: Integers
    """(E,) all places where a candidate begins or ends, ascending."""
    first: Indices
    """(C,) the index of the edge where each candidate begins."""
    last: Indices
    """(C,) the index of the edge where each candidate ends."""


class _Smoothest(NamedTuple):
    """The smoothest of several candidates; of equally smooth ones the first."""

    roughness: float
    top: int
    left: int
    compared: int
    """How many candidates had enough measured points to be compared."""


class _RegionWork(NamedTuple):
    """Working memory for one candidate of h×w points."""

    line: Floats
    """(4, w + 2), of the cloud's type."""
    heights: Floats64
    """(h, w)."""
    differences: Floats64
    """(2, h, w) along rows and along columns. Comes full of NaN: the points at the ends have no difference."""
    known: Floats64
    """(2 h w,)."""


def choose_region(xyz: Cloud) -> Region:
    """Return a region T that is as fully measured and as smooth as possible.

    Args:
        xyz: (H, W, 3) organized cloud.

    Returns:
        The region; smaller than 60×60 only where the cloud is.

    Raises:
        NoSeedError: no point is measured.
    """
    rows, columns = (_candidates(extent) for extent in xyz.shape[:2])
    memory = flattened(xyz)
    sample = _evenly_spread(np.arange(len(rows.starts) * len(columns.starts)))
    chosen = _compare(memory, rows, columns, sample, _WELL_MEASURED * rows.side * columns.side)
    if 2 * chosen.compared < len(sample):
        counts = _count_candidates(memory, rows, columns)
        if counts.max() == 0:
            raise NoSeedError(NOTHING_MEASURED)
        least = _WELL_MEASURED * float(counts.max())
        chosen = _compare(memory, rows, columns, _evenly_spread(np.flatnonzero(counts >= least)), least)
    return chosen.top, chosen.left, rows.side, columns.side


@lru_cache(maxsize=8)
def _candidates(extent: int) -> _Axis:
    """Return the candidates along an axis of `extent` points. All clouds of an instrument have the same ones."""
    side = min(SIDE, extent)
    starts = np.union1d(np.arange(0, extent - side + 1, SIDE // 2), extent - side)
    edges = np.union1d(starts, starts + side)
    return _Axis(side, starts, edges, np.searchsorted(edges, starts), np.searchsorted(edges, starts + side))


def _evenly_spread(candidates: Indices) -> Indices:
    """Return at most 64 of the candidates."""
    if len(candidates) <= CANDIDATES:
        return candidates
    return candidates[np.arange(CANDIDATES) * len(candidates) // CANDIDATES]


def _compare(memory: Memory, rows: _Axis, columns: _Axis, candidates: Indices, least: float) -> _Smoothest:
    """Find the smoothest of the candidates that have at least `least` measured points.

    Args:
        memory: the cloud.
        rows: the candidates along rows.
        columns: the candidates along columns.
        candidates: (n,) indices of the candidates to compare, in row order of all.
        least: number of points.
    """
    height, width = rows.side, columns.side
    tops = rows.starts[candidates // len(columns.starts)]
    lefts = columns.starts[candidates % len(columns.starts)]

    def compare_band(band: slice) -> _Smoothest:
        work = _RegionWork(
            line=np.empty((4, width + 2), memory[0].dtype),
            heights=np.empty((height, width)),
            differences=np.full((2, height, width), np.nan),
            known=np.empty(2 * height * width),
        )
        roughness, best, compared = _find_smoothest(memory, tops[band], lefts[band], least, work)
        return _Smoothest(roughness, int(tops[band][best]), int(lefts[band][best]), compared)

    bands = in_bands(compare_band, len(tops), height * width)
    # Of equal roughness the first in row order: rows and columns are compared next.
    smoothest = min((band for band in bands if band.compared), default=bands[0])
    return smoothest._replace(compared=sum(band.compared for band in bands))


def _count_candidates(memory: Memory, rows: _Axis, columns: _Axis) -> Integers:
    """Count the measured points of all candidates, (n,), in row order, in one pass over the cloud.

    Candidates overlap. So the points between all edges are counted, and the counts are added up.
    """
    height, width = int(rows.edges[-1]), int(columns.edges[-1])
    between = np.zeros((len(rows.edges) - 1, width), np.uint8)  # at most 60 in a column between two edges

    def count(band: slice) -> None:
        line = np.empty((4, band.stop - band.start + 2), memory[0].dtype)
        _count_measured(memory, rows.edges, band.start, line, between[:, band])

    in_bands(count, width, height)
    cells = np.add.reduceat(between, columns.edges[:-1], axis=1, dtype=np.int64)
    sums = np.pad(cells.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    sums = sums[rows.last] - sums[rows.first]
    counts: Integers = sums[:, columns.last] - sums[:, columns.first]
    return counts.ravel()


@kernel
def _count_measured(
    memory: Memory, edges: Integers, left: int, line: Floats, between: npt.NDArray[np.uint8]
) -> None:
    """Count the measured points of each column between two rows of `edges`, (E,), and the next two.

    Args:
        memory: the cloud.
        edges: (E,).
        left: the first column.
        line: (4, columns + 2) working memory.
        between: (E - 1, columns) receives the counts; comes full of 0.
    """
    values, row_step, point_step = memory
    width = between.shape[1]
    for i in range(len(edges) - 1):
        counts = between[i]
        for row in range(edges[i], edges[i + 1]):
            load_row(values, row * row_step + left * point_step, point_step, width, line)
            x, y, z = line[0, 1:], line[1, 1:], line[2, 1:]
            for column in range(width):
                counts[column] += is_measured(x[column], y[column], z[column])


@kernel
def _find_smoothest(
    memory: Memory, tops: Integers, lefts: Integers, least: float, work: _RegionWork
) -> tuple[float, int, int]:
    """Find the smoothest of the candidates that have at least `least` measured points.

    Selecting a median is slower than counting. A count of the differences below the lowest roughness so far shows
    whether a candidate is smoother: more than half of them are. Of 64 candidates this leaves about five medians.

    Returns:
        The roughness, the index of the first candidate that has it, and the number of candidates compared.
    """
    values, row_step, point_step = memory
    line, heights, differences, known = work
    height, width = heights.shape
    best, roughness, compared = 0, math.inf, 0
    for candidate in range(len(tops)):
        count = 0
        first, varies = np.nan, False
        for row in range(height):
            start = (tops[candidate] + row) * row_step + lefts[candidate] * point_step
            load_row(values, start, point_step, width, line)
            x, y, z = line[0, 1:], line[1, 1:], line[2, 1:]
            for column in range(width):
                measured = is_measured(x[column], y[column], z[column])
                heights[row, column] = z[column] if measured else np.nan
                count += measured
                if measured:
                    first = z[column] if np.isnan(first) else first
                    varies |= z[column] != first
        if count < least:
            continue
        best = best if compared else candidate
        compared += 1
        if not varies:
            continue
        n, below = _second_differences(heights, differences, roughness)
        rank = (n - 1) // 2
        if n and below > rank:
            n = 0
            for axis in range(2):
                for row in range(height):
                    for difference in differences[axis, row]:
                        known[n] = difference
                        n += not np.isnan(difference)
            best, roughness = candidate, select(known[:n], rank)
    return roughness, best, compared


@kernel
def _second_differences(heights: Floats64, differences: Floats64, limit: float) -> tuple[int, int]:
    """Write |(a - b) - (b - c)| of three neighbouring heights; NaN where one of them is not measured.

    The loops have no branch, so that LLVM vectorises them.

    Returns:
        How many differences are known, and how many are below the limit.
    """
    height, width = heights.shape
    n, below = 0, 0
    for row in range(height):
        before, here, behind = heights[row], heights[row, 1:], heights[row, 2:]
        along = differences[0, row]
        for column in range(width - 2):
            b = here[column]
            difference = abs((before[column] - b) - (b - behind[column]))
            along[column] = difference
            n += difference == difference  # noqa: PLR0124 — not NaN
            below += difference < limit
    for row in range(1, height - 1):
        above, here, under, across = heights[row - 1], heights[row], heights[row + 1], differences[1, row]
        for column in range(width):
            b = here[column]
            difference = abs((above[column] - b) - (b - under[column]))
            across[column] = difference
            n += difference == difference  # noqa: PLR0124
            below += difference < limit
    return n, below
