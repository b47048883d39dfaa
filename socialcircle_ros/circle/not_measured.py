# SPDX-License-Identifier: Apache-2.0
"""Points that a driver or a file marks as not measured by a number instead of NaN.

Two marks are recognised, besides NaN and infinite coordinates:

1. One exact point, such as (0, 0, 0), at many places of the grid. Measured points differ in x or y.
2. One exact height, such as z = 0, on a grid with x and y. A surface can have equal heights, so more is required:
   the height is 0 or very far away; no other height lies beyond it; and it occurs five times as often as any
   other, on 2 % of the points at least, but on less than half.

Another height that is frequent and stands apart may be a mark, or a cluster of outliers. It is left as it is,
and a sentence names it.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import cast

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Cloud, Mask, measured_only

from .arrays import Floats, Indices, Real

AUTO, ONLY_NAN = 'auto', 'nan'
"""Values of `circle.not_measured` besides a number."""

_SAMPLE = 2048
"""Points that are examined for a mark."""

_LEAST_POINTS = 64
"""Fewer points at one place are no mark: a simulated or rounded cloud can have them."""

_LEAST_SHARE = 0.02
"""Share of the points that a height must have to be a mark; clusters of outliers are smaller."""

_DOUBTFUL_SHARE = 0.05
"""Share of the points from which on a warning names another height that stands apart."""

_MOST_SHARE = 0.5

_FREQUENT = 5
"""A mark occurs so many times as often as any other height."""

_FEW_HEIGHTS = 6
"""A surface with fewer heights is a drawn one, with flat steps; none of its heights is doubtful."""

_GAP, _VERY_FAR = 0.25, 100.0
"""Distance from the next height, in ranges of the central 90 % of the others: of a mark of 0, and of any other."""

COUNT_AS = f"and count as not measured; set circle.not_measured to '{ONLY_NAN}' if they are measured."
"""How every note on points that count as not measured ends."""


@dataclass(frozen=True, eq=False)
class NotMeasured:
    """What was recognised.

    Attributes:
        points: (H, W) the points with a mark; None: there is no such point.
        note: what was done; '': nothing.
        doubt: what may be a mark and was left as it is; '': nothing.
    """

    points: Mask | None = None
    note: str = ''
    doubt: str = ''


def recognise(xyz: Cloud, rule: str) -> NotMeasured:
    """Find the points that a mark calls not measured.

    Args:
        xyz: (H, W, 3) organized cloud.
        rule: 'auto': both marks are looked for; 'nan': none is; a number as text: this height.
    """
    if rule == ONLY_NAN:
        return NotMeasured()
    if rule != AUTO:
        with np.errstate(over='ignore'):
            mark = xyz.dtype.type(float(rule))
        # A height that the data type does not hold is that of no point.
        return _marked_height(xyz, mark, 'as circle.not_measured says') if np.isfinite(mark) else NotMeasured()
    height, width = xyz.shape[:2]
    rows, columns = _places(height, width)
    sample = xyz[rows, columns]
    sample = sample[np.isfinite(sample).all(axis=1)]
    if len(sample) < _LEAST_POINTS:
        return NotMeasured()
    heights, counts = np.unique(cast('npt.NDArray[np.floating]', sample[:, 2]), return_counts=True)
    point = _repeated_point(sample, heights[np.argmax(counts)])
    if point is not None:
        points = _equal(xyz, point)
        count = np.count_nonzero(points)
        if count >= _LEAST_POINTS:
            where = ', '.join(f'{value:g}' for value in point.tolist())
            return NotMeasured(points, f'{count} points are exactly at ({where}) {COUNT_AS}')
    return _far_height(xyz, heights, counts)


def without_marks(xyz: Cloud, rule: str) -> Cloud:
    """The cloud with NaN at the points that a mark calls not measured; itself if there are none.

    Args:
        xyz: (H, W, 3), unchanged.
        rule: as for `recognise`.
    """
    marked = recognise(xyz, rule).points
    return xyz if marked is None else measured_only(xyz, ~marked)


@lru_cache(maxsize=8)
def _places(height: int, width: int) -> tuple[Indices, Indices]:
    """Rows and columns of the sample: the same random ones for all clouds of a size."""
    places = np.sort(np.random.default_rng(0).integers(height * width, size=_SAMPLE))
    places = np.unique(places)
    return places // width, places % width


def _repeated_point(sample: Floats, height: Real) -> Floats | None:
    """(3,) the point at the most frequent height, if the sample holds it more than once; else None."""
    same = sample[sample[:, 2] == height]
    first = same[0]
    return first if np.count_nonzero((same == first).all(axis=1)) > 1 else None


def _far_height(xyz: Cloud, heights: npt.NDArray[np.floating], counts: Indices) -> NotMeasured:
    """Recognise one exact height that is far from all others.

    Args:
        xyz: (H, W, 3).
        heights: (n,) distinct heights of the sample, ascending.
        counts: (n,) how often the sample holds each.
    """
    if len(heights) < 3:
        return NotMeasured()
    total = int(counts.sum())
    end = 0 if counts[0] >= counts[-1] else -1
    share = counts[end] / total
    others, other_counts = np.delete(heights, end), np.delete(counts, end)
    low, high = np.quantile(others, [0.05, 0.95])
    gap = abs(float(heights[end]) - float(others[end]))
    distance = gap / float(high - low) if high > low else np.inf
    mark = heights[end]
    if not _LEAST_SHARE <= share < _MOST_SHARE or distance <= _GAP:
        return NotMeasured()
    stands_out = mark == 0 or distance > _VERY_FAR
    if not stands_out or counts[end] < _FREQUENT * other_counts.max():
        if share < _DOUBTFUL_SHARE or len(others) < _FEW_HEIGHTS:
            return NotMeasured()
        return NotMeasured(
            doubt=f'about {100 * share:.1f} % of the points have exactly the height {mark:g}, far from all others;'
            f" if they are not measured, set circle.not_measured to '{mark:g}'."
        )
    return _marked_height(xyz, mark, 'far from all others')


def _marked_height(xyz: Cloud, mark: Real, reason: str) -> NotMeasured:
    points = xyz[..., 2] == mark
    count = np.count_nonzero(points)
    if count == 0:
        return NotMeasured()
    return NotMeasured(points, f'{count} points have exactly the height {mark:g}, {reason}, {COUNT_AS}')


def _equal(xyz: Cloud, point: Floats) -> Mask:
    """(H, W) the points that are exactly at `point`."""
    equal: Mask = (xyz[..., 2] == point[2]) & (xyz[..., 1] == point[1]) & (xyz[..., 0] == point[0])
    return equal
