# SPDX-License-Identifier: Apache-2.0
"""Outliers added to a height map: isolated points, and dense clusters that are displaced together.

Number, size and place of these outliers are known exactly. For outliers with physical causes, use the virtual
instrument (`simulate`). The model is that of figures 1 and 7 of the paper.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.cloud import Mask
from socialcircle_ros.errors import CloudError, SettingError

from .surfaces import Seed, TrueHeights

Flank = Literal['sharp', 'blurred', 'mixed']


@dataclass(frozen=True)
class Contamination:
    """Number, kind and size of the outliers.

    Attributes:
        share: of the measured points that become outliers, from 0 to below 1; met exactly.
        clustered: share of the outliers that are in clusters, 0 to 1.
        unit: of `amplitude` and `bound`, in µm: the standard deviation of the noise, or the pitch.
        amplitude: smallest and largest displacement, in `unit`; up or down at random.
        radius: smallest and largest radius of a cluster, in points.
        flank: of a cluster: 'sharp' falls to 0 from one point to the next, 'blurred' over the whole radius,
            'mixed' is either of them at random.
        spread: roughness of a cluster, as a share of its displacement.
        bound: displacement from which a point is an outlier, in `unit`; smaller displacements are ambiguous.
        densest: largest share of outliers in any area, for any weight, unless `share` itself is larger.
    """

    share: float = 0.0955
    clustered: float = 0.5
    unit: float = 1.0
    amplitude: tuple[float, float] = (8.0, 40.0)
    radius: tuple[float, float] = (2.0, 8.0)
    flank: Flank = 'mixed'
    spread: float = 0.05
    bound: float = 4.0
    densest: float = 0.5

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            SettingError: a value is out of its range.
        """
        if not 0 <= self.share < 1:
            raise SettingError(f'The share of outliers is {self.share}; it must be from 0 to below 1.')
        if not 0 < self.densest <= 1:
            raise SettingError(f'The densest share is {self.densest}; it must be above 0 and at most 1.')
        if not 0 <= self.clustered <= 1:
            raise SettingError(f'The clustered share is {self.clustered}; it must be from 0 to 1.')
        if not self.bound < self.amplitude[0] <= self.amplitude[1]:
            raise SettingError(
                f'Displacements of {self.amplitude} are not all outliers at a bound of {self.bound};'
                ' give smallest ≤ largest, both above the bound.'
            )
        if not 0.5 <= self.radius[0] <= self.radius[1]:
            raise SettingError(f'The cluster radii are {self.radius}; give 0.5 ≤ smallest ≤ largest.')


@dataclass(frozen=True, eq=False)
class Contaminated:
    """Heights with outliers, and the truth about them.

    Attributes:
        heights: (H, W) float64, µm.
        outlier: (H, W) bool, True where the displacement is at least the bound.
        displacement: (H, W) float64, µm, from the original heights.
        cluster: (H, W) int32: 0 for a point that is not displaced, -1 for an isolated one, otherwise the number of
            the cluster, from 1.
    """

    heights: TrueHeights
    outlier: Mask
    displacement: TrueHeights
    cluster: NDArray[np.int32]

    @property
    def ambiguous(self) -> Mask:
        """(H, W) bool, True where a point is displaced by less than the bound. Leave these out of scores."""
        ambiguous: Mask = (self.displacement != 0) & ~self.outlier
        return ambiguous


def add_outliers(
    heights: TrueHeights, contamination: Contamination, seed: Seed, weight: NDArray[np.float64] | None = None
) -> Contaminated:
    """Displace points of a height map.

    Args:
        heights: (H, W) float64, µm; NaN where not measured. These points stay NaN.
        contamination: number, kind and size of the outliers.
        seed: of places, sizes and displacements.
        weight: (H, W), ≥ 0: relative probability of an outlier at each point; None: equal everywhere.

    Returns:
        The heights with outliers, and the truth.

    Raises:
        CloudError: the share asks for more outliers than there are points with a weight.
    """
    places, sizes = np.random.default_rng(seed).spawn(2)
    measured = np.isfinite(heights)
    chance = np.where(measured, 1.0 if weight is None else weight, 0.0)
    wanted = round(contamination.share * int(measured.sum()))
    if wanted > int((chance > 0).sum()):
        raise CloudError(
            f'{wanted} points cannot become outliers, because only {int((chance > 0).sum())} have a weight;'
            ' lower the share or give more points a weight.'
        )
    chance = _limited(chance, wanted, contamination.densest)
    displacement = np.zeros(heights.shape)
    cluster = np.zeros(heights.shape, dtype=np.int32)
    in_clusters = round(contamination.clustered * wanted)
    _put_clusters(displacement, cluster, chance, in_clusters, contamination, places, sizes)
    bound = contamination.bound * contamination.unit
    alone = wanted - int((np.abs(displacement) >= bound).sum())

    free = np.where(cluster == 0, chance, 0.0)
    with np.errstate(divide='ignore'):
        # The largest values of log(weight) + Gumbel noise are a weighted sample without replacement.
        keys = np.log(free).ravel() + places.gumbel(size=free.size)
    alone = min(alone, int((free > 0).sum()))
    chosen = np.sort(np.argpartition(-keys, alone)[:alone]) if alone else np.zeros(0, dtype=np.int64)
    displacement.flat[chosen] = _amplitudes(contamination, sizes, alone)
    cluster.flat[chosen] = -1
    return Contaminated(
        heights=heights + displacement,
        outlier=np.abs(displacement) >= bound,
        displacement=displacement,
        cluster=cluster,
    )


