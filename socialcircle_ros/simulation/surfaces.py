# SPDX-License-Identifier: Apache-2.0
"""Height maps of surfaces: form, roughness, grooves, steps, pits, discs, woven fibres.

Each function returns the heights (H, W) float64 in µm on a `Grid`. Heights add up: a rough groove is
`groove(...) + fractal(...)`. Random surfaces take a seed, and the same seed gives the same bytes. Noise, outliers
and optics are in other modules.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.errors import SettingError

TrueHeights = NDArray[np.float64]
"""Heights (H, W) in µm."""

Seed = int | np.random.Generator | np.random.SeedSequence
"""An argument of `numpy.random.default_rng`. A generator is used directly, so that its state changes."""

_Amplitude = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]


@dataclass(frozen=True)
class Grid:
    """The positions of the points of a surface: H rows along y, W columns along x, pitch in µm."""

    rows: int
    columns: int
    dx: float = 1.0
    dy: float = 1.0

    def __post_init__(self) -> None:
        """Check the sizes.

        Raises:
            SettingError: the grid has no points, or a pitch is not positive.
        """
        if self.rows < 1 or self.columns < 1:
            raise SettingError(f'A grid of {self.rows}×{self.columns} has no points; give at least 1×1.')
        if not (self.dx > 0 and self.dy > 0):
            raise SettingError(f'The pitch is {self.dx}×{self.dy} µm; both must be above 0.')

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.rows, self.columns

    @property
    def x(self) -> NDArray[np.float64]:
        """Positions of the columns, (1, W), from 0, µm."""
        return np.arange(self.columns, dtype=np.float64)[np.newaxis, :] * self.dx

    @property
    def y(self) -> NDArray[np.float64]:
        """Positions of the rows, (H, 1), from 0, µm."""
        return np.arange(self.rows, dtype=np.float64)[:, np.newaxis] * self.dy

    @property
    def centre(self) -> tuple[float, float]:
        """The middle as (x, y), µm."""
        return (self.columns - 1) * self.dx / 2, (self.rows - 1) * self.dy / 2


# Form


def tilt(grid: Grid, slope_x: float, slope_y: float = 0.0) -> TrueHeights:
    """A plane with height 0 in the middle; slopes in µm per µm."""
    cx, cy = grid.centre
    plane: TrueHeights = slope_x * (grid.x - cx) + slope_y * (grid.y - cy)
    return plane


def sphere(grid: Grid, radius: float) -> TrueHeights:
    """The top of a sphere: 0 in the middle, negative around it; radius in µm."""
    cx, cy = grid.centre
    squared = (grid.x - cx) ** 2 + (grid.y - cy) ** 2
    farthest = float(np.sqrt(squared.max()))
    if not radius > farthest:
        raise SettingError(
            f'A radius of {radius} µm does not reach the edge of the field; give more than {farthest:.0f} µm.'
        )
    cap: TrueHeights = np.sqrt(radius**2 - squared) - radius
    return cap


# Roughness


def gaussian(grid: Grid, sq: float, correlation: float, seed: Seed) -> TrueHeights:
    """Roughness with a Gaussian autocorrelation: it has one lateral scale.

    Args:
        grid: of the points.
        sq: root mean square height (ISO 25178 Sq), µm; met exactly.
        correlation: the lag at which the autocorrelation falls to 1/e, µm.
        seed: of the random heights.
    """
    decay = (np.pi * correlation) ** 2 / 2

    return _shaped(grid, sq, lambda fx, fy: np.exp(-decay * (fx**2 + fy**2)), seed)


def fractal(
    grid: Grid, sq: float, seed: Seed, *, hurst: float = 0.8, longest: float = 100.0, lay: float = 1.0
) -> TrueHeights:
    """Self-affine roughness, as of ground, blasted or broken metal: it has all scales below the longest one.

    The power spectrum is (1 + (f·longest)²)^-(1 + hurst): constant above the longest wavelength, a power law below
    it. Source: T. D. B. Jacobs, T. Junge, L. Pastewka, Quantitative characterization of surface topography using
    spectral analysis, Surf. Topogr.: Metrol. Prop. 5 (2017) 013001, DOI 10.1088/2051-672X/aa51f8.

    Args:
        grid: of the points.
        sq: root mean square height (ISO 25178 Sq), µm; met exactly.
        seed: of the random heights.
        hurst: Hurst exponent, from 0 (rugged) to 1 (smooth).
        longest: wavelength above which the heights no longer grow, µm.
        lay: length of the texture along y divided by that along x; 1: no lay.
    """

    def amplitude(fx: NDArray[np.float64], fy: NDArray[np.float64]) -> NDArray[np.float64]:
        squared: NDArray[np.float64] = (fx**2 + (lay * fy) ** 2) * longest**2
        return (1 + squared) ** (-(1 + hurst) / 2)

    return _shaped(grid, sq, amplitude, seed)


def _shaped(grid: Grid, sq: float, amplitude: _Amplitude, seed: Seed) -> TrueHeights:
    """Noise with the amplitude spectrum `amplitude(fx, fy)`, frequencies in 1/µm; periodic in the field."""
    spectrum = np.fft.rfft2(np.random.default_rng(seed).standard_normal(grid.shape))
    fx = np.fft.rfftfreq(grid.columns, grid.dx).astype(np.float64)[np.newaxis, :]
    fy = np.fft.fftfreq(grid.rows, grid.dy).astype(np.float64)[:, np.newaxis]
    spectrum *= amplitude(fx, fy)
    spectrum[0, 0] = 0
    rough: TrueHeights = np.fft.irfft2(spectrum, s=grid.shape)
    spread = float(rough.std())
    return rough * (sq / spread) if spread > 0 else rough


def milling_marks(grid: Grid, depth: float, spacing: float, cutter: float, seed: Seed) -> TrueHeights:
    """The arcs of a face mill, one for each feed, with cusps between them.

    Args:
        grid: of the points.
        depth: mean height from valley to cusp, µm; it varies by 10 % from arc to arc.
        spacing: feed per tooth, µm; it varies by 5 %.
        cutter: radius of the cutter, µm.
        seed: of the variations.
    """
    rng = np.random.default_rng(seed)
    # The cutter moves along y with its axis over the middle: this is the position of the arc through each point.
    along = grid.y - np.sqrt(np.maximum(cutter**2 - (grid.x - grid.centre[0]) ** 2, 0.0))
    along = along - along.min()
    count = int(along.max() / (spacing * 0.5)) + 2
    edges = np.cumsum(spacing * np.maximum(1 + 0.05 * rng.standard_normal(count), 0.5))
    arc = np.searchsorted(edges, along, side='right')
    starts = np.concatenate([[0.0], edges])
    inside = (along - starts[arc]) / (starts[arc + 1] - starts[arc])
    height = depth * (1 + 0.1 * rng.standard_normal(count + 1))
    marks: TrueHeights = height[arc] * ((2 * inside - 1) ** 2 - 1 / 3)
    return marks


# Parts


def groove(
    grid: Grid, width: float, depth: float, wall_angle: float, *, wander: float = 0.0, seed: Seed = 0
) -> TrueHeights:
    """A groove along y in the middle, with lands at 0 and a flat floor at -depth.

    Args:
        grid: of the points.
        width: between the upper edges, µm.
        depth: of the floor, µm.
        wall_angle: between walls and lands, degrees, up to 90.
        wander: root mean square deviation of the edges from a straight line, µm.
        seed: of these deviations.

    Raises:
        SettingError: the angle is out of its range, or the groove is too narrow for a floor.
    """
    offset = _wander(grid, wander, seed)
    return _walled(width / 2 - np.abs(grid.x - grid.centre[0] - offset), width, depth, wall_angle)


def ring_groove(grid: Grid, radius: float, width: float, depth: float, wall_angle: float) -> TrueHeights:
    """A circular groove around the middle: it separates the disc inside from the land outside.

    Args:
        grid: of the points.
        radius: of the middle line, µm.
        width: between the upper edges, µm.
        depth: of the floor, µm.
        wall_angle: between walls and lands, degrees, up to 90.

    Raises:
        SettingError: the angle is out of its range, or the groove is too narrow for a floor.
    """
    cx, cy = grid.centre
    return _walled(width / 2 - np.abs(np.hypot(grid.x - cx, grid.y - cy) - radius), width, depth, wall_angle)


def _walled(inward: NDArray[np.float64], width: float, depth: float, wall_angle: float) -> TrueHeights:
    """A groove, from the distance `inward` of each point from the upper edge, µm."""
    if not 0 < wall_angle <= 90:
        raise SettingError(f'The wall angle is {wall_angle}°; it must be above 0 and at most 90.')
    run = depth / np.tan(np.deg2rad(wall_angle))
    if 2 * run >= width:
        raise SettingError(
            f'A groove {width} µm wide has no floor at a depth of {depth} µm with walls of {wall_angle}°;'
            f' give a width above {2 * run:.0f} µm.'
        )
    down: TrueHeights = np.clip(inward / max(run, 1e-9), 0.0, 1.0)
    return -depth * down


def _wander(grid: Grid, rms: float, seed: Seed) -> NDArray[np.float64]:
    """A smooth lateral deviation of each row, (H, 1), µm."""
    if rms == 0:
        return np.zeros((grid.rows, 1))
    return gaussian(Grid(grid.rows, 1, dy=grid.dy), rms, 40.0, seed)


def steps(grid: Grid, heights: Sequence[float]) -> TrueHeights:
    """Lands of equal width side by side along x, at the given heights in µm, with vertical walls between them."""
    if not heights:
        raise SettingError('Steps need at least one height.')
    index = np.arange(grid.columns) * len(heights) // grid.columns
    levels: TrueHeights = np.asarray(heights, dtype=np.float64)[index]
    return np.broadcast_to(levels, grid.shape).copy()


def pits(
    grid: Grid, count: int, radius: tuple[float, float], depth: tuple[float, float], seed: Seed
) -> TrueHeights:
    """Paraboloidal pits, 0 elsewhere; the deeper one counts where two overlap.

    Args:
        grid: of the points.
        count: number of pits.
        radius: smallest and largest, µm.
        depth: smallest and largest, µm.
        seed: of places and sizes.
    """
    rng = np.random.default_rng(seed)
    surface = np.zeros(grid.shape)
    for _ in range(count):
        x, y = rng.uniform(0, grid.columns * grid.dx), rng.uniform(0, grid.rows * grid.dy)
        r, d = rng.uniform(*radius), rng.uniform(*depth)
        inside = np.maximum(1 - ((grid.x - x) ** 2 + (grid.y - y) ** 2) / r**2, 0.0)
        surface = np.minimum(surface, -d * inside)
    return surface


def discs(
    grid: Grid,
    count: int,
    radius: tuple[float, float],
    height: tuple[float, float],
    seed: Seed,
    *,
    wall_angle: float = 90.0,
) -> TrueHeights:
    """Raised discs with flat tops, 0 elsewhere; the higher one counts where two overlap.

    Args:
        grid: of the points.
        count: number of discs.
        radius: smallest and largest, at the foot, µm.
        height: smallest and largest, µm.
        seed: of places and sizes.
        wall_angle: between walls and plane, degrees, up to 90.
    """
    rng = np.random.default_rng(seed)
    surface = np.zeros(grid.shape)
    for _ in range(count):
        x, y = rng.uniform(0, grid.columns * grid.dx), rng.uniform(0, grid.rows * grid.dy)
        r, h = rng.uniform(*radius), rng.uniform(*height)
        inward = r - np.hypot(grid.x - x, grid.y - y)
        run = max(h / np.tan(np.deg2rad(wall_angle)), 1e-9)
        surface = np.maximum(surface, h * np.clip(inward / run, 0.0, 1.0))
    return surface


def islands(grid: Grid, height: float, size: float, share: float, seed: Seed) -> TrueHeights:
    """Ragged plateaus with vertical walls on a plane at 0, as of an etched or printed layer.

    Args:
        grid: of the points.
        height: of the plateaus, µm.
        size: typical extent of a plateau, µm.
        share: of the area that the plateaus cover, 0 to 1.
        seed: of the shapes.
    """
    relief = gaussian(grid, 1.0, size / 2, seed)
    raised: TrueHeights = np.where(relief > np.quantile(relief, 1 - share), height, 0.0)
    return raised


def weave(
    grid: Grid, tow: float, crimp: float, seed: Seed, *, fibre: float = 7.0, fibre_height: float = 1.2
) -> TrueHeights:
    """A fibre composite in plain weave: tows over and under each other, with single fibres, and resin between.

    Args:
        grid: of the points.
        tow: width of a tow, µm.
        crimp: height from the lowest resin to the highest crest, µm.
        seed: of the positions of the fibres and the levels of the tows.
        fibre: diameter of a fibre, µm.
        fibre_height: height of a fibre above the resin between two fibres, µm.
    """
    streams = np.random.default_rng(seed).spawn(2)
    along_y = _tows(grid, tow, crimp, streams[0], fibre=fibre, fibre_height=fibre_height, parity=0)
    turned = Grid(grid.columns, grid.rows, dx=grid.dy, dy=grid.dx)
    along_x = _tows(turned, tow, crimp, streams[1], fibre=fibre, fibre_height=fibre_height, parity=1).T
    resin = -0.75 * crimp
    woven: TrueHeights = np.maximum(np.maximum(along_y, along_x), resin)
    return woven


def _tows(
    grid: Grid,
    tow: float,
    crimp: float,
    rng: np.random.Generator,
    *,
    fibre: float,
    fibre_height: float,
    parity: int,
) -> TrueHeights:
    """The tows along y; they are on top where the sum of column and row of the weave has this parity."""
    index = np.floor(grid.x / tow).astype(np.int64)
    across = grid.x / tow - index - 0.5  # -0.5..0.5
    level = rng.normal(0.0, 0.03 * crimp, int(index.max()) + 1)[index]
    wander = rng.uniform(0, fibre, int(index.max()) + 1)[index]
    wander = wander + gaussian(grid, 0.15 * fibre, 4 * fibre, rng)
    sign = 1 - 2 * ((index + parity) % 2)
    undulation = 0.25 * crimp * sign * np.sin(np.pi * grid.y / tow)
    crown = -crimp * across**2  # a flat ellipse, lower by a quarter of the crimp at its sides
    ridges = fibre_height * (np.abs(np.cos(np.pi * (grid.x + wander) / fibre)) - 1)
    tows: TrueHeights = level + undulation + crown + ridges - 0.25 * crimp
    return tows
