# SPDX-License-Identifier: Apache-2.0
"""Outliers that the network is trained on: several generators, mixed at random in each patch.

None of them makes the outliers of `simulation.add_outliers` or `studies.adaptive.irregular_outliers`: these serve
for checks alone.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, label

from socialcircle_ros.cloud import Mask

from .random_fields import smooth_noise

Displacements = NDArray[np.float64]
"""(H, W), in standard deviations of the surface's own noise."""

OUTLIER_FROM, GOOD_BELOW = 6.0, 4.0
"""Displacements of at least the first are outliers, below the second good; those between do not count."""
SHARES = (0.0, 0.0, 0.0002, 0.0005, 0.002, 0.005, 0.01, 0.02, 0.05, 0.05, 0.1, 0.15, 0.3, 0.45)
"""Shares of outliers of a patch, one drawn at random. Without the least ones a network learns that few outliers
are none, and keeps a single point that stands out."""
_MARGIN = 4
_MOST_BLOBS = 3000


@dataclass(frozen=True, eq=False)
class Placed:
    """Heights with outliers, and their truth.

    Attributes:
        heights: (H, W) float64.
        outlier: (H, W) bool.
        certain: (H, W) bool, points that are clearly an outlier or clearly none.
    """

    heights: NDArray[np.float64]
    outlier: Mask
    certain: Mask


def place_outliers(
    heights: NDArray[np.float64], noise: float, share: float, random: np.random.Generator
) -> Placed:
    """Displace about a share of the points, by one to three generators drawn at random.

    Args:
        heights: (H, W), NaN where not measured.
        noise: standard deviation of the surface's own noise.
        share: of outliers, 0 to 0.5.
        random: source of all random numbers.
    """
    total = np.zeros(heights.shape)
    if share > 0:
        chosen = random.choice(len(GENERATORS), random.integers(1, 4), p=_CHANCES)
        parts = random.dirichlet(np.ones(len(chosen))) * share
        for place, part in zip(chosen, parts, strict=True):
            total += GENERATORS[place](heights / noise, float(part), random)
    measured = np.isfinite(heights)
    size = np.abs(total)
    outlier: Mask = (size >= OUTLIER_FROM) & measured
    certain: Mask = measured & (outlier | (size < GOOD_BELOW))
    return Placed(heights + noise * total, outlier, certain)


def _amplitudes(random: np.random.Generator, count: int) -> Displacements:
    """Log-uniform sizes of 7 to 60 σ, seldom to 2000 σ, of both signs or of one."""
    most = 2000.0 if random.random() < 0.05 else 60.0
    least = 7.0 if random.random() < 0.6 else 10.0
    sizes = np.exp(random.uniform(np.log(least), np.log(most), count))
    upward = random.choice([0.0, 0.5, 0.5, 1.0])
    return np.where(random.random(count) < upward, sizes, -sizes)


def isolated(heights: Displacements, share: float, random: np.random.Generator) -> Displacements:
    """Single points, now and then in pairs along a row or column."""
    shape = heights.shape
    hit = random.random(shape) < share
    displaced = np.zeros(shape)
    displaced[hit] = _amplitudes(random, int(hit.sum()))
    if random.random() < 0.3:
        paired = np.roll(displaced, 1, axis=int(random.integers(2)))
        displaced = np.where((displaced == 0) & (random.random(shape) < 0.5), paired, displaced)
    return displaced


def blobs(heights: Displacements, share: float, random: np.random.Generator) -> Displacements:
    """Ellipses and irregular shapes: sharp, blurred, conical or domed, smooth or rough inside."""
    height, width = heights.shape
    displaced = np.zeros(heights.shape)
    largest = random.choice([2.5, 4.0, 6.0, 9.0, 14.0, 18.0, 30.0], p=[0.08, 0.13, 0.20, 0.21, 0.18, 0.12, 0.08])
    inside = random.choice([0.0, 0.7, 1.0, 3.0])
    uneven = random.choice([0.0, 0.0, 0.1, 0.25])
    irregular = random.choice([0.0, 0.5, 1.0])
    blurred = random.choice([0.2, 0.5, 0.7])
    texture = smooth_noise((128, 128), float(random.uniform(1.0, 4.0)), random)
    signed = random.choice([0.0, 0.5, 0.5, 1.0])
    wanted, made = share * heights.size, 0.0
    for _ in range(_MOST_BLOBS):
        if made >= wanted:
            break
        radius = float(random.uniform(0.8, largest)) if random.random() < 0.8 else float(random.uniform(0.8, 4.0))
        stretch = float(np.exp(random.uniform(-0.6, 0.6)))
        reach = int(np.ceil(radius * max(stretch, 1 / stretch) * 1.4)) + _MARGIN
        row, column = int(random.integers(height)), int(random.integers(width))
        area = (slice(max(0, row - reach), row + reach + 1), slice(max(0, column - reach), column + reach + 1))
        y, x = np.ogrid[area[0].start - row : min(height, area[0].stop) - row,
                        area[1].start - column : min(width, area[1].stop) - column]  # fmt: skip
        turn = random.uniform(0, np.pi)
        along = (x * np.cos(turn) + y * np.sin(turn)) / stretch
        distance = np.hypot(along, (y * np.cos(turn) - x * np.sin(turn)) * stretch) / radius
        if random.random() < irregular:
            corner = random.integers(0, np.maximum(1, 128 - np.array(distance.shape)))
            piece = texture[corner[0] :, corner[1] :][: distance.shape[0], : distance.shape[1]]
            if piece.shape == distance.shape:
                distance = distance + 0.3 * piece
        profile = _profile(distance, radius, blurred, random)
        size = abs(float(_amplitudes(random, 1)[0])) * (1 if random.random() < signed else -1)
        rough = np.hypot(inside * (profile > 0.5), uneven * size * profile)
        change = size * profile + random.normal(0, 1, profile.shape) * rough
        if random.random() < 0.15:  # a flat spot that does not follow the surface
            level = heights[row, column]
            flat = np.nan_to_num(level - heights[area]) * profile
            change = change + np.clip(flat, -3 * abs(size), 3 * abs(size))
        displaced[area] += change
        made += float(np.count_nonzero(np.abs(change) >= OUTLIER_FROM))
    return displaced


