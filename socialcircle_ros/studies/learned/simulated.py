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

from socialcircle_ros.cloud import Mask

from .random_fields import RandomField, fractal, smooth_noise

SurfaceGrid = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Row and column of each point, (H, W) each."""


_ALL_OVER = 0.04
"""Share of the surface that grains cover at least: fewer would look like outliers."""


def simulated_surface(side: int, random: np.random.Generator) -> RandomField:
    """A surface of a random kind, (side, side) float64, measured everywhere."""
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
    if random.random() < 0.2:
        heights = _quantised(heights, random)
    return heights + random.normal() * 3 * grid[1] + random.normal() * 3 * grid[0]


def _texture(grid: SurfaceGrid, random: np.random.Generator) -> RandomField:
    amplitude = 10 ** random.uniform(0.0, 2.3)
    return KINDS[random.integers(len(KINDS))](grid, amplitude, random)


def _noise(shape: tuple[int, int], random: np.random.Generator) -> RandomField:
    """White or correlated noise of a standard deviation of about 1 or less; some is uneven or has scan lines."""
    noise = random.normal(size=shape)
    if random.random() < 0.5:
        noise = smooth_noise(shape, float(random.uniform(0.4, 2.0)), random)
    if random.random() < 0.3:
        noise = _tailed_noise(shape, random)
    if random.random() < 0.7:
        noise = noise * np.exp(random.uniform(0, 0.8) * fractal(shape, 1.0, random))
    if random.random() < 0.15:
        lines = random.normal(size=(shape[0], 1)) * random.uniform(0.3, 4)
        noise = noise + (lines if random.random() < 0.7 else lines.T)
    return np.asarray(noise * random.choice([1, 1, 0.3, 0.1]))


def _tailed_noise(shape: tuple[int, int], random: np.random.Generator) -> RandomField:
    """Noise with longer tails than normal noise has, on both sides or on one."""
    kind = random.random()
    if kind < 0.5:
        return random.standard_t(random.uniform(4, 12), size=shape)
    if kind < 0.6:
        return random.laplace(size=shape)
    way = random.choice([-1, 1])
    if kind < 0.8:
        return np.asarray(way * random.gamma(random.uniform(0.5, 4), size=shape))
    return np.asarray(way * np.exp(random.uniform(0.3, 0.8) * random.normal(size=shape)) * 2)


def _quantised(heights: RandomField, random: np.random.Generator) -> RandomField:
    """Heights as they are stored or counted: in steps, now and then with some noise of a later computation."""
    step = np.exp(random.uniform(np.log(0.5), np.log(8)))
    stored = np.round(heights / step) * step
    later = 10 ** random.uniform(-3.5, -1) if random.random() < 0.2 else 0.0
    return np.asarray(stored + later * step * random.normal(size=heights.shape))


def with_holes(heights: RandomField, random: np.random.Generator) -> RandomField:
    """Leave points out: blobs, ragged areas, up to three quarters of them at random, or a regular pattern."""
    if random.random() < 0.25:
        return np.where(_sparse(heights.shape, random), heights, np.nan)
    field = smooth_noise(heights.shape, float(np.exp(random.uniform(np.log(0.5), np.log(25)))), random)
    missing = field > random.uniform(0.6, 3)
    if random.random() < 0.3:
        missing |= random.random(heights.shape) < random.uniform(0.001, 0.15)
    return np.where(missing, np.nan, heights)


def _sparse(shape: tuple[int, int], random: np.random.Generator) -> Mask:
    """The measured points of a sparse scan: some at random, every nth row or column, or a checkerboard."""
    kind = random.random()
    if kind < 0.4:
        return random.random(shape) > random.uniform(0.15, 0.75)
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    if kind < 0.7:
        down, across = random.choice([(1, 2), (2, 1), (2, 2), (1, 3), (3, 1), (2, 3), (3, 2), (3, 3)])
        return np.asarray((rows % down == 0) & (columns % across == 0))
    size = random.integers(1, 4)
    return np.asarray((rows // size + columns // size) % 2 == 0)


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
    """A grating, the fringes of an interferometer left in the heights, or a form of long and high waves."""
    period = random.uniform(5, 120)
    high = random.uniform(1, 4) if period > 50 else 1.0
    return np.asarray(high * amplitude * np.sin(2 * np.pi * _turned(grid, random) / period))


def _fine(grid: SurfaceGrid, amplitude: float, random: np.random.Generator) -> RandomField:
    """A fine pattern of 2 to 14 points: sines, lines, teeth or ridges along one direction, or two that cross."""
    waves = []
    turn = random.choice([0.0, 0.0, random.uniform(0, np.pi)])
    for position in (
        grid[1] * np.cos(turn) + grid[0] * np.sin(turn), grid[0] * np.cos(turn) - grid[1] * np.sin(turn)
    ):  # fmt: skip
        period = random.uniform(2, 14) if random.random() < 0.5 else float(random.integers(2, 15))
        phase = (position / period + random.random()) % 1
        kind = random.random()
        if kind < 0.3:
            waves.append(np.sin(2 * np.pi * phase) / 2)
        elif kind < 0.6:
            waves.append((phase < random.uniform(0.15, 0.85)) - 0.5)
        elif kind < 0.8:
            waves.append(phase - 0.5)
        else:
            waves.append(np.abs(2 * phase - 1) - 0.5)
    kind = random.random()
    if kind < 0.6:
        wave = waves[0]
    elif kind < 0.8:
        wave = 2 * waves[0] * waves[1]
    else:
        wave = np.minimum(*waves)
    return np.asarray(amplitude * random.choice([-1, 1]) * wave)


def _stairs(grid: SurfaceGrid, _: float, random: np.random.Generator) -> RandomField:
    """Stairs of equal steps, along one direction or two."""
    height = 10 ** random.uniform(0.7, 2.3)
    stairs = np.floor(_turned(grid, random) / random.uniform(4, 50))
    if random.random() < 0.3:
        stairs = stairs + np.floor(_turned(grid, random) / random.uniform(4, 50))
    return np.asarray(height * stairs)


def _fibres(grid: SurfaceGrid, _: float, random: np.random.Generator) -> RandomField:
    """Fibres that lie across each other, with round tops and upright flanks: paper, felt, a brush."""
    heights = np.zeros(grid[0].shape)
    radius = random.uniform(1, 6)
    first, spread = random.uniform(0, np.pi), random.choice([0.1, 0.5, 3.0])
    for _ in range(random.integers(20, 200)):
        turn = first + spread * random.normal()
        place = random.uniform(-1.5, 1.5) * grid[0].shape[0]
        across = grid[1] * np.cos(turn) + grid[0] * np.sin(turn) - place
        rest = radius**2 - across**2
        fibre = np.where(rest > 0, random.uniform(0, 60) + 8 * np.sqrt(np.maximum(0, rest)), 0)
        heights = np.maximum(heights, fibre)
    return heights


def _grit(grid: SurfaceGrid, _: float, random: np.random.Generator) -> RandomField:
    """Balls, pins or blocks all over a ground: powder, solder, embossed dots."""
    side = grid[0].shape[0]
    radius = random.uniform(1.2, 8)
    cover = np.exp(random.uniform(np.log(_ALL_OVER), np.log(0.6)))
    count = int(cover * side**2 / (np.pi * radius**2)) + 3
    centres = random.uniform(0, side, (count, 2))
    metric = random.choice([2, np.inf])
    distance, number = cKDTree(centres).query(np.stack([grid[0].ravel(), grid[1].ravel()], 1), p=metric)
    sizes = radius * np.exp(random.choice([0, 0.3]) * random.normal(size=count))[number]
    rest = np.maximum(0, 1 - (distance / sizes) ** 2)
    shape = np.sqrt(rest) if random.random() < 0.5 else (rest > 0) * 1.0
    each = 1 + random.choice([0, 0.1, 0.5]) * random.normal(size=count)[number]
    return np.asarray(random.choice([-1, 1]) * 10 ** random.uniform(0.8, 2.2) * (shape * each).reshape(side, side))


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
    _flat, _flat, _flat, _rough, _rough, _brushed, _milled, _sine, _sine, _fine, _fine, _fine, _profile_drawn,
    _peaks, _dome, _islands, _islands, _terraces, _stairs, _grains, _grains, _beads, _grit, _scratches, _fibres,
    _array, _steps, _heavy, _heavy, _one_sided, _woven, _shapes, _wrinkles,
)  # fmt: skip
