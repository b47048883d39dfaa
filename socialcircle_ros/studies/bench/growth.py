# SPDX-License-Identifier: Apache-2.0
"""Growth of the filter's time with the size of the cloud, from 0.1 to 50 million points."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from socialcircle_ros.pictures.style import new_figure, png_of
from socialcircle_ros.simulation import make_scene
from socialcircle_ros.storage import write_file

from .sizes import vote_and_circle_ms

POINTS = (100_000, 200_000, 500_000, 1_000_000, 2_000_000, 5_000_000, 10_000_000, 20_000_000, 50_000_000)
"""Approximate numbers of points."""


@dataclass(frozen=True)
class GrowthPoint:
    """Median times for one size of cloud.

    Attributes:
        rows: of the cloud.
        columns: of the cloud.
        vote_ms: choice of the region and vote.
        circle_ms: radius and expansion.
    """

    rows: int
    columns: int
    vote_ms: float
    circle_ms: float

    @property
    def points(self) -> int:
        """Points of the cloud."""
        return self.rows * self.columns

    @property
    def total_ms(self) -> float:
        """Time of the whole filter."""
        return self.vote_ms + self.circle_ms

    @property
    def ns_per_point(self) -> float:
        """Time of the whole filter per point."""
        return 1e6 * self.total_ms / self.points


def time_growth(repeats: int) -> Iterator[GrowthPoint]:
    """Time the exact mode on clouds of increasing size.

    Args:
        repeats: timed runs for each size, after one warm-up run.
    """
    for points in POINTS:
        rows = round((points * 3 / 4) ** 0.5)
        xyz = large_cloud(rows, round(points / rows))
        yield GrowthPoint(xyz.shape[0], xyz.shape[1], *vote_and_circle_ms(xyz, repeats))


def large_cloud(rows: int, columns: int) -> npt.NDArray[np.float32]:
    """A 1280×960 metal groove with its outliers, continued by its mirror images: (rows, columns, 3)."""
    heights = make_scene('metal_groove', 960, 1280).points[..., 2]
    xyz = np.empty((rows, columns, 3), np.float32)
    xyz[..., 0], xyz[..., 1] = np.arange(columns), np.arange(rows)[:, None]
    xyz[..., 2] = heights[_mirrored(rows, 960)][:, _mirrored(columns, 1280)]
    return xyz


def draw_growth(points: Sequence[GrowthPoint], path: Path) -> None:
    """Draw the times over the points, both axes logarithmic.

    Raises:
        SocialCircleError: matplotlib is not installed, or the picture cannot be written.
    """
    figure = new_figure(6.4, 4.2)
    axes = figure.subplots()
    counts = np.array([each.points for each in points])
    axes.loglog(counts, [each.total_ms for each in points], 'o-', label='whole exact mode')
    axes.loglog(counts, [each.circle_ms for each in points], 's-', label='radius and expansion')
    axes.loglog(counts, [each.vote_ms for each in points], '^-', label='choice of the region, and vote')
    proportional = counts * points[-1].total_ms / counts[-1]
    axes.loglog(counts, proportional, ':', color='gray', label='proportional to the points')
    axes.set_xlabel('points')
    axes.set_ylabel('ms')
    axes.grid(alpha=0.3)
    axes.legend()
    write_file(path, png_of(figure))


def _mirrored(length: int, period: int) -> npt.NDArray[np.int64]:
    """Indices 0 … period-1, then back to 0, and again, up to `length` of them."""
    place = np.arange(length) % (2 * period)
    return np.minimum(place, 2 * period - 1 - place)
