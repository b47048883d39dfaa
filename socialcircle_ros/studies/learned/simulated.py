# SPDX-License-Identifier: Apache-2.0
"""Simulated surfaces without outliers: two dozen kinds of texture, with noise, holes and quantisation.

Heights are in standard deviations of the noise. Whatever these surfaces show belongs to them: islands, pits,
scratches, heavy tails. So the network learns that what occurs all over a surface is its texture.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from .random_fields import RandomField, fractal, smooth_noise

SurfaceGrid = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Row and column of each point, (H, W) each."""


def simulated_surface(side: int, random: np.random.Generator) -> RandomField:
    """A surface of a random kind, (side, side) float64, NaN where not measured."""
    shape = (side, side)
    grid: SurfaceGrid = tuple(np.mgrid[:side, :side].astype(np.float64))
    heights = _texture(grid, random)
    if random.random() < 0.2:
        heights = heights + _texture(grid, random) * random.uniform(0.1, 1.0)
    if random.random() < 0.12:
        heights = gaussian_filter(heights, random.uniform(0.5, 2.0))
    heights = heights + _noise(shape, random)
    if random.random() < 0.12:
        heights = gaussian_filter(heights, random.uniform(0.4, 1.2))
    if random.random() < 0.15:
        step = random.uniform(0.5, 5)
        heights = np.round(heights / step) * step
    if random.random() < 0.3:
        heights = _with_holes(heights, random)
    return heights + random.normal() * 3 * grid[1] + random.normal() * 3 * grid[0]


def _texture(grid: SurfaceGrid, random: np.random.Generator) -> RandomField:
    amplitude = 10 ** random.uniform(0.0, 2.3)
    return KINDS[random.integers(len(KINDS))](grid, amplitude, random)


def _noise(shape: tuple[int, int], random: np.random.Generator) -> RandomField:
    """White or correlated noise of standard deviation 1 or less, of uneven strength, sometimes with scan lines."""
    noise = random.normal(size=shape)
    if random.random() < 0.5:
        noise = smooth_noise(shape, float(random.uniform(0.4, 2.0)), random)
    if random.random() < 0.2:
        noise = random.standard_t(random.uniform(4, 12), size=shape)
    noise = noise * np.exp(random.uniform(0, 0.8) * fractal(shape, 1.0, random))
    if random.random() < 0.15:
        lines = random.normal(size=(shape[0], 1)) * random.uniform(0.3, 4)
        noise = noise + (lines if random.random() < 0.7 else lines.T)
    return np.asarray(noise * random.choice([1, 1, 0.3, 0.1]))


def _with_holes(heights: RandomField, random: np.random.Generator) -> RandomField:
    """Leave points out: blobs, single points, or ragged large areas."""
    field = smooth_noise(heights.shape, float(np.exp(random.uniform(np.log(0.5), np.log(25)))), random)
    missing = field > random.uniform(0.6, 3)
    if random.random() < 0.3:
        missing |= random.random(heights.shape) < random.uniform(0.001, 0.15)
    return np.where(missing, np.nan, heights)


def _turned(grid: SurfaceGrid, random: np.random.Generator) -> NDArray[np.float64]:
    """Position along a random direction, in points."""
    turn = random.uniform(0, np.pi)
    return np.asarray(grid[1] * np.cos(turn) + grid[0] * np.sin(turn))


def _flat(grid: SurfaceGrid, _: float, __: np.random.Generator) -> RandomField:
    """Nothing but noise: a polished or lapped part."""
    return np.zeros(grid[0].shape)


def _rough(grid: SurfaceGrid, amplitude: float, random: np.random.Generator) -> RandomField:
    return amplitude * fractal(grid[0].shape, random.uniform(0.05, 1.3), random)


def _brushed(grid: SurfaceGrid, amplitude: float, random: np.random.Generator) -> RandomField:
    return amplitude * fractal(grid[0].shape, random.uniform(0.05, 1.0), random, random.uniform(2, 15))


def _milled(grid: SurfaceGrid, amplitude: float, random: np.random.Generator) -> RandomField:
    bent = grid[0] ** 2 * random.choice([0, 0.001, 0.003])
    wave = np.sin(2 * np.pi * (_turned(grid, random) + bent) / random.uniform(8, 90))
    return np.asarray(amplitude * np.tanh(wave * random.uniform(0.5, 8)))


def _sine(grid: SurfaceGrid, amplitude: float, random: np.random.Generator) -> RandomField:
    """A grating, or the fringes of an interferometer left in the heights."""
    return np.asarray(amplitude * np.sin(2 * np.pi * _turned(grid, random) / random.uniform(5, 120)))


