# SPDX-License-Identifier: Apache-2.0
"""A second model of outliers: large patches of irregular outline, blurred several times, and isolated points.

No rule of the adaptive mode was chosen on these outliers alone, and the model shares no shape with `add_outliers`,
whose clusters are wavy ellipses of at most 8 points radius.
"""

import numpy as np
import numpy.typing as npt

from socialcircle_ros.simulation.outliers import Contaminated
from socialcircle_ros.simulation.surfaces import Seed, TrueHeights

_ISOLATED = 0.4
"""Share of the outliers that are isolated."""
_AMPLITUDES = (7.0, 60.0)
"""Smallest and largest displacement, in σ; each factor is equally likely."""
_POINTS = (6.0, 900.0)
"""Smallest and largest patch before it is blurred, in points; each factor is equally likely."""
_BLURS = (0, 0, 1, 2, 4, 8)
"""How often a patch is smoothed with [1 2 1] / 4 along x and along y; one of them at random."""
_ROUGHNESS = (0.0, 0.02, 0.1, 0.25)
"""Standard deviation of the points of a patch, as a share of its displacement; one of them at random."""
_BOUND = 4.0
"""Displacement from which a point is an outlier, in σ; smaller displacements are ambiguous."""

_PatchHeights = npt.NDArray[np.float64]


def add_irregular_outliers(heights: TrueHeights, share: float, unit: float, seed: Seed) -> Contaminated:
    """Displace points of a height map, in patches of irregular shape and alone.

    Args:
        heights: (H, W) float64; NaN where not measured. These points stay NaN.
        share: of the measured points that become outliers, at least; the last patch may exceed it.
        unit: σ of the surface, in the unit of the heights.
        seed: of places, shapes and displacements.
    """
    generator = np.random.default_rng(seed)
    measured = np.isfinite(heights)
    places = np.flatnonzero(measured)
    wanted = round(share * places.size)
    displacement = np.zeros(heights.shape)
    cluster = np.zeros(heights.shape, np.int32)
    left = round((1 - _ISOLATED) * wanted)
    for number, place in enumerate(generator.choice(places, 4 * wanted) if wanted else (), start=1):
        if left <= 0:
            break
        moved = unit * _patch(generator)
        window, part = _window(heights.shape, divmod(int(place), heights.shape[1]), moved.shape)
        moved = np.where(measured[window] & (cluster[window] == 0), moved[part], 0.0)
        displacement[window] += moved
        cluster[window][moved != 0] = number
        left -= int(np.count_nonzero(np.abs(moved) >= _BOUND * unit))
    free = np.flatnonzero(measured & (cluster == 0))
    alone = min(max(wanted - int(np.count_nonzero(np.abs(displacement) >= _BOUND * unit)), 0), free.size)
    chosen = generator.choice(free, alone, replace=False)
    displacement.flat[chosen] = [unit * _amplitude(generator) for _ in range(alone)]
    cluster.flat[chosen] = -1
    return Contaminated(heights + displacement, np.abs(displacement) >= _BOUND * unit, displacement, cluster)


def _amplitude(generator: np.random.Generator) -> float:
    """Draw a displacement in σ, up or down."""
    size = np.exp(generator.uniform(*np.log(_AMPLITUDES)))
    return float(size * generator.choice((-1.0, 1.0)))


def _patch(generator: np.random.Generator) -> _PatchHeights:
    """Draw the displacements of a patch, (n, n), in σ: the highest part of smooth noise, blurred."""
    points = int(np.exp(generator.uniform(*np.log(_POINTS))))
    blurs = int(generator.choice(_BLURS))
    margin = blurs + 1
    side = 2 + int(1.7 * points**0.5)
    field = _smoothed(generator.standard_normal((side, side)), max(1, points // 40))
    across = np.linspace(-1.2, 1.2, side)
    field = field / field.std() - 1.5 * (across**2 + across[:, np.newaxis] ** 2)
    inside = field >= np.partition(field, -points, axis=None)[-points]
    profile = _smoothed(np.pad(inside.astype(np.float64), margin), blurs)
    rough = 1 + generator.choice(_ROUGHNESS) * generator.standard_normal(profile.shape)
    patch: _PatchHeights = np.where(profile > 1e-3, _amplitude(generator) * profile * rough, 0.0)
    return patch


def _smoothed(field: _PatchHeights, times: int) -> _PatchHeights:
    """Smooth with [1 2 1] / 4 along both axes; beyond the border lie the values of the border."""
    for _ in range(times):
        wide = np.pad(field, 1, mode='edge')
        wide = (wide[:-2] + 2 * wide[1:-1] + wide[2:]) / 4
        field = (wide[:, :-2] + 2 * wide[:, 1:-1] + wide[:, 2:]) / 4
    return field


def _window(
    shape: tuple[int, ...], centre: tuple[int, int], size: tuple[int, ...]
) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """The part of a cloud around a point that a patch covers, and the part of the patch that lies in the cloud."""
    window, part = [], []
    for length, middle, extent in zip(shape, centre, size, strict=True):
        first = middle - extent // 2
        start, end = max(first, 0), min(first + extent, length)
        window.append(slice(start, end))
        part.append(slice(start - first, end - first))
    return (window[0], window[1]), (part[0], part[1])
