"""Height maps of surfaces: form, roughness, grooves, steps, pits, discs, woven fibres.

Every function gives the heights (H, W) float64 in µm on a `Grid`, and heights add up: a rough groove is
`groove(...) + fractal(...)`. Whatever is random takes a seed, and the same seed gives the same bytes.
No measurement lives here: neither noise, nor outliers, nor optics.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.errors import SettingError

HeightMap = NDArray[np.float64]
Seed = int | np.random.Generator | np.random.SeedSequence
"""What numpy's `default_rng` takes; a generator is used as it is, and moves on."""


@dataclass(frozen=True)
class Grid:
    """Where the points of a surface lie: H rows along y, W columns along x, pitch in µm."""

    rows: int
    columns: int
    dx: float = 1.0
    dy: float = 1.0

    def __post_init__(self) -> None:
        """Check the sizes.

        Raises:
            SettingError: there is no point, or a pitch is not positive.
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
    def x(self) -> HeightMap:
        """Positions of the columns, (1, W), from 0, µm."""
        return np.arange(self.columns, dtype=np.float64)[np.newaxis, :] * self.dx

    @property
    def y(self) -> HeightMap:
        """Positions of the rows, (H, 1), from 0, µm."""
        return np.arange(self.rows, dtype=np.float64)[:, np.newaxis] * self.dy

    @property
    def centre(self) -> tuple[float, float]:
        """The middle as (x, y), µm."""
        return (self.columns - 1) * self.dx / 2, (self.rows - 1) * self.dy / 2


# Form


def tilt(grid: Grid, slope_x: float, slope_y: float = 0.0) -> HeightMap:
    """A plane through 0 in the middle; slopes in µm per µm."""
    cx, cy = grid.centre
    plane: HeightMap = slope_x * (grid.x - cx) + slope_y * (grid.y - cy)
    return plane


def cylinder(grid: Grid, radius: float) -> HeightMap:
    """The top of a cylinder that lies along y, 0 on its crest, falling to its sides; radius in µm."""
    return _cap((grid.x - grid.centre[0]) ** 2 + 0 * grid.y, radius)


def sphere(grid: Grid, radius: float) -> HeightMap:
    """The top of a sphere, 0 in the middle; radius in µm."""
    cx, cy = grid.centre
    return _cap((grid.x - cx) ** 2 + (grid.y - cy) ** 2, radius)


def _cap(squared: HeightMap, radius: float) -> HeightMap:
    farthest = float(np.sqrt(squared.max()))
    if not radius > farthest:
        raise SettingError(
            f'A radius of {radius} µm does not reach the edge of the field; give more than {farthest:.0f} µm.'
        )
    cap: HeightMap = np.sqrt(radius**2 - squared) - radius
    return cap


# Roughness


def gaussian(grid: Grid, sq: float, correlation: float, seed: Seed) -> HeightMap:
    """Roughness whose autocorrelation is a Gaussian: one lateral scale.

    Args:
        grid: where.
        sq: root mean square height (ISO 25178 Sq), µm; met exactly.
        correlation: the lag at which the autocorrelation falls to 1/e, µm.
        seed: of the random phases.
    """
    decay = (np.pi * correlation) ** 2 / 2

    return _shaped(grid, sq, lambda fx, fy: np.exp(-decay * (fx**2 + fy**2)), seed)


def fractal(
    grid: Grid, sq: float, seed: Seed, *, hurst: float = 0.8, longest: float = 100.0, lay: float = 1.0
) -> HeightMap:
    """Self-affine roughness, like ground, blasted or broken metal: all scales below one.

    The power spectrum is (1 + (f·longest)²)^-(1 + hurst): flat above the longest wavelength, a power law
    below it (Jacobs, Junge, Pastewka: Surf. Topogr. 5 (2017) 013001).

    Args:
        grid: where.
        sq: root mean square height (ISO 25178 Sq), µm; met exactly.
        seed: of the random phases.
        hurst: Hurst exponent, 0 (rugged) to 1 (smooth).
        longest: wavelength above which heights no longer grow, µm.
        lay: how much longer the texture is along y than along x, 1 for none.
    """

    def gain(fx: HeightMap, fy: HeightMap) -> HeightMap:
        squared: HeightMap = (fx**2 + (lay * fy) ** 2) * longest**2
        gained: HeightMap = (1 + squared) ** (-(1 + hurst) / 2)
        return gained

    return _shaped(grid, sq, gain, seed)


def _shaped(grid: Grid, sq: float, gain: Callable[[HeightMap, HeightMap], HeightMap], seed: Seed) -> HeightMap:
    """White noise with the amplitude spectrum `gain(fx, fy)`, frequencies in 1/µm; periodic in the field."""
    spectrum = np.fft.rfft2(np.random.default_rng(seed).standard_normal(grid.shape))
    fx = np.fft.rfftfreq(grid.columns, grid.dx).astype(np.float64)[np.newaxis, :]
    fy = np.fft.fftfreq(grid.rows, grid.dy).astype(np.float64)[:, np.newaxis]
    spectrum *= gain(fx, fy)
    spectrum[0, 0] = 0
    rough: HeightMap = np.fft.irfft2(spectrum, s=grid.shape)
    spread = float(rough.std())
    return rough * (sq / spread) if spread > 0 else rough


def milling_marks(grid: Grid, depth: float, spacing: float, cutter: float, seed: Seed) -> HeightMap:
    """The arcs that a face mill leaves at each feed, cusps up.

    Args:
        grid: where.
        depth: mean height from valley to cusp, µm; it varies by a tenth from arc to arc.
        spacing: feed per tooth, µm; it varies by a twentieth.
        cutter: radius of the cutter, µm.
        seed: of the variations.
    """
    rng = np.random.default_rng(seed)
    # The cutter moves along y with its axis over the middle: position of the arc through each point.
    along = grid.y - np.sqrt(np.maximum(cutter**2 - (grid.x - grid.centre[0]) ** 2, 0.0))
    along = along - along.min()
    count = int(along.max() / (spacing * 0.5)) + 2
    edges = np.cumsum(spacing * np.maximum(1 + 0.05 * rng.standard_normal(count), 0.5))
    arc = np.searchsorted(edges, along, side='right')
    starts = np.concatenate([[0.0], edges])
    inside = (along - starts[arc]) / (starts[arc + 1] - starts[arc])
    height = depth * (1 + 0.1 * rng.standard_normal(count + 1))
    marks: HeightMap = height[arc] * ((2 * inside - 1) ** 2 - 1 / 3)
    return marks


# Parts


def groove(
    grid: Grid, width: float, depth: float, wall_angle: float, *, wander: float = 0.0, seed: Seed = 0
) -> HeightMap:
    """A groove along y in the middle: lands at 0, flat floor at -depth.

    Args:
        grid: where.
        width: between the upper edges, µm.
        depth: µm.
        wall_angle: of the walls against the lands, degrees, up to 90.
        wander: root mean square by which the edges leave the straight line, µm.
        seed: of the wandering.
    """
    offset = _wander(grid, wander, seed)
    return _walled(width / 2 - np.abs(grid.x - grid.centre[0] - offset), width, depth, wall_angle)


def ring_groove(grid: Grid, radius: float, width: float, depth: float, wall_angle: float) -> HeightMap:
    """A closed groove round the middle: the disc within it hangs together with the land round it nowhere.

    Args:
        grid: where.
        radius: of the middle line, µm.
        width: between the upper edges, µm.
        depth: µm.
        wall_angle: degrees, up to 90.
    """
    cx, cy = grid.centre
    return _walled(width / 2 - np.abs(np.hypot(grid.x - cx, grid.y - cy) - radius), width, depth, wall_angle)


def _walled(inward: HeightMap, width: float, depth: float, wall_angle: float) -> HeightMap:
    """0 to -depth, by the distance `inward` from the upper edge."""
    if not 0 < wall_angle <= 90:
        raise SettingError(f'A wall of {wall_angle}° is not possible; give more than 0 and at most 90.')
    run = depth / np.tan(np.deg2rad(wall_angle))
    if 2 * run >= width:
        raise SettingError(
            f'A groove {width} µm wide has no floor at a depth of {depth} µm and walls of {wall_angle}°;'
            f' give a width above {2 * run:.0f} µm.'
        )
    down: HeightMap = np.clip(inward / max(run, 1e-9), 0.0, 1.0)
    return -depth * down


def _wander(grid: Grid, rms: float, seed: Seed) -> HeightMap:
    """A smooth sideways deviation for each row, (H, 1), µm."""
    if rms == 0:
        return np.zeros((grid.rows, 1))
    return gaussian(Grid(grid.rows, 1, dy=grid.dy), rms, 40.0, seed)


def steps(grid: Grid, heights: Sequence[float]) -> HeightMap:
    """Lands of equal width side by side along x, at the given heights in µm, vertical walls between them."""
    if not heights:
        raise SettingError('Steps need at least one height.')
    index = np.arange(grid.columns) * len(heights) // grid.columns
    levels: HeightMap = np.asarray(heights, dtype=np.float64)[index]
    return np.broadcast_to(levels, grid.shape).copy()


def pits(grid: Grid, count: int, radius: tuple[float, float], depth: tuple[float, float], seed: Seed) -> HeightMap:
    """Round pits with the shape of a paraboloid, 0 elsewhere; where two meet, the deeper counts.

    Args:
        grid: where.
        count: how many.
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
) -> HeightMap:
    """Raised discs with flat tops, 0 elsewhere; where two meet, the higher counts.

    Args:
        grid: where.
        count: how many.
        radius: smallest and largest, at the foot, µm.
        height: smallest and largest, µm.
        seed: of places and sizes.
        wall_angle: degrees, up to 90.
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


def islands(grid: Grid, height: float, size: float, share: float, seed: Seed) -> HeightMap:
    """Ragged plateaus with vertical walls over 0, as an etched or printed layer leaves them.

    Args:
        grid: where.
        height: of the plateaus, µm.
        size: typical extent of one, µm.
        share: of the area that the plateaus cover, 0 to 1.
        seed: of their shapes.
    """
    relief = gaussian(grid, 1.0, size / 2, seed)
    raised: HeightMap = np.where(relief > np.quantile(relief, 1 - share), height, 0.0)
    return raised


def weave(
    grid: Grid, tow: float, crimp: float, seed: Seed, *, fibre: float = 7.0, fibre_height: float = 1.2
) -> HeightMap:
    """A fibre composite in plain weave: tows over and under each other, single fibres, resin between.

    Args:
        grid: where.
        tow: width of a bundle, µm.
        crimp: height from the lowest resin to the highest crest, µm.
        seed: of the fibres' wandering and of each tow's level.
        fibre: diameter of a fibre, µm.
        fibre_height: how far a fibre stands out of the resin between two, µm.
    """
    streams = np.random.default_rng(seed).spawn(2)
    along_y = _tows(grid, tow, crimp, streams[0], fibre=fibre, fibre_height=fibre_height, parity=0)
    turned = Grid(grid.columns, grid.rows, dx=grid.dy, dy=grid.dx)
    along_x = _tows(turned, tow, crimp, streams[1], fibre=fibre, fibre_height=fibre_height, parity=1).T
    resin = -0.75 * crimp
    woven: HeightMap = np.maximum(np.maximum(along_y, along_x), resin)
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
) -> HeightMap:
    """The tows that run along y; they cross over where column and row of the weave have `parity`."""
    index = np.floor(grid.x / tow).astype(np.int64)
    across = grid.x / tow - index - 0.5  # -0.5..0.5
    level = rng.normal(0.0, 0.03 * crimp, int(index.max()) + 1)[index]
    wander = rng.uniform(0, fibre, int(index.max()) + 1)[index]
    wander = wander + gaussian(grid, 0.15 * fibre, 4 * fibre, rng)
    sign = 1 - 2 * ((index + parity) % 2)
    undulation = 0.25 * crimp * sign * np.sin(np.pi * grid.y / tow)
    crown = -crimp * across**2  # flat ellipse, falling by a quarter of the crimp to its sides
    ridges = fibre_height * (np.abs(np.cos(np.pi * (grid.x + wander) / fibre)) - 1)
    tows: HeightMap = level + undulation + crown + ridges - 0.25 * crimp
    return tows
