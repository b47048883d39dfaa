# SPDX-License-Identifier: Apache-2.0
"""Traits of communities: what a lesson tells outliers from a part's own texture by.

A community is a connected set of found points. Its traits are lengths relative to the spread of the
cloud, and numbers without a unit, so that neither the unit of the heights nor an offset or a tilt matters.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.kernels.union_find import root_of
from socialcircle_ros.settings.lessons import TRAITS

from .heights import RelativeHeights

_AROUND = 6
"""Width of the frame round a community whose kept points give the plane that its heights are measured from."""
_ACROSS = 64
"""Most rows and columns of the frame that are looked at; of a larger frame every second one, and so on."""
_LEAST_POINTS = 6
_FLAT = 1e-6
"""A determinant below this share of its first product means that the points do not span a plane."""
_HIGHEST_STEP = 50.0  # spreads
_TRAITS, _SIZE = len(TRAITS), TRAITS.index('size')
_LENGTHS = [2, 3, 4, 8, 9, 10]
"""Columns of the traits that are in spreads."""

Certainty = npt.NDArray[np.float32]
"""(H, W) float32: by the rules the steepness of the steepest community that a point belongs to, 1 for an isolated
point; by the network its probability."""

_PointNumbers = npt.NDArray[np.int64]
_CommunityNumbers = npt.NDArray[np.int64]
Traits = npt.NDArray[np.float64]
"""(n, 12) float64: a row for each community, the columns as in `settings.lessons.TRAITS`.

