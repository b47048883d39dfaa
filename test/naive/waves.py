# SPDX-License-Identifier: Apache-2.0
"""The blurred image of a few cosine waves, known without an FFT: blur only reduces their amplitudes."""

import numpy as np


class Waves:
    """A radiance of 1 plus cosines; frequencies in 1/µm, a pitch of 1 µm."""

    def __init__(self, seed, count=6):
        rng = np.random.default_rng(seed)
        self.fx, self.fy = rng.uniform(-0.35, 0.35, (2, count))
        self.phase = rng.uniform(0, 2 * np.pi, count)
        self.amplitude = rng.uniform(0.05, 0.15, count)

    def at(self, row, column, transfer=1.0):
        wave = np.cos(2 * np.pi * (self.fx * column + self.fy * row) + self.phase)
        return 1 + (self.amplitude * transfer * wave).sum()

    def radiance(self, shape):
        return np.array([[self.at(row, column) for column in range(shape[1])] for row in range(shape[0])])

    def imaged(self, row, column, defocus, optics):
        """Light on a pixel: diffraction and pixel aperture, then the mean over the circle of confusion."""
        sharp = optics.sharp_transfer(self.fx, self.fy)
        radius = abs(defocus) * optics.cone
        y, x = np.mgrid[-1:1:201j, -1:1:201j]
        disc = np.hypot(y, x) < 1
        y, x = radius * y[disc], radius * x[disc]
        mean = np.cos(2 * np.pi * (np.outer(self.fx, x) + np.outer(self.fy, y))).mean(axis=1)
        return self.at(row, column, sharp * mean)
