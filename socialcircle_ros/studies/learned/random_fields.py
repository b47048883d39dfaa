# SPDX-License-Identifier: Apache-2.0
"""Random fields that surfaces and outliers are made of."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

RandomField = NDArray[np.float64]
"""(H, W), of mean 0 and standard deviation 1."""


def smooth_noise(shape: tuple[int, int], radius: float, random: np.random.Generator) -> RandomField:
    """Normal noise, blurred by a Gaussian of a standard deviation in points."""
    return _standardised(gaussian_filter(random.normal(size=shape), radius))


def fractal(
    shape: tuple[int, int], hurst: float, random: np.random.Generator, stretch: float = 1.0
) -> RandomField:
    """A self-affine surface: power falls with the wave number to −2 (hurst + 1), up to a random longest wave.

    Args:
        shape: (H, W).
        hurst: exponent, 0 rough to 1 smooth.
        random: source of the random numbers.
        stretch: ratio of the correlation lengths along a random direction and across it.
    """
    rows = np.fft.fftfreq(shape[0])[:, None]
    columns = np.fft.rfftfreq(shape[1])[None]
    turn = random.uniform(0, np.pi)
    along = columns * np.cos(turn) - rows * np.sin(turn)
    across = (columns * np.sin(turn) + rows * np.cos(turn)) * stretch
    waves = np.maximum(np.hypot(along, across), 1 / random.uniform(30, 400))
    field = np.fft.irfft2(np.fft.rfft2(random.normal(size=shape)) * waves ** -(hurst + 1), s=shape)
    return _standardised(field)


def _standardised(field: NDArray[np.float64]) -> RandomField:
    """Without its mean, which on a small field is many standard deviations."""
    field = field - field.mean()
    return np.asarray(field / (field.std() + 1e-12))
