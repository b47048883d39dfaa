# SPDX-License-Identifier: Apache-2.0
"""Clouds of good parts."""

import numpy as np

from socialcircle_ros.teaching.clouds import GoodCloud


def pitted(rows=240, columns=300, seed=1, pits=60):
    """Heights of noise with round pits, shallow and deep: outliers without a lesson, and texture with one."""
    generator = np.random.default_rng(seed)
    heights = generator.normal(size=(rows, columns))
    y, x = np.mgrid[:rows, :columns]
    for row, column, depth in generator.uniform((0, 0, 8), (rows, columns, 20), (pits, 3)):
        heights -= depth * (np.hypot(y - row, x - column) < 2.6)
    return heights


def from_holes(shape):
    """Distance of each point from the centre of the next hole of a drilled part."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    return np.hypot(y % 60 - 30, x % 60 - 30)


def drilled(rows=180, columns=240, seed=1):
    """Heights of noise and grooves with holes, whose burrs look like outliers."""
    generator = np.random.default_rng(seed)
    y, x = np.mgrid[:rows, :columns]
    far = from_holes((rows, columns))
    around = np.arctan2(y % 60 - 30, x % 60 - 30)
    heights = generator.normal(size=(rows, columns)) + np.sin(y / 1.7)
    heights += 40 * (1 + 0.6 * np.sin(3 * around + x // 60)) * np.exp(-(((far - 11) / 1.8) ** 2))
    heights[far < 9] = np.nan
    return heights


def part(heights, name='part', pitch=(1.0, 2.0), dtype=np.float32):
    """A cloud from heights."""
    y, x = np.mgrid[: heights.shape[0], : heights.shape[1]]
    return GoodCloud(name, np.dstack([pitch[0] * x, pitch[1] * y, heights]).astype(dtype))