Sizes are logarithms, and so are lengths in spreads, to which 1 is added before."""


class Labelled(NamedTuple):
    """Points with the numbers of their communities.

    Attributes:
        points: (m,) numbered in row order.
        labels: (m,) the community of each, 0 to n - 1.
        number: n; a community may have no point.
    """

    points: _PointNumbers
    labels: _CommunityNumbers
    number: int


@dataclass(frozen=True, eq=False)
class Communities:
    """The communities of a mask.

    Attributes:
        points: (m,) the points of the mask, numbered in row order.
        labels: (m,) the community of each, 0 to n - 1.
        traits: (n, 12) float64.
    """

    points: _PointNumbers
    labels: _CommunityNumbers
    traits: Traits

    @property
    def sizes(self) -> _PointNumbers:
        """(n,) number of points of each community."""
        return np.bincount(self.labels, minlength=len(self.traits))


def communities_of(heights: RelativeHeights, found: Mask, certainty: Certainty, spread: float) -> Communities:
    """Measure the communities of the found points; points that touch at a corner belong together.

    Args:
        heights: (H, W) float32, NaN where not measured.
        found: (H, W) bool, measured points.
        certainty: how certainly each point is an outlier.
        spread: of the cloud, in its unit; above 0.
    """
    points, labels, number = label_communities(found)
    order = np.argsort(labels, kind='stable')
    starts = np.searchsorted(labels[order], np.arange(number + 1))
    measures = _measure(heights, found, certainty, points[order], starts, spread)
    traits = measures.copy()
    traits[:, _SIZE] = np.log(measures[:, _SIZE])
    traits[:, _LENGTHS] = np.log1p(measures[:, _LENGTHS])
    return Communities(points, labels, traits)


def label_communities(found: Mask) -> Labelled:
    """Number the connected sets of the found points; points that touch at a corner belong together."""
    points = np.flatnonzero(found)
    return Labelled(points, *_label(points, found.shape[1]))


@kernel
def _label(points: _PointNumbers, width: int) -> tuple[_CommunityNumbers, int]:
    """Number the connected sets of points, (m,) in row order, in the order of their first points."""
    parent = np.empty(points.size, np.int32)
    above = 0  # the first point that may touch from the row above
    for index in range(points.size):
        point = points[index]
        column = point % width
        root = index
        first = point - width - (1 if column > 0 else 0)
        last = point - width + (1 if column + 1 < width else 0)
        while points[above] < first:
            above += 1
        other = above
        parent[index] = index
        while points[other] <= last:
            root = _joined(parent, root, other)
            other += 1
        if column > 0 and index > 0 and points[index - 1] == point - 1:
            root = _joined(parent, root, index - 1)
    labels, number = np.empty(points.size, np.int64), 0
    for index in range(points.size):
        if parent[index] == index:
            labels[index] = number
            number += 1
        else:
            labels[index] = labels[parent[index]]
    return labels, number


@kernel
def _joined(parent: npt.NDArray[np.int32], root: int, other: int) -> int:
    """Join the set of `root` and that of another item; the root of the result is its first item."""
    there = root_of(parent, other)
    first, last = min(root, there), max(root, there)
    parent[last] = first
    return first


@kernel
def _measure(
    heights: RelativeHeights,
    found: Mask,
    certainty: Certainty,
    points: _PointNumbers,
    starts: _PointNumbers,
    spread: float,
) -> Traits:
    """The traits of each community, without logarithms; `points` are those of one community after another."""
    width = heights.shape[1]
    measures = np.empty((starts.size - 1, _TRAITS))
    plane = np.empty(5)
    for community in range(starts.size - 1):
        own = points[starts[community] : starts[community + 1]]
        size = own.size
        top, bottom, left, right = own[0] // width, own[0] // width, own[0] % width, own[0] % width
        for point in own:
            row, column = point // width, point % width
            top, bottom = min(top, row), max(bottom, row)
            left, right = min(left, column), max(right, column)
        base = np.float64(heights[own[0] // width, own[0] % width])
        _fit_plane(heights, found, (top, bottom, left, right), base, plane)
        total, squares, sizes, highest = 0.0, 0.0, 0.0, 0.0
        certain, most_certain = 0.0, 0.0
        for point in own:
            row, column = point // width, point % width
            rise = (np.float64(heights[row, column]) - base) - (
                plane[0] + plane[1] * (column - left) + plane[2] * (row - top)
            )
            rise /= spread
            total += rise
            squares += rise * rise
            sizes += abs(rise)
            highest = max(highest, abs(rise))
            certain += certainty[row, column]
            most_certain = max(most_certain, np.float64(certainty[row, column]))
        mean = total / size
        extent = max(bottom - top, right - left) + 1
        step, missing = _border(heights, found, own, spread)
        measures[community, 0] = size
        measures[community, 1] = 1.0 if mean > 0 else 0.0
        measures[community, 2] = sizes / size
        measures[community, 3] = highest
        measures[community, 4] = np.sqrt(max(squares / size - mean * mean, 0.0))
        measures[community, 5] = certain / size
        measures[community, 6] = most_certain
        measures[community, 7] = size / (extent * extent)
        measures[community, 8] = plane[3] / spread
        measures[community, 9] = np.sqrt(plane[1] * plane[1] + plane[2] * plane[2]) / spread
        measures[community, 10] = step
        measures[community, 11] = missing
    return measures


@kernel
def _fit_plane(
    heights: RelativeHeights,
    found: Mask,
    box: tuple[int, int, int, int],
    base: float,
    plane: npt.NDArray[np.float64],
) -> None:
    """Fit a plane to the kept points in and round a box, relative to `base` at the box's first corner.

    Args:
        heights: (H, W) float32, NaN where not measured.
        found: (H, W) bool, the points that do not count.
        box: first and last row, first and last column.
        base: a height that all heights are relative to.
        plane: (5,) receives height, slope along x, slope along y, root mean square residual, number of points.
    """
    height, width = heights.shape
    top, bottom, left, right = box
    first, last = max(0, top - _AROUND), min(height - 1, bottom + _AROUND)
    start, stop = max(0, left - _AROUND), min(width - 1, right + _AROUND)
    down, across = (last - first) // _ACROSS + 1, (stop - start) // _ACROSS + 1
    n, x1, y1, z1, xx, xy, yy, xz, yz = 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for row in range(first, last + 1, down):
        for column in range(start, stop + 1, across):
            if found[row, column] or np.isnan(heights[row, column]):
                continue
            x, y, z = float(column - left), float(row - top), np.float64(heights[row, column]) - base
            n += 1
            x1 += x
            y1 += y
            z1 += z
            xx += x * x
            xy += x * y
            yy += y * y
            xz += x * z
            yz += y * z
    plane[:] = 0.0
    plane[4] = n
    if n == 0:
        return
    # Moments about the mean; the plane is flat where the points lie on a line.
    xx, xy, yy = xx - x1 * x1 / n, xy - x1 * y1 / n, yy - y1 * y1 / n
    xz, yz = xz - x1 * z1 / n, yz - y1 * z1 / n
    determinant = xx * yy - xy * xy
    if n >= _LEAST_POINTS and determinant > _FLAT * xx * yy:
        plane[1] = (xz * yy - yz * xy) / determinant
        plane[2] = (yz * xx - xz * xy) / determinant
    plane[0] = (z1 - plane[1] * x1 - plane[2] * y1) / n
    squares = 0.0
    for row in range(first, last + 1, down):
        for column in range(start, stop + 1, across):
            if not found[row, column] and not np.isnan(heights[row, column]):
                left_over = (np.float64(heights[row, column]) - base) - (
                    plane[0] + plane[1] * (column - left) + plane[2] * (row - top)
                )
                squares += left_over * left_over
    plane[3] = np.sqrt(squares / n)


@kernel
def _border(heights: RelativeHeights, found: Mask, own: _PointNumbers, spread: float) -> tuple[float, float]:
    """Mean step from the points of a community to the kept points beside them, and the share not measured."""
    height, width = heights.shape
    total, steps, missing = 0.0, 0, 0
    for point in own:
        row, column = point // width, point % width
        for y in range(max(0, row - 1), min(height, row + 2)):
            for x in range(max(0, column - 1), min(width, column + 2)):
                if found[y, x]:
                    continue
                if np.isnan(heights[y, x]):
                    missing += 1
                else:
                    total += min(abs(np.float64(heights[row, column]) - heights[y, x]) / spread, _HIGHEST_STEP)
                    steps += 1
    return total / max(steps, 1), missing / max(steps + missing, 1)
