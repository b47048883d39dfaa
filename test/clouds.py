# SPDX-License-Identifier: Apache-2.0
"""Random organized clouds for property tests.

Hypothesis draws a `Recipe` of a few plain numbers, NumPy's generator fills the cloud from it: fast, and a
failure is printed as a recipe that can be pasted into a test and shrinks to few points and few troubles.
"""

from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st

SURFACES = ('zero', 'level', 'slope', 'noise', 'waves', 'step', 'coincident')
LAYOUTS = (
    'contiguous', 'padded', 'upside_down', 'mirrored', 'every_second', 'transposed',
    'swapped_axes', 'unaligned', 'read_only',
)  # fmt: skip
NOT_MEASURED = (np.nan, np.inf, -np.inf)

UNITS = {
    'float32': {'ordinary': 1.0, 'metres': 3e-6, 'tiny': 1e-22, 'huge': 5e18},
    'float64': {'ordinary': 1.0, 'metres': 3e-6, 'tiny': 1e-161, 'huge': 4e153},
}
"""In tiny units squares are subnormal or 0, in huge ones some of them are infinite."""


@dataclass(frozen=True)
class Recipe:
    """How to make a cloud; lengths are in pitches of x until the unit is applied."""

    rows: int
    columns: int
    dtype: str = 'float64'
    surface: str = 'level'
    amplitude: float = 1.0  # of the surface's heights
    pitch_y: float = 1.0
    jitter: float = 0.0  # of x and y
    quantum: float = 0.0  # heights are whole multiples of it
    spikes: float = 0.0  # share of single outliers
    clusters: int = 0  # blocks of outliers
    missing: float = 0.0  # share not measured
    holes: int = 0  # blocks not measured
    offset: float = 0.0  # of all three coordinates
    unit: str = 'ordinary'
    layout: str = 'contiguous'
    random: int = 0

    def cloud(self):
        """The cloud, always the same for the same recipe."""
        generator = np.random.default_rng(self.random)
        row, column = np.mgrid[: self.rows, : self.columns].astype(float)
        xyz = np.stack([column, row * self.pitch_y, self._heights(generator, row, column)], axis=2)
        if self.jitter:
            xyz[..., :2] += generator.normal(0, self.jitter, (self.rows, self.columns, 2))
        if self.surface == 'coincident':  # whole groups of points on one place
            xyz[..., :2] = np.floor(xyz[..., :2] / 4)
        xyz = (xyz + self.offset) * UNITS[self.dtype][self.unit]
        gone = generator.random((self.rows, self.columns)) < self.missing
        for _ in range(self.holes):
            top, left = generator.integers(0, self.rows), generator.integers(0, self.columns)
            gone[top : top + self.rows // 3 + 1, left : left + self.columns // 3 + 1] = True
        coordinate = generator.integers(0, 3, (self.rows, self.columns))
        bad = generator.choice(NOT_MEASURED, (self.rows, self.columns))
        xyz[gone, coordinate[gone]] = bad[gone]
        with np.errstate(over='ignore', under='ignore'):
            return laid_out(xyz.astype(self.dtype), self.layout)

    def _heights(self, generator, row, column):
        shape = (self.rows, self.columns)
        z = {
            'zero': lambda: np.zeros(shape),
            'level': lambda: np.full(shape, generator.choice([-1.0, 1.0])),
            'slope': lambda: column + 0.5 * row - self.columns / 2,
            'noise': lambda: generator.normal(0, 1, shape),
            'waves': lambda: np.sin(column / 2) + np.cos(row / 3),
            'step': lambda: np.where(column > self.columns // 2, 4.0, 0.0),
            'coincident': lambda: np.zeros(shape),
        }[self.surface]()
        z = z * self.amplitude
        spiked = generator.random(shape) < self.spikes
        z[spiked] += generator.uniform(-20, 20, shape)[spiked]
        for _ in range(self.clusters):
            top, left = generator.integers(0, self.rows), generator.integers(0, self.columns)
            height, width = generator.integers(1, 6, 2)
            z[top : top + height, left : left + width] += generator.choice([-10, -3, 3, 10])
        return np.round(z / self.quantum) * self.quantum if self.quantum else z


def laid_out(xyz, layout):
    """The same values in another arrangement of memory, as messages and slices have them."""
    rows, columns, _ = xyz.shape
    if layout == 'padded':  # x, y, z and a fourth word, as in PointCloud2
        base = np.full((rows, columns, 4), 7, dtype=xyz.dtype)
        view = base[..., :3]
    elif layout == 'upside_down':
        view = np.empty_like(xyz)[::-1]
    elif layout == 'mirrored':
        view = np.empty_like(xyz)[:, ::-1]
    elif layout == 'every_second':
        view = np.full((2 * rows, 2 * columns, 3), 7, dtype=xyz.dtype)[::2, 1::2]
    elif layout == 'transposed':
        view = np.empty((columns, rows, 3), dtype=xyz.dtype).transpose(1, 0, 2)
    elif layout == 'swapped_axes':  # fields z, y, x
        view = np.empty_like(xyz)[..., ::-1]
    elif layout == 'unaligned':  # a point step that is no multiple of the field's size
        size = xyz.dtype.itemsize
        step = 3 * size + 1
        buffer = bytearray(rows * columns * step)
        view = np.ndarray(xyz.shape, xyz.dtype, buffer, 1, (columns * step, step, size))
    else:
        view = np.empty_like(xyz)
    view[...] = xyz
    if layout == 'read_only':
        view.setflags(write=False)
    return view


def recipes(rows=24, columns=24, least_rows=1, least_columns=1):
    """Recipes of clouds of so many rows and columns; the first choice of each field is the simplest."""
    return st.builds(
        Recipe,
        rows=st.integers(least_rows, rows),
        columns=st.integers(least_columns, columns),
        dtype=st.sampled_from(['float64', 'float32']),
        surface=st.sampled_from(SURFACES),
        amplitude=st.sampled_from([1.0, 0.3, 2.0, 1e-5, 1e5]),
        pitch_y=st.sampled_from([1.0, 0.7, 3.0]),
        jitter=st.sampled_from([0.0, 0.1, 0.5]),
        quantum=st.sampled_from([0.0, 0.5, 2.0]),
        spikes=st.sampled_from([0.0, 0.1, 0.4]),
        clusters=st.integers(0, 3),
        missing=st.sampled_from([0.0, 0.0, 0.0, 0.1, 0.1, 0.1, 0.4, 0.4, 0.9, 1.0]),
        holes=st.integers(0, 2),
        offset=st.sampled_from([0.0, 0.0, -3.0, 1e4, 1e6]),
        unit=st.sampled_from(['ordinary'] * 6 + ['metres', 'tiny', 'huge']),
        layout=st.sampled_from(LAYOUTS),
        random=st.integers(0, 2**16),
    )


def measured_points(xyz):
    """(row, column) of each measured point, in row-major order."""
    return [tuple(map(int, place)) for place in np.argwhere(np.isfinite(xyz).all(axis=2))]


def grid(heights, pitch=1.0, dtype='float64'):
    """A cloud on a regular grid with these heights; NaN is not measured."""
    heights = np.asarray(heights, dtype=dtype)
    row, column = np.mgrid[: heights.shape[0], : heights.shape[1]]
    return np.stack([column * pitch, row * pitch, heights], axis=2).astype(dtype)


def flat(rows, columns, pitch=1.0, dtype='float64'):
    """A flat cloud at height 0."""
    return grid(np.zeros((rows, columns)), pitch, dtype)


def pitch_of(xyz):
    """The median step along x; 1 if there is none."""
    steps = np.abs(np.diff(xyz[..., 0], axis=1))
    steps = steps[np.isfinite(steps) & (steps > 0)]
    return np.median(steps) if steps.size else xyz.dtype.type(1)
