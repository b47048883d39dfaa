# SPDX-License-Identifier: Apache-2.0
"""Slow, obvious reference for the areal texture of a cloud: a list of points, and one triangle after the other."""

import numpy as np


def areal_texture(xyz, kept):
    """Sa, Sq, Sz, Ssk, Sku and Sdr of the kept points over their own x and y; NaN with fewer than three points."""
    counted = kept & np.isfinite(xyz).all(axis=2)
    x, y, z = xyz[counted].T
    if len(z) < 3:
        return (np.nan,) * 6
    terms = np.column_stack([x - x.mean(), y - y.mean(), np.ones(len(x))])
    plane = np.linalg.lstsq(terms, z, rcond=1e-6)[0]
    rest = z - terms @ plane
    sq = np.sqrt(np.mean(rest**2))
    levelled = xyz.copy()
    levelled[counted, 2] = rest
    return (
        np.mean(abs(rest)), sq, np.ptp(rest), np.mean(rest**3) / sq**3, np.mean(rest**4) / sq**4,
        developed_ratio(levelled, counted),
    )  # fmt: skip


def developed_ratio(xyz, counted):
    """Area of both splits of all squares whose four points count, over the area below it."""
    area = below = 0.0
    for row in range(xyz.shape[0] - 1):
        for column in range(xyz.shape[1] - 1):
            if not counted[row : row + 2, column : column + 2].all():
                continue
            a, b, c, d = xyz[[row, row, row + 1, row + 1], [column, column + 1, column, column + 1]]
            for first, second, third in ((a, b, c), (d, b, c), (b, a, d), (c, a, d)):
                normal = np.cross(second - first, third - first)
                area += np.linalg.norm(normal) / 2
                below += abs(normal[2]) / 2
    return area / below - 1 if below else np.nan