def _profile(distance: Displacements, radius: float, blurred: float, random: np.random.Generator) -> Displacements:
    """Height of a blob relative to its top, from the distance to its centre in radii."""
    profile = (distance < 1).astype(np.float64)
    kind = random.random()
    if kind < blurred:
        profile = gaussian_filter(profile, float(random.uniform(0.4, max(0.6, min(2.2, 0.6 * radius)))))
        if random.random() < 0.2:
            profile = gaussian_filter(profile, float(random.uniform(0.4, 1.5)))
    elif kind < blurred + 0.1:
        profile = np.clip(1.5 * (1 - distance), 0, 1)
    elif kind < blurred + 0.15:
        profile = np.sqrt(np.clip(1 - distance**2, 0, 1))
    return profile


def islands_of_noise(heights: Displacements, share: float, random: np.random.Generator) -> Displacements:
    """Connected sets where a smooth random field is high: shapes without any model."""
    field = smooth_noise(heights.shape, float(random.uniform(0.7, 5.0)), random)
    parts, count = label(field > np.quantile(field, 1 - min(share, 0.5)))
    displaced = np.concatenate([[0.0], _amplitudes(random, int(count))])[parts]
    if random.random() < 0.5:
        displaced = gaussian_filter(displaced, float(random.uniform(0.4, 1.5)))
    roughness = random.normal(0, random.choice([0.0, 1.0, 3.0]), heights.shape)
    return np.asarray(displaced + (parts > 0) * roughness)


def spatter(heights: Displacements, share: float, random: np.random.Generator) -> Displacements:
    """Patches where many points, not all, have heights of their own: lost contrast, glare."""
    height, width = heights.shape
    displaced = np.zeros(heights.shape)
    y, x = np.ogrid[:height, :width]
    for _ in range(200):
        if np.count_nonzero(displaced) >= share * heights.size:
            break
        radius = float(random.uniform(2, 14))
        inside = np.hypot(y - random.integers(height), x - random.integers(width)) < radius
        hit = inside & (random.random(heights.shape) < random.uniform(0.2, 1.0))
        displaced[hit] = _amplitudes(random, int(hit.sum()))
    return displaced


def streaks(heights: Displacements, share: float, random: np.random.Generator) -> Displacements:
    """Parts of rows, or of columns, one point wide or two: a lost line, a charge, a shadow."""
    displaced = np.zeros(heights.shape)
    along: Displacements = displaced if random.random() < 0.5 else displaced.T
    rough = random.choice([0.0, 0.1, 0.5])
    longest = min(along.shape[1], 120, int(share * heights.size))
    for _ in range(_MOST_BLOBS):
        if np.count_nonzero(displaced) >= share * heights.size:
            break
        length = int(np.exp(random.uniform(np.log(4), np.log(max(5, longest)))))
        row, column = int(random.integers(along.shape[0])), int(random.integers(-length // 2, along.shape[1]))
        area = along[row : row + (1 if random.random() < 0.8 else 2), max(0, column) : column + length]
        area[:] = _amplitudes(random, 1)[0] * (1 + rough * random.normal(size=area.shape))
    return displaced


GENERATORS: tuple[Callable[[Displacements, float, np.random.Generator], Displacements], ...] = (
    isolated, blobs, islands_of_noise, spatter, streaks,
)  # fmt: skip
_CHANCES = (0.38, 0.51, 0.04, 0.03, 0.04)
