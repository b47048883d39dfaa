"""How the filter's time grows with the cloud: measured from 0.1 to 50 million points, and drawn."""

import statistics
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from socialcircle_ros.circle import remove_outliers
from socialcircle_ros.cloud import Cloud
from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.simulation import make_scene

POINTS = (100_000, 200_000, 500_000, 1_000_000, 2_000_000, 5_000_000, 10_000_000, 20_000_000, 50_000_000)
"""In a cloud, about."""


@dataclass(frozen=True)
class GrowthPoint:
    """Median times in ms for one size of cloud."""

    rows: int
    columns: int
    vote: float
    expansion: float

    @property
    def points(self) -> int:
        """Points of the cloud."""
        return self.rows * self.columns

    @property
    def nanoseconds(self) -> float:
        """Of the whole filter, per point."""
        return 1e6 * (self.vote + self.expansion) / self.points


def time_growth(repeats: int) -> Iterator[GrowthPoint]:
    """Time the filter on ever larger clouds.

    Args:
        repeats: how often each figure is taken after a first, uncounted time.
    """
    for points in POINTS:
        rows = round((points * 3 / 4) ** 0.5)
        xyz = large_cloud(rows, round(points / rows))
        times = [remove_outliers(xyz).times for _ in range(repeats + 1)][1:]
        vote = 1e3 * statistics.median(step['vote'] for step in times)
        rest = 1e3 * statistics.median(step['radius'] + step['expansion'] for step in times)
        yield GrowthPoint(xyz.shape[0], xyz.shape[1], vote, rest)


def large_cloud(rows: int, columns: int) -> Cloud:
    """A groove of 1280×960 with its outliers, continued by its mirror images: (rows, columns, 3) float32."""
    heights = make_scene('metal_groove', 960, 1280).points[..., 2]
    xyz = np.empty((rows, columns, 3), np.float32)
    xyz[..., 0], xyz[..., 1] = np.arange(columns), np.arange(rows)[:, None]
    xyz[..., 2] = heights[_to_and_fro(rows, 960)][:, _to_and_fro(columns, 1280)]
    return xyz


def draw_growth(steps: list[GrowthPoint], path: Path) -> None:
    """Draw the times over the points, both axes logarithmic.

    Raises:
        SocialCircleError: matplotlib is not installed, or the picture cannot be written.
    """
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415 - an extra, slow to import
    except ImportError:
        raise SocialCircleError('The plot needs matplotlib: install it with `pip install matplotlib`.') from None
    figure = Figure(figsize=(6.4, 4.2), layout='constrained')
    axes = figure.subplots()
    points = np.array([step.points for step in steps])
    axes.loglog(points, [step.vote + step.expansion for step in steps], 'o-', label='whole exact mode')
    axes.loglog(points, [step.expansion for step in steps], 's-', label='radius and expansion')
    axes.loglog(points, [step.vote for step in steps], '^-', label='choice of the region, and vote')
    last = steps[-1].vote + steps[-1].expansion
    axes.loglog(points, points * last / points[-1], ':', color='gray', label='proportional to the points')
    axes.set_xlabel('points')
    axes.set_ylabel('ms')
    axes.grid(alpha=0.3)
    axes.legend()
    try:
        figure.savefig(path, dpi=100)
    except (OSError, ValueError) as error:
        raise SocialCircleError(f'{path} cannot be written: {error}.') from None


def _to_and_fro(length: int, period: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    place = np.arange(length) % (2 * period)
    return np.minimum(place, 2 * period - 1 - place)
