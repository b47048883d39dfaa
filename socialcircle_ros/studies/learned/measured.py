# SPDX-License-Identifier: Apache-2.0
"""Real surfaces as the training uses them: parts of them, varied."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from socialcircle_ros.circle.network.scales import scales_of
from socialcircle_ros.cloud import Mask
from socialcircle_ros.studies.adaptive.inserted_outliers import StudiedSurface

from .random_fields import fractal

_WEIGHTS = {'afm': 0.5, 'stm': 0.4, 'sick': 0.6}
"""Chance of a surface by the first part of its name, relative to the others: many are of these kinds."""


@dataclass(frozen=True, eq=False)
class TrainingSurface:
    """A real surface.

    Attributes:
        name: of its file.
        heights: (H, W) float64, NaN where not measured.
        plausible: (H, W) bool; the other points may be outliers of the measurement, and do not count.
        weight: relative chance to be drawn.
    """

    name: str
    heights: NDArray[np.float64]
    plausible: Mask
    weight: float


def training_surfaces(surfaces: Sequence[StudiedSurface], left_out: Sequence[str]) -> list[TrainingSurface]:
    """The surfaces to train on: all but those whose name begins with one of `left_out`."""
    chosen = []
    for surface in surfaces:
        name = surface.cloud.name
        if name.startswith(tuple(left_out)):
            continue
        heights = surface.cloud.points[..., 2].astype(np.float64)
        weight = _WEIGHTS.get(name.partition('_')[0], 1.0) * min(1.0, heights.size / 250_000)
        chosen.append(TrainingSurface(name, heights, surface.plausible, max(0.1, weight)))
    return chosen


def varied(surface: TrainingSurface, side: int, random: np.random.Generator) -> tuple[NDArray[np.float64], Mask]:
    """A random part of a real surface, now and then coarser, smoother, quantised, noisier or rougher.

    Returns:
        Heights and plausible points, (≤ side, ≤ side) each.
    """
    heights, plausible = surface.heights, surface.plausible
    if random.random() < 0.3 and min(heights.shape) >= 300:
        step = 3 if random.random() < 0.3 and min(heights.shape) >= 480 else 2
        heights, plausible = heights[::step, ::step], plausible[::step, ::step]
    rows, columns = (int(random.integers(0, max(0, size - side) + 1)) for size in heights.shape)
    area = (slice(rows, rows + side), slice(columns, columns + side))
    heights, plausible = heights[area].copy(), plausible[area].copy()
    if not plausible.any():
        return heights, plausible
    noise = noise_of(heights)
    kind = random.random()
    shape = heights.shape
    if kind < 0.15:
        measured = np.isfinite(heights)
        filled = np.where(measured, heights, np.nanmedian(heights))
        heights = np.where(measured, gaussian_filter(filled, random.uniform(0.5, 1.5)), np.nan)
    elif kind < 0.25:
        step_height = noise * random.uniform(1.5, 5)
        heights = np.round(heights / step_height) * step_height
    elif kind < 0.37:
        heights = heights + random.normal(size=shape) * noise * random.uniform(0.7, 3)
    elif kind < 0.45:
        uneven = np.exp(random.uniform(0.3, 1.0) * fractal(shape, 1.0, random))
        heights = heights + random.normal(size=shape) * noise * uneven
    elif kind < 0.55:
        rougher = fractal(shape, random.uniform(0.2, 1.0), random)
        heights = heights + noise * 10 ** random.uniform(0.3, 1.3) * rougher
    return heights, plausible


def noise_of(heights: NDArray[np.float64]) -> float:
    """Robust standard deviation of the residuals to a 5×5 median; their mean where most are 0; at least 1e-30."""
    return max(scales_of((heights - np.nanmedian(heights)).astype(np.float32)).spread, 1e-30)
