# SPDX-License-Identifier: Apache-2.0
"""Small focus stacks with a known truth: texture under a blur that grows with the distance from focus."""

from dataclasses import dataclass

import numpy as np

INNER = (slice(10, -10), slice(10, -10))
"""Pixels that neither the wrap-around of the blur nor the cut-off windows at the border affect."""


@dataclass(frozen=True)
class Stack:
    frames: np.ndarray  # (N, H, W)
    z: np.ndarray  # (N,)
    truth: np.ndarray  # (H, W)


def make_stack(
    seed=1,
    *,
    shape=(96, 128),
    width=1.3,
    electrons=None,
    tilt=0.05,
    contrast=0.3,
    jitter=0.05,
    margin=8.0,
    dtype=np.uint8,
):
    """Make a stack of a tilted, slightly wavy surface seen through a Gaussian blur, with z in steps.

    Args:
        width: steps from focus at which the response to white texture is half.
        electrons: full well of the camera, with shot noise and 5 electrons of read noise; None: no noise.
        tilt: in steps per pixel.
        contrast: standard deviation of the texture.
        jitter: standard deviation of z, in steps.
        margin: steps of the scan beyond the surface on either side.
    """
    rng = np.random.default_rng(seed)
    height, columns = shape
    y, x = np.mgrid[:height, :columns].astype(float)
    truth = tilt * (x - columns / 2) + 0.5 * np.sin(x / 11) * np.cos(y / 13)
    z = np.arange(truth.min() - margin, truth.max() + margin)
    z += jitter * rng.standard_normal(z.size)
    texture = np.clip(0.45 * (1 + contrast * _blurred(rng.standard_normal(shape), 0.6) * 2), 0.02, None)
    sharpest, growth = 0.9, 1.05
    defocus = 0.77 * sharpest / width
    levels = [sharpest]
    while levels[-1] < np.hypot(sharpest, defocus * (z[-1] - z[0])):
        levels.append(levels[-1] * growth)
    bank = np.stack([_blurred(texture, sigma) for sigma in levels])
    most = float(np.iinfo(dtype).max)
    frames = []
    for position in z:
        level = np.log(np.hypot(sharpest, defocus * (position - truth)) / sharpest) / np.log(growth)
        low = np.minimum(level.astype(int), len(levels) - 2)
        part = level - low
        rows, cols = y.astype(int), x.astype(int)
        seen = bank[low, rows, cols] * (1 - part) + bank[low + 1, rows, cols] * part
        if electrons is not None:
            seen = rng.poisson(np.clip(seen, 0, None) * electrons) + 5 * rng.standard_normal(shape)
            seen = seen / electrons
        frames.append(np.clip(np.rint(seen * most), 0, most).astype(dtype))
    return Stack(np.stack(frames), z, truth)


def ruled(period, phase, axis, *, dtype=np.uint8, seed=0):
    """A slope with a line on every `period`-th row (axis 0) or column (1), which fills whole periods.

    Returns:
        Frames (17, H, W) at z of 0 to 16 steps, and the true depths, (H, W).
    """
    along = -(-96 // (4 * period)) * 4 * period  # whole periods, and whole binned pixels
    shape = (along, 80) if axis == 0 else (80, along)
    place, across = np.mgrid[: shape[0], : shape[1]][[axis, 1 - axis]]
    truth = 6 + 4 * across / 80
    lines = np.where((place - phase) % period == 0, 1, -1 / (period - 1))
    noise = np.random.default_rng(seed).standard_normal((17, *shape))
    contrast = np.exp(-((np.arange(17.0)[:, None, None] - truth) ** 2) / 8)
    gray = 100 + 90 * lines * contrast + noise
    return np.rint(gray * (np.iinfo(dtype).max / 255)).astype(dtype), truth


def _blurred(image, sigma):
    """Blur with a Gaussian by Fourier transform; the image wraps around."""
    rows, columns = (np.fft.fftfreq(n)[:, None] for n in image.shape)
    transfer = np.exp(-2 * (np.pi * sigma) ** 2 * (rows**2 + columns.T**2))
    return np.fft.ifft2(np.fft.fft2(image) * transfer).real


def errors(result, truth):
    """Depth errors of the inner pixels that have a depth."""
    found = (result.depth - truth)[INNER]
    return found[np.isfinite(found)]


def same(one, other):
    """Whether two results are equal bit for bit."""
    return all(
        np.array_equal(getattr(one, name), getattr(other, name), equal_nan=name == 'depth')
        for name in ('depth', 'quality', 'image', 'reasons')
    )
