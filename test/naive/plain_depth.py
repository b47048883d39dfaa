# SPDX-License-Identifier: Apache-2.0
"""Depth from focus in its simplest form: sum-modified-Laplacian, largest value, three-point Gaussian."""

import numpy as np


def focus_measure(image, step=1, half=2):
    """F of eq. 1 and 2 without a threshold; the outermost pixels are repeated at the border."""
    padded = np.pad(image.astype(np.float32), step, mode='edge')
    middle = padded[step:-step, step:-step]
    across = np.abs(2 * middle - padded[step:-step, : -2 * step] - padded[step:-step, 2 * step :])
    down = np.abs(2 * middle - padded[: -2 * step, step:-step] - padded[2 * step :, step:-step])
    total = across + down
    for axis in (0, 1):
        edge = np.pad(total, [(half, half) if a == axis else (0, 0) for a in (0, 1)], mode='edge')
        size = total.shape[axis]
        total = sum(edge.take(np.arange(k, k + size), axis) for k in range(2 * half + 1))
    return total


def depth_from_focus(images, z, half=2):
    """Depth of each pixel; NaN where the peak is in the first or the last frame."""
    order = np.argsort(z)
    z = np.asarray(z)[order]
    curve = np.stack([focus_measure(images[k], half=half) for k in order])
    peak = curve.argmax(axis=0)
    inner = np.clip(peak, 1, len(z) - 2)
    before, at, after = (
        np.log(np.maximum(np.take_along_axis(curve, (inner + k)[np.newaxis], 0)[0], 1e-6)).astype(np.float64)
        for k in (-1, 0, 1)
    )
    # The vertex of the parabola through the three logarithms, at unequal distances in z.
    left, middle, right = z[inner - 1], z[inner], z[inner + 1]
    rise, fall = (at - before) / (middle - left), (after - at) / (right - middle)
    bend = (fall - rise) / (right - left)
    with np.errstate(divide='ignore', invalid='ignore'):
        depth = (left + middle) / 2 - rise / (2 * bend)
    depth = np.where(bend < 0, np.clip(depth, left, right), middle)
    return np.where(peak == inner, depth, np.nan)
