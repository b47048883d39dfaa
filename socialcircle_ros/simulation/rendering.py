"""The image at a given position of the stage: every point as blurred as its distance from focus asks for.

Two renderers that share only what is sharp (diffraction, pixel) and nothing of how defocus is made:

`LayeredRenderer` blurs the whole radiance once for each of some forty distances, by FFT, and takes each
pixel from the two that bracket its own. Each pixel is right as if its surroundings lay at its own depth;
light that a wall keeps from the lens is missing, the veil that an edge out of focus throws over its
lower neighbours is not modelled. Fast: what a stack is made with.

`RayRenderer` follows rays from the pixel through the lens down to the surface: depth that changes within
the circle of confusion, and occlusion, come out by themselves. Slow: the check of the other, and for small
fields where walls matter.

Light that goes from wall to wall is in neither, but for the glints, which are point sources at depths of
their own.
"""

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.errors import SettingError
from socialcircle_ros.kernels.compiled import kernel

from .optics import Optics
from .specimen import Glints, Specimen
from .surfaces import HeightMap

Light = NDArray[np.float32]


class Renderer(Protocol):
    """What makes images."""

    def render(self, z: float) -> Light:
        """The light on each pixel, (H, W) float32, with the focus at z in µm; 1 is bright metal."""


class LayeredRenderer:
    """Interpolates between blurred versions of the radiance; see the module.

    Memory: 4 bytes per point and layer, whatever the number of frames.
    """

    def __init__(self, specimen: Specimen, optics: Optics, low: float, high: float) -> None:
        """Blur the radiance for every distance that the scan will need.

        Args:
            specimen: what is seen.
            optics: through what.
            low: lowest z that will be rendered, µm.
            high: highest.
        """
        _check_pitch(specimen, optics)
        self.low, self.high = low, high
        depths = np.concatenate([specimen.surface.ravel(), specimen.glints.z])
        farthest = float(max(high - depths.min(), depths.max() - low, optics.depth_of_field))
        self.distances = _distances(farthest, optics)
        openness = aperture_openness(specimen.surface, optics)
        # The light comes down the same cone that it goes up, so that a wall takes its share twice.
        self._layers = _blurred(specimen.radiance * openness**2, self.distances, optics)
        self._surface = specimen.surface
        self._glare = _Glare(specimen.glints, self.distances, optics, specimen.grid.shape)
        self._lookup = np.searchsorted(
            self.distances, np.arange(0, farthest, self.distances[1]), side='right'
        ).astype(np.int64)

    def render(self, z: float) -> Light:
        """See `Renderer`.

        Raises:
            SettingError: z lies outside what the renderer was made for.
        """
        if not self.low <= z <= self.high:
            raise SettingError(f'z = {z:.3f} µm is outside {self.low:.3f} to {self.high:.3f} µm.')
        light = np.empty(self._surface.shape, dtype=np.float32)
        _gather(self._layers, self.distances, self._lookup, self._surface, z, light)
        self._glare.add(z, light)
        return light

    @property
    def sharp(self) -> Light:
        """(H, W) float32: every pixel in focus at once, without glints."""
        layer: Light = self._layers[0]
        return layer

    def glare(self) -> Light:
        """(H, W) float32: the most light that glints throw on each pixel, at whatever z."""
        return self._glare.most()


class RayRenderer:
    """Follows rays down to the surface; see the module."""

    def __init__(self, specimen: Specimen, optics: Optics, low: float, high: float, rays: int = 200) -> None:
        """Prepare radiance and surface.

        Args:
            specimen: what is seen.
            optics: through what.
            low: lowest z that will be rendered, µm; glints are prepared for it.
            high: highest.
            rays: per pixel and frame.
        """
        _check_pitch(specimen, optics)
        depths = np.concatenate([specimen.surface.ravel(), specimen.glints.z])
        farthest = float(max(high - depths.min(), depths.max() - low, optics.depth_of_field))
        self._pad = _margin(farthest, optics)
        radiance = specimen.radiance * aperture_openness(specimen.surface, optics)
        self._radiance = _upsampled(_padded(radiance, self._pad), optics)
        self._surface = _padded(specimen.surface, self._pad)
        self._shape = specimen.grid.shape
        self._slopes = _pupil(rays) * optics.cone / optics.pitch
        self._glare = _Glare(specimen.glints, _distances(farthest, optics), optics, specimen.grid.shape)

    def render(self, z: float) -> Light:
        """See `Renderer`."""
        light = np.empty(self._shape, dtype=np.float32)
        top, bottom = float(self._surface.max()), float(self._surface.min())
        _trace(self._radiance, _FINER, self._surface, self._pad, self._slopes, z, top, bottom, light)
        self._glare.add(z, light)
        return light


def aperture_openness(surface: HeightMap, optics: Optics) -> Light:
    """The share of the light cone over each point that no wall cuts off, (H, W) float32, 0 to 1."""
    steepest = max(
        (float(np.abs(np.diff(surface, axis=axis)).max()) for axis in (0, 1) if surface.shape[axis] > 1),
        default=0.0,
    )
    share = np.ones(surface.shape, dtype=np.float32)
    if steepest * optics.cone > optics.pitch:
        _open_share(surface, _pupil(32) * optics.cone / optics.pitch, float(surface.max()), share)
    return share


