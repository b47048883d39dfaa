# SPDX-License-Identifier: Apache-2.0
"""Simulated stacks of a part that moves sideways under a camera that stays."""

from functools import cache

import numpy as np

from socialcircle_ros.simulation import NOISELESS, Camera, Stage, simulate

_MARGIN = 8


def drifting_frames(specimen, moved, *, shape=(128, 160)):
    """The 8-bit frames of a stack.

    Args:
        specimen: name of a material.
        moved: (y, x) pixels from the first frame to the last one, or that of each frame.
        shape: of the frames.
    """
    light = _light(specimen, shape)
    path = np.asarray(moved, float)
    if path.ndim == 1:
        path = np.outer(np.linspace(0, 1, len(light)), path)
    sensor = Camera().sensor(shape, 7)
    inner = slice(_MARGIN, -_MARGIN)
    path = np.array([path[round(k)] for k in np.linspace(0, len(path) - 1, len(light))])
    return [
        sensor.expose(_shifted(each, y, x)[inner, inner].astype(np.float32), seed)
        for seed, (each, (y, x)) in enumerate(zip(light, path, strict=True))
    ]


@cache
def _light(specimen, shape):
    """The light of each frame without drift, with a margin on each side."""
    rows, columns = (size + 2 * _MARGIN for size in shape)
    scan = simulate(
        specimen, rows, columns, seed=3, camera=NOISELESS, stage=Stage(jitter=0, encoder_noise=0), flicker=0
    )
    return [(frame.image / NOISELESS.top - NOISELESS.black_level) / NOISELESS.exposure for frame in scan.frames()]


def _shifted(image, y, x):
    """Move an image by Fourier transform; it wraps around."""
    rows, columns = np.fft.fftfreq(image.shape[0])[:, None], np.fft.rfftfreq(image.shape[1])
    return np.fft.irfft2(np.fft.rfft2(image) * np.exp(-2j * np.pi * (rows * y + columns * x)), s=image.shape)