def _limited(chance: NDArray[np.float64], wanted: int, densest: float) -> NDArray[np.float64]:
    """Lower the weights where they would make more than `densest` of the points outliers.

    Without the limit, all points of a groove with a weight of 20 would be outliers at a share of 30 %.
    """
    limited = chance
    for _ in range(30):
        total = float(limited.sum())
        if wanted == 0 or float(limited.max()) * wanted <= 1.01 * densest * total:
            break
        limited = np.minimum(limited, densest * total / wanted)
    return limited


def _put_clusters(
    displacement: TrueHeights,
    cluster: NDArray[np.int32],
    chance: NDArray[np.float64],
    wanted: int,
    contamination: Contamination,
    places: np.random.Generator,
    sizes: np.random.Generator,
) -> None:
    """Add clusters, in place, until `wanted` points are outliers or no more room is found."""
    bound = contamination.bound * contamination.unit
    total = np.cumsum(chance.ravel())
    rows, columns = chance.shape
    placed = number = 0
    tries = 100 + 20 * wanted
    while placed < wanted and tries > 0:
        tries -= 1
        centre = int(np.searchsorted(total, places.uniform(0, total[-1]), side='right'))
        row, column = divmod(min(centre, chance.size - 1), columns)
        radius = sizes.uniform(*contamination.radius)
        reach = int(1.6 * radius) + 2
        box = (
            slice(max(row - reach, 0), min(row + reach + 1, rows)),
            slice(max(column - reach, 0), min(column + reach + 1, columns)),
        )
        dy = np.arange(box[0].start, box[0].stop)[:, np.newaxis] - row
        dx = np.arange(box[1].start, box[1].stop)[np.newaxis, :] - column
        profile = _profile(dx, dy, radius, contamination.flank, sizes)
        moved = profile * _amplitudes(contamination, sizes, 1)[0]
        moved *= 1 + contamination.spread * np.clip(sizes.standard_normal(profile.shape), -2, 2)
        # Points of weight 0 and points of another cluster are not displaced: a cluster has one cause.
        moved[(chance[box] == 0) | (cluster[box] != 0)] = 0
        outside = np.argsort(-np.abs(moved), axis=None, kind='stable')
        outliers = int((np.abs(moved) >= bound).sum())
        moved.flat[outside[min(outliers, wanted - placed) :]] *= outliers <= wanted - placed
        if outliers == 0:
            continue
        number += 1
        placed += min(outliers, wanted - placed)
        displacement[box] += moved
        cluster[box][moved != 0] = number


def _profile(
    dx: NDArray[np.int64], dy: NDArray[np.int64], radius: float, flank: Flank, rng: np.random.Generator
) -> NDArray[np.float64]:
    """The shape of a cluster, 0 to 1: a blob with a wavy, elongated outline."""
    angle, stretch = rng.uniform(0, np.pi), rng.uniform(0.6, 1.0)
    u = np.cos(angle) * dx + np.sin(angle) * dy
    v = (np.cos(angle) * dy - np.sin(angle) * dx) / stretch
    around = np.arctan2(v, u)
    wave = rng.uniform(-0.15, 0.15, 2) @ np.stack(
        [np.cos(2 * around + angle), np.cos(3 * around - angle)]
    ).reshape(2, -1)
    inward = 1 - np.hypot(u, v) / (radius * (1 + wave.reshape(u.shape)))
    blurred = flank == 'blurred' or (flank == 'mixed' and rng.random() < 0.5)
    if not blurred:
        sharp: NDArray[np.float64] = (inward > 0).astype(np.float64)
        return sharp
    rise = np.clip(inward, 0.0, 1.0)
    smooth: NDArray[np.float64] = rise**2 * (3 - 2 * rise)
    return smooth


def _amplitudes(contamination: Contamination, rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    """Draw the displacements of some points or clusters, (count,), µm."""
    low, high = contamination.amplitude
    size = contamination.unit * rng.uniform(low, high, count)
    signed: NDArray[np.float64] = size * rng.choice(np.array([-1.0, 1.0]), count)
    return signed