def _profile_drawn(grid: SurfaceGrid, amplitude: float, random: np.random.Generator) -> RandomField:
    """A turned part: one profile along all of the surface."""
    profile = np.cumsum(random.normal(size=grid[0].shape[1])) * random.uniform(0.5, 6)
    if random.random() < 0.5:
        profile = amplitude * np.abs(((np.arange(len(profile)) / random.uniform(6, 60)) % 1) - 0.5) * 2
    drawn = np.broadcast_to(profile, grid[0].shape)
    return np.asarray(drawn.T if random.random() < 0.5 else drawn) + 0.0


def _peaks(grid: SurfaceGrid, _: float, random: np.random.Generator) -> RandomField:
    """Peaks or pits where a smooth field passes a level."""
    field = smooth_noise(grid[0].shape, float(random.uniform(0.8, 5)), random)
    level = random.uniform(0.5, 2.4)
    return np.asarray(random.uniform(3, 40) * np.maximum(field - level, 0) * random.choice([-1, 1]))


def _dome(grid: SurfaceGrid, amplitude: float, random: np.random.Generator) -> RandomField:
    """A ball or lens: smooth, far larger than its noise."""
    middle = grid[0].shape[0] * random.uniform(0.2, 0.8, 2)
    flat, wide = random.uniform(120, 600, 2)
    rest = 1 - ((grid[1] - middle[0]) / flat) ** 2 - ((grid[0] - middle[1]) / wide) ** 2
    return np.asarray(10 * amplitude * np.sqrt(np.maximum(0, rest)))


def _islands(grid: SurfaceGrid, _: float, random: np.random.Generator) -> RandomField:
    """Plates on a ground: an etched pattern, flakes, a film with holes."""
    field = smooth_noise(grid[0].shape, float(random.uniform(1, 10)), random)
    plates = random.uniform(4, 100) * (field > random.uniform(-0.3, 2.0)) * random.choice([-1, 1])
    return np.asarray(gaussian_filter(plates, random.uniform(0.2, 1.5)))


def _terraces(grid: SurfaceGrid, _: float, random: np.random.Generator) -> RandomField:
    """Steps of one height along the contours of a smooth field."""
    field = fractal(grid[0].shape, random.uniform(0.6, 1.3), random) * random.uniform(1, 6)
    return np.asarray(np.round(field) * random.uniform(3, 60))


def _grains(grid: SurfaceGrid, _: float, random: np.random.Generator) -> RandomField:
    """Plates of a random tessellation at different heights, tilted or not."""
    side = grid[0].shape[0]
    count = int(10 ** random.uniform(1.0, 3.4))
    centres = random.uniform(0, side, (count, 2))
    distance, number = cKDTree(centres).query(np.stack([grid[0].ravel(), grid[1].ravel()], 1))
    plates = random.normal(size=count)[number] * random.uniform(1, 40)
    if random.random() < 0.4:
        plates = plates + distance * random.uniform(-3, 3)
    plates = plates.reshape(side, side)
    return np.asarray(gaussian_filter(plates, random.uniform(0.3, 1.5)) if random.random() < 0.5 else plates)


def _beads(grid: SurfaceGrid, amplitude: float, random: np.random.Generator) -> RandomField:
    """Packed balls or craters: powder, sintered or eroded metal."""
    side = grid[0].shape[0]
    count = int(10 ** random.uniform(2.0, 3.6))
    radius = side / np.sqrt(count) * random.uniform(0.5, 1.2)
    centres = random.uniform(0, side, (count, 2))
    distance, _ = cKDTree(centres).query(np.stack([grid[0].ravel(), grid[1].ravel()], 1))
    rest = np.sqrt(np.maximum(0, 1 - (distance / radius) ** 2)).reshape(side, side)
    return np.asarray(random.choice([-1, 1]) * amplitude * rest)


def _scratches(grid: SurfaceGrid, _: float, random: np.random.Generator) -> RandomField:
    """Straight scratches and ridges, which are real."""
    heights = np.zeros(grid[0].shape)
    way = random.choice([-1, 1, 0])
    parallel = random.random() < 0.4
    first = random.uniform(0, np.pi)
    for _ in range(random.integers(3, 60)):
        turn = first + random.normal() * 0.05 if parallel else random.uniform(0, np.pi)
        place = random.uniform(-1, 1.5) * grid[0].shape[0]
        across = np.abs(grid[1] * np.cos(turn) + grid[0] * np.sin(turn) - place)
        size = random.uniform(3, 50) * (way or random.choice([-1, 1]))
        heights += size * np.exp(-((across / random.uniform(0.7, 4)) ** 2))
    return heights


