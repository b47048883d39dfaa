# SPDX-License-Identifier: Apache-2.0
"""Islands that belong to the surface's own texture: many of one height, which together cover much of it.

The heights of outliers are random; an etched layer, a print or a lattice has islands of one height. The rule keeps
all islands of that height, or none. So it also tells when it decided narrowly, and when islands were removed that
are too few for a texture, but hardly have one height by chance, such as the pins of a connector.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask
from socialcircle_ros.kernels.compiled import kernel

from .communities import Labelled
from .heights import RelativeHeights

LEAST_COVER = 0.015
"""Islands of one height that cover a smaller share of the measured points are outliers nonetheless."""
NARROWLY = 0.85
"""The rule decided narrowly if limits that are lower by this factor, or higher by it, change the decision."""


class Islands(NamedTuple):
    """How many islands, and how large they are.

    Attributes:
        number: of islands.
        points: of all of them.
        largest: points of the largest.
    """

    number: int
    points: int
    largest: int


NO_ISLANDS = Islands(0, 0, 0)


@dataclass(frozen=True, eq=False)
class OneHeight:
    """What islands of one height were found to be.

    Attributes:
        kept: (H, W) bool, the points that belong to the surface.
        number: of their islands.
        narrowly: whether they were kept narrowly.
        alike: points of removed islands that may be parts of the surface: they missed the limits narrowly, or have
            one height all the same; (n,) numbered in row order.
        removed: these islands.
    """

    kept: Mask
    number: int
    narrowly: bool
    alike: npt.NDArray[np.int64]
    removed: Islands


class _Alike(NamedTuple):
    """What islands of one height need.

    Attributes:
        size: least points of an island; the height of a smaller one is too uncertain.
        ratio: greatest ratio of the heights.
        number: least number of islands.
        even: least value of (Σ size)² / Σ size², which is the number of islands if all are equally large. A few
            large outliers and some small ones of their height are no texture.
        share: least share of the points of all islands of at least `size`.
        cover: least share of the measured points.
    """

    size: int
    ratio: float
    number: float
    even: float
    share: float
    cover: float

    def times(self, factor: float) -> '_Alike':
        """The same with limits that are larger by a factor; sizes and heights stay."""
        return self._replace(
            number=factor * self.number,
            even=factor * self.even,
            share=factor * self.share,
            cover=factor * self.cover,
        )


_TEXTURE = _Alike(size=4, ratio=1.35, number=8, even=7.0, share=0.5, cover=LEAST_COVER)
"""`even` is below `number`, so that eight islands need not be equal to the point."""
_SUSPECT = _Alike(size=36, ratio=1.1, number=4, even=3.0, share=0.5, cover=0.0)
"""Four of that size have heights within a tenth by chance in about 1 of 100 clouds."""
_SAMPLE = 16_384  # points that tell the tilt


def islands_of_one_height(heights: RelativeHeights, islands: Mask, communities: Labelled) -> OneHeight:
    """Find the islands that share a height above or below their surroundings.

    Args:
        heights: (H, W) float32, NaN where not measured.
        islands: (H, W) bool, points of islands and isolated points.
        communities: of these points.
    """
    kept: Mask = np.zeros(islands.shape, np.bool_)
    points, labels, count = communities
    sizes = np.bincount(labels, minlength=count)
    # Rises and falls count alike: a layer that covers half of the surface has islands on both sides.
    rises = np.abs(_rises(heights, _tilt(heights), islands, communities))
    measured = int(np.count_nonzero(np.isfinite(heights)))

    def points_of(chosen: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        return points[np.isin(labels, chosen)]

    texture = _alike(rises, sizes, measured, _TEXTURE)
    if texture.size:
        kept.flat[points_of(texture)] = True
        narrowly = not _alike(rises, sizes, measured, _TEXTURE.times(1 / NARROWLY)).size
        return OneHeight(kept, texture.size, narrowly, points[:0], NO_ISLANDS)
    alike = _alike(rises, sizes, measured, _TEXTURE.times(NARROWLY))
    if not alike.size:
        alike = _alike(rises, sizes, measured, _SUSPECT)
    return OneHeight(kept, 0, False, points_of(alike), islands_among(sizes[alike]))


def islands_among(sizes: npt.NDArray[np.int64]) -> Islands:
    """Sum up islands of these sizes, (n,)."""
    return Islands(sizes.size, int(sizes.sum()), int(sizes.max(initial=0)))


def _alike(
    rises: npt.NDArray[np.float64], sizes: npt.NDArray[np.int64], measured: int, least: _Alike
) -> npt.NDArray[np.int64]:
    """The numbers of the islands of one height: of those sets that have what is needed, the one of most points."""
    candidates = np.flatnonzero((sizes >= least.size) & (rises > 0))
    candidates = candidates[np.argsort(rises[candidates], kind='stable')]
    height, size = rises[candidates], sizes[candidates]
    ends = np.searchsorted(height, least.ratio * height, 'right')
    points, squares = (sums[ends] - sums[:-1] for sums in (_sums(size), _sums(size**2)))
    enough = (ends - np.arange(ends.size) >= least.number) & (points**2 >= least.even * squares)
    enough &= points >= max(least.share * size.sum(), least.cover * measured)
    if not enough.any():
        return candidates[:0]
    first = int(np.argmax(np.where(enough, points, 0)))
    return candidates[first : ends[first]]


def _sums(values: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """The sums of the first 0, 1, 2, … values."""
    return np.concatenate([[0], np.cumsum(values)])


def _tilt(heights: RelativeHeights) -> tuple[float, float]:
    """The median differences from a column to the next, and from a row to the next, of some rows."""
    stride = heights.size // _SAMPLE | 1  # odd: some are measured where every second row is
    with np.errstate(invalid='ignore', over='ignore'):
        along_rows = np.diff(heights[::stride], axis=1)
        along_columns = heights[1::stride] - heights[:-1:stride]
    known = (differences[np.isfinite(differences)] for differences in (along_rows, along_columns))
    column, row = (float(np.median(each)) if each.size else 0.0 for each in known)
    return column, row


@kernel
def _rises(
    heights: RelativeHeights, tilt: tuple[float, float], islands: Mask, communities: Labelled
) -> npt.NDArray[np.float64]:
    """(n,) mean height of each island above the kept points that touch it, 0 where it is unknown.

    Heights count from the tilt: the points that touch an island do not lie evenly around it.
    """
    height, width = islands.shape
    number = communities.number
    inside, inside_count = np.zeros(number), np.zeros(number, np.int64)
    outside, outside_count = np.zeros(number), np.zeros(number, np.int64)
    for index in range(communities.points.size):
        point, label = communities.points[index], communities.labels[index]
        row, column = point // width, point % width
        if not np.isnan(heights[row, column]):
            inside[label] += heights[row, column] - tilt[0] * column - tilt[1] * row
            inside_count[label] += 1
        for y in range(max(0, row - 1), min(height, row + 2)):
            for x in range(max(0, column - 1), min(width, column + 2)):
                if not islands[y, x] and not np.isnan(heights[y, x]):
                    outside[label] += heights[y, x] - tilt[0] * x - tilt[1] * y
                    outside_count[label] += 1
    rises = np.zeros(number)
    for label in range(number):
        if inside_count[label] and outside_count[label]:
            rises[label] = inside[label] / inside_count[label] - outside[label] / outside_count[label]
    return rises
