"""The choice of the vote region T (section 3.2.1)."""

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Cloud, Memory, flattened, is_measured, load_row
from socialcircle_ros.errors import NoSeedError
from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .selection import select

Region = tuple[int, int, int, int]
"""Row and column of the first point, height and width, in points."""

SIDE = 60
"""Side of a chosen region: the paper wants at least 60 points."""

CANDIDATES = 64
"""So many candidates are compared for their roughness, so that the choice costs the same for any cloud."""

_WELL_MEASURED = 0.95


def choose_region(xyz: Cloud) -> Region:
    """A region T that is as fully measured and as smooth as possible, always the same for the same cloud.

    Candidates of 60×60 points stand half a side apart, and 64 of them, evenly picked, are looked at. Of those
    with at least 95 % of their points measured, the one with the least median second difference of the heights
    wins: a tilt or a few outliers do not make a surface rough. Where these are less than half, all candidates are
    counted, and 64 of those with at least 95 % of the best one's measured points are compared instead.

    Args:
        xyz: (H, W, 3) organized cloud.

    Returns:
        The region, smaller than 60×60 only where the cloud is.

    Raises:
        NoSeedError: nothing is measured.
    """
    rows, columns = (_candidates(extent) for extent in xyz.shape[:2])
    height, width = rows.side, columns.side
    memory = flattened(xyz)

    def compare(picked: npt.NDArray[np.intp], least: float) -> tuple[int, int, int]:
        tops = rows.starts[picked // len(columns.starts)]
        lefts = columns.starts[picked % len(columns.starts)]

        def compare_band(band: slice) -> tuple[float, int, int]:
            differences = np.full((2, height, width), np.nan)  # along rows, along columns; the ends have none
            line, heights = np.empty((4, width + 2), xyz.dtype), np.empty((height, width))
            work = line, heights, differences, np.empty(differences.size)
            roughness, best, count = _smoothest(*memory, tops[band], lefts[band], least, *work)
            return roughness, band.start + best, count

        found = [band for band in in_bands(compare_band, len(tops), height * width) if band[2]]
        _, best, _ = min(found, default=(math.inf, 0, 0))
        return int(tops[best]), int(lefts[best]), sum(count for *_, count in found)

    picked = _evenly_picked(np.arange(len(rows.starts) * len(columns.starts)))
    top, left, count = compare(picked, _WELL_MEASURED * height * width)
    if 2 * count < len(picked):
        counts = _count_candidates(memory, rows, columns, xyz.shape[:2])
        if counts.max() == 0:
            raise NoSeedError('Nothing is measured in this cloud: each of its points has a NaN or Inf coordinate.')
        least = _WELL_MEASURED * float(counts.max())
        top, left, _ = compare(_evenly_picked(np.flatnonzero(counts >= least)), least)
    return top, left, height, width


def _evenly_picked(candidates: npt.NDArray[np.intp]) -> npt.NDArray[np.intp]:
    """At most 64 of them."""
    if len(candidates) <= CANDIDATES:
        return candidates
    return candidates[np.arange(CANDIDATES) * len(candidates) // CANDIDATES]


def _count_candidates(
    memory: Memory, rows: '_Candidates', columns: '_Candidates', shape: tuple[int, int]
) -> npt.NDArray[np.int64]:
    """How many points of each of all candidates are measured, (n,), in row order, from one pass over the cloud.

    Candidates overlap: measured points are counted between all of their edges, and then added up.
    """
    between = np.zeros((len(rows.edges) - 1, shape[1]), np.uint8)  # a side has fewer than 256 points

    def count(band: slice) -> None:
        line = np.empty((4, band.stop - band.start + 2), memory[0].dtype)
        _count_measured(*memory, rows.edges, band.start, line, between[:, band])

    in_bands(count, shape[1], shape[0])
    cells = np.add.reduceat(between, columns.edges[:-1], axis=1, dtype=np.int64)
    sums = np.pad(cells.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    sums = sums[rows.last] - sums[rows.first]
    counts: npt.NDArray[np.int64] = sums[:, columns.last] - sums[:, columns.first]
    return counts.ravel()


class _Candidates(NamedTuple):
    """Where candidates lie along an axis: the last one ends with it."""

    side: int
    starts: npt.NDArray[np.int64]
    edges: npt.NDArray[np.int64]
    """All places where one begins or ends, ascending."""
    first: npt.NDArray[np.intp]
    """Which edge each begins with."""
    last: npt.NDArray[np.intp]
    """Which edge each ends with."""


@lru_cache(maxsize=8)
def _candidates(extent: int) -> _Candidates:
    """The candidates along an axis of `extent` points; it is the same for all clouds of an instrument."""
    side = min(SIDE, extent)
    starts = np.union1d(np.arange(0, extent - side + 1, SIDE // 2), extent - side)
    edges = np.union1d(starts, starts + side)
    return _Candidates(side, starts, edges, np.searchsorted(edges, starts), np.searchsorted(edges, starts + side))


@kernel
def _count_measured(
    values: Any, row_step: int, point_step: int, edges: Any, left: int, line: Any, between: Any
) -> None:
    """Count each column's measured points between two `edges`, (E,), which are rows, and the next two.

    One pass over the columns from `left` on; `between`, (E - 1, columns), comes as 0, `line` is a row for work.
    """
    width = between.shape[1]
    for i in range(len(edges) - 1):
        counts = between[i]
        for row in range(edges[i], edges[i + 1]):
            load_row(values, row * row_step + left * point_step, point_step, width, line)
            x, y, z = line[0, 1:], line[1, 1:], line[2, 1:]
            for column in range(width):
                counts[column] += is_measured(x[column], y[column], z[column])


@kernel
def _smoothest(
    values: Any,
    row_step: int,
    point_step: int,
    tops: Any,
    lefts: Any,
    enough: float,
    line: Any,
    heights: Any,
    differences: Any,
    known: Any,
) -> tuple[float, int, int]:
    """Compare the candidates with `enough` measured points. The arrays behind `enough` are for work.

    A candidate's roughness is sought only where it is below the least so far, and that a count tells: more
    than half of its differences are below. Of 64 candidates this leaves the median of about five.

    Returns how rough the least rough one is, which it is, the first of equally rough ones, and how many there are.
    """
    height, width = heights.shape
    best, least, compared = 0, math.inf, 0
    for candidate in range(len(tops)):
        count = 0
        for row in range(height):
            start = (tops[candidate] + row) * row_step + lefts[candidate] * point_step
            load_row(values, start, point_step, width, line)
            x, y, z = line[0, 1:], line[1, 1:], line[2, 1:]
            for column in range(width):
                measured = is_measured(x[column], y[column], z[column])
                heights[row, column] = z[column] if measured else np.nan
                count += measured
        if count < enough:
            continue
        best = best if compared else candidate
        compared += 1
        n, below = _second_differences(heights, differences, least)
        rank = (n - 1) // 2
        if n and below > rank:
            n = 0
            for axis in range(2):
                for row in range(height):
                    for difference in differences[axis, row]:
                        known[n] = difference
                        n += not np.isnan(difference)
            best, least = candidate, select(known[:n], rank)
    return least, best, compared


@kernel
def _second_differences(heights: Any, differences: Any, least: float) -> tuple[int, int]:
    """Write |(a - b) - (b - c)| of three neighbours' heights; how many are known, how many below `least`.

    Where one of the three is not measured, the difference is NaN. Loops without a branch are vectorised.
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
            below += difference < least
    for row in range(1, height - 1):
        above, here, under, across = heights[row - 1], heights[row], heights[row + 1], differences[1, row]
        for column in range(width):
            b = here[column]
            difference = abs((above[column] - b) - (b - under[column]))
            across[column] = difference
            n += difference == difference  # noqa: PLR0124
            below += difference < least
    return n, below