def _array(grid: SurfaceGrid, _: float, random: np.random.Generator) -> RandomField:
    """A regular array of dimples, bumps or pillars."""
    period = random.uniform(7, 60)
    radius = period * random.uniform(0.12, 0.45)
    turn = random.uniform(0, np.pi)
    along = (grid[1] * np.cos(turn) - grid[0] * np.sin(turn)) % period - period / 2
    across = (grid[1] * np.sin(turn) + grid[0] * np.cos(turn)) % period - period / 2
    square = random.random() < 0.3
    distance = np.maximum(np.abs(along), np.abs(across)) if square else np.hypot(along, across)
    shape = np.clip((radius - distance) / random.uniform(0.3, radius), 0, 1)
    return np.asarray(random.choice([-1, 1]) * random.uniform(5, 200) * shape)


def _steps(grid: SurfaceGrid, _: float, random: np.random.Generator) -> RandomField:
    """A few long steps, steep or blurred."""
    heights = np.zeros(grid[0].shape)
    for _ in range(random.integers(1, 6)):
        place = random.uniform(-0.3, 1.2) * grid[0].shape[0]
        far = np.clip((_turned(grid, random) - place) / random.uniform(0.1, 3), -50, 50)
        heights += random.choice([-1, 1]) * 10 ** random.uniform(0.8, 2.8) / (1 + np.exp(-far))
    return heights


def _heavy(grid: SurfaceGrid, amplitude: float, random: np.random.Generator) -> RandomField:
    """Roughness with heavy tails, which are real."""
    field = fractal(grid[0].shape, random.uniform(0, 0.9), random)
    return np.asarray(amplitude * 0.5 * np.sign(field) * np.abs(field) ** random.uniform(1.2, 3))


def _one_sided(grid: SurfaceGrid, amplitude: float, random: np.random.Generator) -> RandomField:
    """A worn surface with pores, or a flat one with dust all over."""
    field = fractal(grid[0].shape, random.uniform(0.1, 0.9), random)
    return np.asarray(amplitude * random.choice([-1, 1]) * np.exp(random.uniform(0.5, 1.5) * field) / 3)


def _woven(grid: SurfaceGrid, amplitude: float, random: np.random.Generator) -> RandomField:
    """Fabric, knurls and honing: two crossed waves."""
    waves = []
    for _ in range(2):
        wave = np.sin(2 * np.pi * _turned(grid, random) / random.uniform(6, 40))
        waves.append(np.abs(wave) ** random.uniform(0.3, 4))
    return np.asarray(amplitude * (np.maximum(*waves) if random.random() < 0.5 else waves[0] * waves[1]))


def _shapes(grid: SurfaceGrid, _: float, random: np.random.Generator) -> RandomField:
    """Parts on a table, as a laser line profiler sees them: raised discs and boxes with upright walls."""
    heights = np.zeros(grid[0].shape)
    side = grid[0].shape[0]
    for _ in range(random.integers(1, 12)):
        row, column = random.uniform(0, side, 2)
        size = random.uniform(0.03, 0.4) * side
        far = np.maximum(np.abs(grid[0] - row), np.abs(grid[1] - column) * random.uniform(0.3, 3))
        if random.random() < 0.5:
            far = np.hypot(grid[0] - row, grid[1] - column)
        heights = np.where(far < size, random.choice([-1, 1]) * 10 ** random.uniform(1, 3), heights)
    return heights


def _wrinkles(grid: SurfaceGrid, amplitude: float, random: np.random.Generator) -> RandomField:
    """Valleys or ridges along the zero lines of a field: leather, cracks, grain boundaries."""
    field = fractal(grid[0].shape, random.uniform(0.3, 1.2), random)
    return np.asarray(random.choice([-1, 1]) * amplitude * np.exp(-np.abs(field) / random.uniform(0.03, 0.4)))


KINDS: tuple[Callable[[SurfaceGrid, float, np.random.Generator], RandomField], ...] = (
    _flat, _flat, _rough, _rough, _brushed, _milled, _sine, _profile_drawn, _peaks, _dome, _islands, _islands,
    _terraces, _grains, _grains, _beads, _scratches, _array, _steps, _heavy, _heavy, _one_sided, _woven, _shapes,
    _wrinkles,
)  # fmt: skip
