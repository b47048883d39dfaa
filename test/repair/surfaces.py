# SPDX-License-Identifier: Apache-2.0
"""Surfaces with a known truth, and holes in them."""

import numpy as np


def fractal(height, width, hurst, rms, seed):
    """Fractal roughness: amplitudes k^-(hurst + 1), cut out of a periodic surface of twice the size."""
    random = np.random.default_rng(seed)
    k = np.hypot(np.fft.fftfreq(2 * height)[:, None], np.fft.rfftfreq(2 * width)[None])
    k[0, 0] = np.inf
    noise = random.normal(size=k.shape) + 1j * random.normal(size=k.shape)
    z = np.fft.irfft2(k ** -(hurst + 1) * noise, s=(2 * height, 2 * width))[:height, :width]
    return z * (rms / z.std())


def step_distance(height, width, angle):
    """Signed distance in points from a straight line through the middle."""
    rows, columns = np.mgrid[:height, :width]
    return (columns - width / 2) * np.cos(angle) + (rows - height / 2) * np.sin(angle)


def scattered_and_clustered(height, width, seed, scattered=0.05, clustered=0.038):
    """8.4 % holes: single points, and discs with radii of 1.5 to 4.5 points."""
    random = np.random.default_rng(seed)
    mask = random.random((height, width)) < scattered
    rows, columns = np.mgrid[:height, :width]
    for _ in range(round(clustered * height * width / 30)):
        row, column, radius = random.uniform(0, height), random.uniform(0, width), random.uniform(1.5, 4.5)
        box = np.s_[max(int(row) - 5, 0) : int(row) + 7, max(int(column) - 5, 0) : int(column) + 7]
        mask[box] |= (rows[box] - row) ** 2 + (columns[box] - column) ** 2 < radius**2
    return mask


def cloud(z, dtype=np.float64, pitch=(1.25, 0.75)):
    """Heights on a grid with a pitch along rows and one along columns."""
    rows, columns = np.mgrid[: z.shape[0], : z.shape[1]]
    return np.dstack([columns * pitch[0], rows * pitch[1], z]).astype(dtype)