def _check_pitch(specimen: Specimen, optics: Optics) -> None:
    if not np.allclose((specimen.grid.dx, specimen.grid.dy), optics.pitch):
        raise SettingError(
            f'The specimen has a pitch of {specimen.grid.dx}×{specimen.grid.dy} µm, the optics of'
            f' {optics.pitch} µm; make the specimen with pitch={optics.pitch}.'
        )


def _distances(farthest: float, optics: Optics) -> HeightMap:
    """Distances from focus at which layers are made: dense near focus, then growing by a tenth each."""
    fine = optics.depth_of_field / 12
    near = np.arange(0, 18) * fine
    count = max(int(np.ceil(np.log(farthest / near[-1]) / np.log(1.1))), 0) + 1
    return np.concatenate([near, near[-1] * 1.1 ** np.arange(1, count + 1)])


def _margin(farthest: float, optics: Optics) -> int:
    """Points by which a field must be continued, so that its border has neighbours to blur with."""
    return int(np.ceil(1.1 * farthest * optics.cone / optics.pitch)) + 8


def _padded(field: NDArray[np.floating], pad: int) -> HeightMap:
    """The field continued by its mirror image to all sides, and further to lengths that suit the FFT."""
    extra = [(pad, _fast_length(size + 2 * pad) - size - pad) for size in field.shape]
    return np.pad(field.astype(np.float64), extra, mode='symmetric')


def _fast_length(least: int) -> int:
    """The smallest even number of the form 2^a·3^b·5^c that is not below `least`."""
    length = least + least % 2
    while True:
        rest = length
        for factor in (2, 3, 5):
            while rest % factor == 0:
                rest //= factor
        if rest == 1:
            return length
        length += 2


def _frequencies(shape: tuple[int, ...], pitch: float) -> tuple[HeightMap, HeightMap]:
    fx = np.fft.rfftfreq(shape[1], pitch).astype(np.float64)
    fy = np.fft.fftfreq(shape[0], pitch).astype(np.float64)
    return fx[np.newaxis, :], fy[:, np.newaxis]


def _blurred(radiance: Light, distances: HeightMap, optics: Optics) -> Light:
    """The radiance as seen from each distance, (L, H, W) float32."""
    rows, columns = radiance.shape
    pad = _margin(float(distances[-2]), optics)
    padded = _padded(radiance, pad)
    fx, fy = _frequencies(padded.shape, optics.pitch)
    spectrum = np.fft.rfft2(padded) * optics.sharp_transfer(fx, fy)
    frequency = np.hypot(fx, fy)
    layers = np.empty((len(distances), rows, columns), dtype=np.float32)
    for layer, distance in zip(layers, distances, strict=True):
        image = np.fft.irfft2(spectrum * optics.defocus_transfer(frequency, distance), s=padded.shape)
        layer[:] = image[pad : pad + rows, pad : pad + columns]
    return layers


class _Glare:
    """Glints as the camera sees them, near and far from their focus."""

    def __init__(self, glints: Glints, distances: HeightMap, optics: Optics, shape: tuple[int, int]) -> None:
        self._glints = glints
        self._distances = distances
        self._shape = shape
        self._reach = np.ceil(distances * optics.cone / optics.pitch).astype(np.int64) + 6
        size = _fast_length(2 * int(self._reach[-1]) + 2)
        fx, fy = _frequencies((size, size), optics.pitch)
        frequency = np.hypot(fx, fy)
        sharp = optics.sharp_transfer(fx, fy)
        self._spots = np.empty((len(distances), size, size), dtype=np.float32)
        for spot, distance in zip(self._spots, distances, strict=True):
            transfer = sharp * optics.defocus_transfer(frequency, distance)
            spot[:] = np.fft.fftshift(np.fft.irfft2(transfer, s=(size, size)))

    def add(self, z: float, light: Light) -> None:
        """Add the glints, with the focus at z, in place."""
        glints = self._glints
        distance = np.abs(z - glints.z)
        upper = np.clip(np.searchsorted(self._distances, distance, side='right'), 1, len(self._distances) - 1)
        _add_spots(
            self._spots,
            self._reach,
            self._distances,
            glints.row,
            glints.column,
            glints.light,
            distance,
            upper,
            light,
        )

    def most(self) -> Light:
        """The most light on each pixel over all distances."""
        light = np.zeros(self._shape, dtype=np.float32)
        middle = self._spots.shape[1] // 2
        most = self._spots.max(axis=0)
        reach = int(self._reach[-1])
        for row, column, strength in zip(self._glints.row, self._glints.column, self._glints.light, strict=True):
            top, left = max(row - reach, 0), max(column - reach, 0)
            part = light[top : row + reach + 1, left : column + reach + 1]
            down, right = middle + top - row, middle + left - column
            part += strength * most[down : down + part.shape[0], right : right + part.shape[1]]
        return light


