# SPDX-License-Identifier: Apache-2.0
"""The light of the glints: point sources off the surface, in focus and out of focus."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.kernels.compiled import kernel

from .optics import Optics
from .sampling import Light, fast_length, frequencies
from .specimen import Glints


class _Spots(NamedTuple):
    """Images of a point source at the distances from focus of the layers, for the kernels."""

    images: Light
    """(L, S, S), with the source in the middle."""

    reach: NDArray[np.int64]
    """(L,): points from the middle that the image covers."""

    distances: NDArray[np.float64]
    """(L,), µm, ascending."""


class _Sources(NamedTuple):
    """Point sources at one position of the stage, (G,) each, for the kernels."""

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    light: NDArray[np.float64]

    distance: NDArray[np.float64]
    """From focus, µm."""

    upper: NDArray[np.int64]
    """Index of the first layer beyond the distance."""


class Glare:
    """The images of the glints, in focus and out of focus."""

    def __init__(
        self, glints: Glints, distances: NDArray[np.float64], optics: Optics, shape: tuple[int, int]
    ) -> None:
        self._glints = glints
        self._shape = shape
        reach = np.ceil(distances * optics.cone / optics.pitch).astype(np.int64) + 6
        size = fast_length(2 * int(reach[-1]) + 2)
        fx, fy = frequencies((size, size), optics.pitch)
        frequency = np.hypot(fx, fy)
        sharp = optics.sharp_transfer(fx, fy)
        images = np.empty((len(distances), size, size), dtype=np.float32)
        for image, distance in zip(images, distances, strict=True):
            transfer = sharp * optics.defocus_transfer(frequency, distance)
            image[:] = np.fft.fftshift(np.fft.irfft2(transfer, s=(size, size)))
        self._spots = _Spots(images, reach, distances)

    def add(self, z: float, light: Light) -> None:
        """Add the light of the glints with the focus at z, in place."""
        glints, distances = self._glints, self._spots.distances
        distance = np.abs(z - glints.z)
        upper = np.clip(np.searchsorted(distances, distance, side='right'), 1, len(distances) - 1)
        _add_spots(self._spots, _Sources(glints.row, glints.column, glints.light, distance, upper), light)

    def most(self) -> Light:
        """Return the most light on each pixel over all distances, (H, W) float32."""
        light = np.zeros(self._shape, dtype=np.float32)
        images = self._spots.images
        middle = images.shape[1] // 2
        most = images.max(axis=0)
        reach = int(self._spots.reach[-1])
        for row, column, strength in zip(self._glints.row, self._glints.column, self._glints.light, strict=True):
            top, left = max(row - reach, 0), max(column - reach, 0)
            part = light[top : row + reach + 1, left : column + reach + 1]
            down, right = middle + top - row, middle + left - column
            part += strength * most[down : down + part.shape[0], right : right + part.shape[1]]
        return light


@kernel
def _add_spots(spots: _Spots, sources: _Sources, light: Light) -> None:
    """Add each point source, blurred by its distance from focus, to `light`, (H, W)."""
    images, reach, distances = spots
    rows, columns, strengths, distance, upper = sources
    middle = images.shape[1] // 2
    for index in range(rows.size):
        top = upper[index]
        below, above = distances[top - 1] ** 2, distances[top] ** 2
        far = strengths[index] * min((distance[index] ** 2 - below) / (above - below), 1.0)
        near = strengths[index] - far
        r, c, width = rows[index], columns[index], reach[top]
        for row in range(max(r - width, 0), min(r + width + 1, light.shape[0])):
            for column in range(max(c - width, 0), min(c + width + 1, light.shape[1])):
                y, x = row - r + middle, column - c + middle
                light[row, column] += np.float32(near * images[top - 1, y, x] + far * images[top, y, x])
