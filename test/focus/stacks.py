"""Small focus stacks with known truth: texture under a blur that grows with the distance from focus."""

from dataclasses import dataclass

import numpy as np


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
    """A tilted, slightly wavy surface seen through a Gaussian blur, z in steps.

    Args:
        width: at how many steps from focus the response to white texture is half.
        electrons: full well of the camera, with shot noise, 5 electrons of read noise; None: no noise.
        tilt: in steps per pixel.
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


def _blurred(image, sigma):
    """A Gaussian blur by Fourier transform, wrapping round."""
    rows, columns = (np.fft.fftfreq(n)[:, None] for n in image.shape)
    transfer = np.exp(-2 * (np.pi * sigma) ** 2 * (rows**2 + columns.T**2))
    return np.fft.ifft2(np.fft.fft2(image) * transfer).real


def errors(result, truth, edge=8):
    """Depth errors away from the border, where blur wraps round, of the pixels that have a depth."""
    inner = (slice(edge, -edge), slice(edge, -edge))
    found = (result.depth - truth)[inner]
    return found[np.isfinite(found)]