@kernel
def _gather(
    layers: Light, distances: HeightMap, lookup: NDArray[np.int64], surface: HeightMap, z: float, light: Light
) -> None:
    """Each pixel from the two layers that bracket its distance from focus.

    The blurred image is even in the distance u, so that it is smooth in u²: linear interpolation there is
    right to the fourth order at the focus, where the depth comes from.
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


@kernel
def _add_spots(
    spots: Light,
    reach: NDArray[np.int64],
    distances: HeightMap,
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    strengths: HeightMap,
    distance: HeightMap,
    upper: NDArray[np.int64],
    light: Light,
) -> None:
    """Add each point source, blurred by its distance from focus."""
    middle = spots.shape[1] // 2
    for index in range(rows.size):
        top = upper[index]
        below, above = distances[top - 1] ** 2, distances[top] ** 2
        far = strengths[index] * min((distance[index] ** 2 - below) / (above - below), 1.0)
        near = strengths[index] - far
        r, c, width = rows[index], columns[index], reach[top]
        for row in range(max(r - width, 0), min(r + width + 1, light.shape[0])):
            for column in range(max(c - width, 0), min(c + width + 1, light.shape[1])):
                y, x = row - r + middle, column - c + middle
                light[row, column] += np.float32(near * spots[top - 1, y, x] + far * spots[top, y, x])


def _pupil(count: int) -> HeightMap:
    """Points spread evenly over the unit disc, (count, 2): Vogel's sunflower."""
    index = np.arange(count) + 0.5
    radius, angle = np.sqrt(index / count), index * np.pi * (3 - np.sqrt(5))
    points: HeightMap = np.stack([radius * np.sin(angle), radius * np.cos(angle)], axis=1)
    return points


_FINER = 4
"""How much finer than the pixels the radiance is sampled for the rays, so that looking up blurs nothing."""


def _upsampled(field: HeightMap, optics: Optics) -> Light:
    """The sharp image on a grid `_FINER` times finer, by filling its spectrum up with zeros."""
    rows, columns = field.shape
    fx, fy = _frequencies(field.shape, optics.pitch)
    spectrum = np.fft.rfft2(field) * optics.sharp_transfer(fx, fy)
    spectrum[:, -1] *= 0.5  # lengths are even: the last frequency now stands for itself and its mirror
    spectrum[rows // 2] *= 0.5
    finer = np.zeros((rows * _FINER, columns * _FINER // 2 + 1), dtype=np.complex128)
    finer[: rows // 2 + 1, : columns // 2 + 1] = spectrum[: rows // 2 + 1]
    finer[-(rows // 2) :, : columns // 2 + 1] = spectrum[rows // 2 :]
    fine: Light = np.fft.irfft2(finer, s=(rows * _FINER, columns * _FINER)).astype(np.float32)
    fine *= np.float32(_FINER**2)
    return fine


@kernel
def _height_at(surface: NDArray[Any], row: float, column: float) -> float:
    """Bilinear height; beyond the border, that of the border."""
    row = min(max(row, 0.0), surface.shape[0] - 1.001)
    column = min(max(column, 0.0), surface.shape[1] - 1.001)
    r, c = int(row), int(column)
    y, x = row - r, column - c
    upper: float = surface[r, c] * (1 - x) + surface[r, c + 1] * x
    lower: float = surface[r + 1, c] * (1 - x) + surface[r + 1, c + 1] * x
    return upper * (1 - y) + lower * y


@kernel
def _trace(
    radiance: Light,
    finer: int,
    surface: HeightMap,
    pad: int,
    slopes: HeightMap,
    z: float,
    top: float,
    bottom: float,
    light: Light,
) -> None:
    """The mean radiance where the rays through each pixel's point in the plane of focus meet the surface.

    `slopes`: (M, 2), by how many points a ray moves along rows and columns per µm of height.
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
                    gap = height - _height_at(surface, y, x)
                    if gap <= 0:
                        if step > 0:
                            height = above - (above - height) * gap_above / (gap_above - gap)
                        break
                    above, gap_above = height, gap
                y, x = row + pad + (z - height) * down, column + pad + (z - height) * right
                total += _height_at(radiance, y * finer, x * finer)
            light[row, column] = total / slopes.shape[0]


@kernel
def _open_share(surface: HeightMap, slopes: HeightMap, top: float, share: Light) -> None:
    """The share of the rays upward from each point that nothing stands in the way of."""
    rows, columns = surface.shape
    for row in range(rows):
        for column in range(columns):
            free = 0
            for ray in range(slopes.shape[0]):
                down, right = slopes[ray, 0], slopes[ray, 1]
                rise = 0.7 / np.sqrt(down * down + right * right)
                height = surface[row, column] + rise
                blocked = False
                while height < top:
                    lift = height - surface[row, column]
                    y, x = int(row + lift * down + 0.5), int(column + lift * right + 0.5)
                    if not (0 <= y < rows and 0 <= x < columns):
                        break
                    if surface[y, x] > height:
                        blocked = True
                        break
                    height += rise
                free += not blocked
            share[row, column] = free / slopes.shape[0]
