# SPDX-License-Identifier: Apache-2.0
"""The image at a given position of the stage: each point is blurred by its distance from focus.

There are two renderers. They share the sharp image (diffraction, pixel) but not the defocus, so that each of them
checks the other.

`LayeredRenderer` blurs the whole radiance for about forty distances, by FFT, and interpolates each pixel between
the two layers next to its distance. Each pixel is exact if its neighbourhood is at its own depth. Light that walls
keep from the lens is missing; light that an out-of-focus edge spreads over lower neighbours is not modelled. This
renderer is fast, and makes the stacks.

`RayRenderer` follows rays from the pixel through the lens to the surface. This includes occlusion, and depth that
changes within the circle of confusion. It is slow, and is for checks and for small fields with walls.

Neither models interreflections between walls, except glints: these are point sources at their own depths.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.errors import SettingError
from socialcircle_ros.kernels.compiled import kernel

from .aperture import aperture_openness, pupil
from .glare import Glare
from .optics import Optics
from .sampling import Light, check_pitch, frequencies, layer_distances, margin_of, mirrored
from .specimen import Specimen
from .surfaces import TrueHeights

_FINER = 4
"""Samples of the radiance per pixel along each axis for the rays, so that interpolation does not blur it."""


class Renderer(Protocol):
    """Makes the images of a specimen."""

    def render(self, z: float) -> Light:
        """Return the light on each pixel, (H, W) float32, with the focus at z in µm."""


class LayeredRenderer:
    """Interpolates between blurred images of the radiance, see the module.

    It takes 4 bytes per point and layer, for any number of frames.
    """

    def __init__(self, specimen: Specimen, optics: Optics, low: float, high: float) -> None:
        """Blur the radiance for all distances of the scan.

        Args:
            specimen: the specimen.
            optics: of the microscope.
            low: lowest z to render, µm.
            high: highest z to render, µm.

        Raises:
            SettingError: the specimen has another pitch than the optics.
        """
        check_pitch(specimen, optics)
        self.low, self.high = low, high
        depths = np.concatenate([specimen.surface.ravel(), specimen.glints.z])
        farthest = float(max(high - depths.min(), depths.max() - low, optics.depth_of_field))
        self.distances = layer_distances(farthest, optics)
        openness = aperture_openness(specimen.surface, optics)
        # Light comes and goes through the same cone, so that a wall blocks its share twice.
        self._layers = _blurred(specimen.radiance * openness**2, self.distances, optics)
        self._surface = specimen.surface
        self._glare = Glare(specimen.glints, self.distances, optics, specimen.grid.shape)
        self._lookup = np.searchsorted(
            self.distances, np.arange(0, farthest, self.distances[1]), side='right'
        ).astype(np.int64)

    def render(self, z: float) -> Light:
        """See `Renderer`.

        Raises:
            SettingError: z is outside the range for which the renderer was made.
        """
        if not self.low <= z <= self.high:
            raise SettingError(
                f'z = {z:.3f} µm is outside {self.low:.3f} to {self.high:.3f} µm; prepare a wider range.'
            )
        light = np.empty(self._surface.shape, dtype=np.float32)
        _gather(self._layers, self.distances, self._lookup, self._surface, z, light)
        self._glare.add(z, light)
        return light

    @property
    def sharp(self) -> Light:
        """The image with every pixel in focus, without glints, (H, W) float32."""
        layer: Light = self._layers[0]
        return layer

    def glare(self) -> Light:
        """Return the most light of glints on each pixel over all z, (H, W) float32."""
        return self._glare.most()


class RayRenderer:
    """Follows rays to the surface, see the module."""

    def __init__(self, specimen: Specimen, optics: Optics, low: float, high: float, rays: int = 200) -> None:
        """Prepare radiance and surface.

        Args:
            specimen: the specimen.
            optics: of the microscope.
            low: lowest z to render, µm.
            high: highest z to render, µm.
            rays: per pixel and frame.

        Raises:
            SettingError: the specimen has another pitch than the optics.
        """
        check_pitch(specimen, optics)
        depths = np.concatenate([specimen.surface.ravel(), specimen.glints.z])
        farthest = float(max(high - depths.min(), depths.max() - low, optics.depth_of_field))
        self._pad = margin_of(farthest, optics)
        radiance = specimen.radiance * aperture_openness(specimen.surface, optics)
        self._radiance = _upsampled(mirrored(radiance, self._pad), optics)
        self._surface = mirrored(specimen.surface, self._pad)
        self._shape = specimen.grid.shape
        self._slopes = pupil(rays) * optics.cone / optics.pitch
        self._glare = Glare(specimen.glints, layer_distances(farthest, optics), optics, specimen.grid.shape)

    def render(self, z: float) -> Light:
        """See `Renderer`."""
        light = np.empty(self._shape, dtype=np.float32)
        top, bottom = float(self._surface.max()), float(self._surface.min())
        _trace(self._radiance, self._surface, self._pad, self._slopes, z, top, bottom, light)
        self._glare.add(z, light)
        return light


def _blurred(radiance: Light, distances: NDArray[np.float64], optics: Optics) -> Light:
    """Return the image of the radiance at each distance from focus, (L, H, W) float32."""
    rows, columns = radiance.shape
    pad = margin_of(float(distances[-2]), optics)
    padded = mirrored(radiance, pad)
    fx, fy = frequencies(padded.shape, optics.pitch)
    spectrum = np.fft.rfft2(padded) * optics.sharp_transfer(fx, fy)
    frequency = np.hypot(fx, fy)
    layers = np.empty((len(distances), rows, columns), dtype=np.float32)
    for layer, distance in zip(layers, distances, strict=True):
        image = np.fft.irfft2(spectrum * optics.defocus_transfer(frequency, distance), s=padded.shape)
        layer[:] = image[pad : pad + rows, pad : pad + columns]
    return layers


@kernel
def _gather(
    layers: Light,
    distances: NDArray[np.float64],
    lookup: NDArray[np.int64],
    surface: TrueHeights,
    z: float,
    light: Light,
) -> None:
    """Interpolate each pixel between the two layers next to its distance from focus.

    The blurred image is an even function of the distance u, and so a smooth function of u². The error of linear
    interpolation in u² is of fourth order near focus, where the depth is found.

    Args:
        layers: (L, H, W), from `_blurred`.
        distances: (L,) of the layers, µm.
        lookup: index of the first layer beyond a distance, for multiples of the distance of the first two layers.
        surface: (H, W), µm.
        z: of the focus, µm.
        light: (H, W), written.
    """
    for row in range(surface.shape[0]):
        for column in range(surface.shape[1]):
            distance = abs(z - surface[row, column])
            place = int(distance / distances[1])
            upper = lookup[min(place, lookup.size - 1)]
            while distances[upper] <= distance and upper < distances.size - 1:
                upper += 1
            below, above = distances[upper - 1] ** 2, distances[upper] ** 2
            share = np.float32((distance * distance - below) / (above - below))
            near, far = layers[upper - 1, row, column], layers[upper, row, column]
            light[row, column] = near + share * (far - near)


def _upsampled(field: NDArray[np.float64], optics: Optics) -> Light:
    """Return the sharp image on a grid `_FINER` times finer, by padding its spectrum with zeros."""
    rows, columns = field.shape
    fx, fy = frequencies(field.shape, optics.pitch)
    spectrum = np.fft.rfft2(field) * optics.sharp_transfer(fx, fy)
    spectrum[:, -1] *= 0.5  # lengths are even: the last frequency also stands for its mirror image
    spectrum[rows // 2] *= 0.5
    finer = np.zeros((rows * _FINER, columns * _FINER // 2 + 1), dtype=np.complex128)
    finer[: rows // 2 + 1, : columns // 2 + 1] = spectrum[: rows // 2 + 1]
    finer[-(rows // 2) :, : columns // 2 + 1] = spectrum[rows // 2 :]
    fine: Light = np.fft.irfft2(finer, s=(rows * _FINER, columns * _FINER)).astype(np.float32)
    fine *= np.float32(_FINER**2)
    return fine


@kernel
def _bilinear(field: Light | TrueHeights, row: float, column: float) -> float:
    """Interpolate a field bilinearly; beyond the border it has the value of the border."""
    row = min(max(row, 0.0), field.shape[0] - 1.001)
    column = min(max(column, 0.0), field.shape[1] - 1.001)
    r, c = int(row), int(column)
    y, x = row - r, column - c
    upper: float = field[r, c] * (1 - x) + field[r, c + 1] * x
    lower: float = field[r + 1, c] * (1 - x) + field[r + 1, c + 1] * x
    return upper * (1 - y) + lower * y


@kernel
def _trace(
    radiance: Light,
    surface: TrueHeights,
    pad: int,
    slopes: NDArray[np.float64],
    z: float,
    top: float,
    bottom: float,
    light: Light,
) -> None:
    """Average the radiance where the rays of each pixel, which meet in the plane of focus, hit the surface.

    Args:
        radiance: padded, `_FINER` times finer than the surface.
        surface: padded, µm.
        pad: points of padding before the first row and column of the surface.
        slopes: (M, 2), points that a ray moves along rows and columns per µm of height.
        z: of the focus, µm.
        top: greatest height of the surface, µm.
        bottom: least height of the surface, µm.
        light: (H, W), written.
    """
    for row in range(light.shape[0]):
        for column in range(light.shape[1]):
            total = 0.0
            for ray in range(slopes.shape[0]):
                down, right = slopes[ray, 0], slopes[ray, 1]
                steps = int(2 * (top - bottom) * np.sqrt(down * down + right * right)) + 1
                fall = (top - bottom) / steps
                above = height = top
                gap_above = 0.0
                for step in range(steps + 1):
                    height = top - step * fall
                    y, x = row + pad + (z - height) * down, column + pad + (z - height) * right
                    gap = height - _bilinear(surface, y, x)
                    if gap <= 0:
                        if step > 0:
                            height = above - (above - height) * gap_above / (gap_above - gap)
                        break
                    above, gap_above = height, gap
                y, x = row + pad + (z - height) * down, column + pad + (z - height) * right
                total += _bilinear(radiance, y * _FINER, x * _FINER)
            light[row, column] = total / slopes.shape[0]
