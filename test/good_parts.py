# SPDX-License-Identifier: Apache-2.0
"""Clouds of good parts."""

import numpy as np

from socialcircle_ros.teaching.clouds import GoodCloud


def pitted(rows=240, columns=300, seed=1, pits=60):
    """Heights of noise with round pits of one texture: outliers to the rules, but not to a lesson."""
    generator = np.random.default_rng(seed)
    heights = generator.normal(size=(rows, columns))
    y, x = np.mgrid[:rows, :columns]
    for row, column in generator.uniform((0, 0), (rows, columns), (pits, 2)):
        heights -= 12 * (np.hypot(y - row, x - column) < 2.6)
    return heights


def part(heights, name='part', pitch=(1.0, 2.0), dtype=np.float32):
    """A cloud from heights."""
    y, x = np.mgrid[: heights.shape[0], : heights.shape[1]]
    return GoodCloud(name, np.dstack([pitch[0] * x, pitch[1] * y, heights]).astype(dtype))
