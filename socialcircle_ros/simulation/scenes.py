# SPDX-License-Identifier: Apache-2.0
"""Named scenes: a surface with measurement noise and known outliers, as a cloud.

The heights are those of the surface, plus white noise, plus the displacements from `outliers`. For clouds measured
from a rendered focus stack, see `instrument`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.cloud import Mask
from socialcircle_ros.errors import SettingError

from . import surfaces
from .outliers import Contamination, add_outliers
from .surfaces import Grid, TrueHeights

Unit = Literal['um', 'm']


@dataclass(frozen=True, eq=False)
class Scene:
    """A cloud and the truth about it.

    Attributes:
        name: of the scene.
        points: (H, W, 3) float32, x, y, z in `unit`.
        outlier: (H, W) bool.
        ambiguous: (H, W) bool, True where a point is displaced by less than an outlier; leave it out of scores.
        cluster: (H, W) int32: 0 for a point that is not displaced, -1 for an isolated one, otherwise the number of
            the cluster, from 1.
        z_true: (H, W) float64, heights of the surface, in `unit`.
        pitch: along x and y, in `unit`.
        unit: 'um' or 'm'.
    """

    name: str
    points: NDArray[np.float32]
    outlier: Mask
    ambiguous: Mask
    cluster: NDArray[np.int32]
    z_true: TrueHeights
    pitch: tuple[float, float]
    unit: Unit


@dataclass(frozen=True, eq=False)
class Layout:
    """The ingredients of a scene.

    Attributes:
        surface: (H, W) float64, µm.
        weight: (H, W) ≥ 0: relative probability of an outlier at each point.
        noise: standard deviation of the heights, µm.
        contamination: the default outliers of the scene.
    """

    surface: TrueHeights
    weight: NDArray[np.float64]
    noise: float
    contamination: Contamination


Streams = list[np.random.Generator]


def make_scene(
    name: str,
    rows: int = 480,
    columns: int = 640,
    *,
    seed: int = 0,
    share: float | None = None,
    contamination: Contamination | None = None,
    pitch: tuple[float, float] = (1.0, 1.0),
    unit: Unit = 'um',
) -> Scene:
    """Make a named scene. The same arguments give the same bytes.

    Args:
        name: one of `SCENES`.
        rows: of the cloud.
        columns: of the cloud.
        seed: of everything random.
        share: of outliers, from 0 to below 1; None: that of `contamination` or of the scene, which is 0.0955, the
            share that Table 1 of the paper removes.
        contamination: the outliers; None: those of the scene.
        pitch: along x and y, µm.
        unit: of the scene: 'um' (micrometres) or 'm' (metres).

    Raises:
        SettingError: there is no such scene, or a value is out of its range.

    Example:
        >>> make_scene('flat', 60, 80, seed=1).points.shape
        (60, 80, 3)
    """
    if name not in SCENES:
        raise SettingError(f'There is no scene {name!r}; use one of: {", ".join(SCENES)}.')
    if unit not in ('um', 'm'):
        raise SettingError(f"The unit {unit!r} is not supported; use 'um' or 'm'.")
    grid = Grid(rows, columns, *pitch)
    build, noise, place = np.random.default_rng(seed).spawn(3)
    layout = SCENES[name](grid, build.spawn(4))
    wanted = layout.contamination if contamination is None else contamination
    wanted = wanted if share is None else replace(wanted, share=share)
    measured = layout.surface + layout.noise * noise.standard_normal(grid.shape)
    result = add_outliers(measured, wanted, place, layout.weight)
    scale = 1.0 if unit == 'um' else 1e-6
    points = np.empty((*grid.shape, 3), dtype=np.float32)
    points[..., 0] = grid.x * scale
    points[..., 1] = grid.y * scale
    points[..., 2] = result.heights * scale
    return Scene(
        name=name,
        points=points,
        outlier=result.outlier,
        ambiguous=result.ambiguous,
        cluster=result.cluster,
        z_true=layout.surface * scale,
        pitch=(grid.dx * scale, grid.dy * scale),
        unit=unit,
    )


def _pitch(grid: Grid) -> float:
    return max(grid.dx, grid.dy)


def _extent(grid: Grid) -> tuple[float, float]:
    return grid.columns * grid.dx, grid.rows * grid.dy


def _walls(form: TrueHeights, grid: Grid) -> NDArray[np.float64]:
    """1 where the form is steeper than 20°, 0 elsewhere."""
    slope = np.hypot(*np.gradient(form, grid.dy, grid.dx)) if min(grid.shape) > 1 else np.zeros(grid.shape)
    steep: NDArray[np.float64] = (slope > np.tan(np.deg2rad(20))).astype(np.float64)
    return steep


def _groove(grid: Grid, streams: Streams, wall_angle: float) -> Layout:
    """Ground lands and a milled groove, most outliers on its walls and floor: figures 1 and 7 of the paper."""
    width = 0.4 * _extent(grid)[0]
    depth = min(0.3 * width, 60 * _pitch(grid))
    form = surfaces.groove(grid, width, depth, wall_angle, wander=0.5 * _pitch(grid), seed=streams[0])
    floor = -form / depth
    rough = surfaces.fractal(grid, 0.1 * _pitch(grid), streams[1], lay=4.0)
    rough_floor = surfaces.fractal(grid, 0.3 * _pitch(grid), streams[2])
    marks = surfaces.milling_marks(grid, 1.2 * _pitch(grid), 14 * _pitch(grid), 1.5 * _extent(grid)[0], streams[3])
    return Layout(
        surface=form + rough + floor * (rough_floor + marks),
        weight=1 + 4 * floor + 15 * _walls(form, grid),
        noise=0.08 * _pitch(grid),
        contamination=Contamination(unit=_pitch(grid), amplitude=(6.0, 40.0), flank='sharp'),
    )


def _metal_groove(grid: Grid, streams: Streams) -> Layout:
    """Walls of 45°: neighbours differ by less than 2 pitches, so that the paper mode connects them."""
    return _groove(grid, streams, 45.0)


def _steep_groove(grid: Grid, streams: Streams) -> Layout:
    """Walls of 80°, above the 63° up to which the paper mode connects neighbours."""
    return _groove(grid, streams, 80.0)


def _closed_groove(grid: Grid, streams: Streams) -> Layout:
    """A closed steep groove around a disc: three surfaces that are not connected."""
    across = min(_extent(grid))
    form = surfaces.ring_groove(grid, 0.3 * across, 0.12 * across, 0.1 * across, 85.0)
    rough = surfaces.fractal(grid, 0.2 * _pitch(grid), streams[0])
    return Layout(
        surface=form + rough,
        weight=1 + 10 * _walls(form, grid),
        noise=0.08 * _pitch(grid),
        contamination=Contamination(unit=_pitch(grid)),
    )


def _composite(grid: Grid, streams: Streams) -> Layout:
    """Woven fibres in resin; most outliers are in the resin between the tows, which has little texture."""
    pitch = _pitch(grid)
    surface = surfaces.weave(
        grid, 0.25 * _extent(grid)[0], 24 * pitch, streams[0], fibre=9 * pitch, fibre_height=1.5 * pitch
    ) + surfaces.fractal(grid, 0.15 * pitch, streams[1])
    valley = surface < np.quantile(surface, 0.2)
    return Layout(
        surface=surface,
        weight=np.where(valley, 11.0, 1.0),
        noise=0.1 * pitch,
        contamination=Contamination(unit=pitch, amplitude=(6.0, 40.0), flank='sharp'),
    )


def _flat(grid: Grid, streams: Streams) -> Layout:
    """A blasted plane with heights far below the pitch; the unit of the outliers is its noise."""
    noise = 0.05 * _pitch(grid)
    surface = surfaces.tilt(grid, 0.01) + surfaces.fractal(grid, 0.1 * _pitch(grid), streams[0])
    return Layout(surface, np.ones(grid.shape), noise, Contamination(unit=noise))


def _ball(grid: Grid, streams: Streams) -> Layout:
    """The cap of a rough sphere: its form is far larger than the noise."""
    surface = surfaces.sphere(grid, 1.5 * max(_extent(grid))) + surfaces.fractal(
        grid, 0.1 * _pitch(grid), streams[0]
    )
    return Layout(
        surface, np.ones(grid.shape), 0.05 * _pitch(grid), Contamination(unit=_pitch(grid), flank='sharp')
    )


def _on_plane(grid: Grid, parts: TrueHeights, stream: np.random.Generator) -> Layout:
    """Parts with steep walls on a rough plane, with more outliers at the walls."""
    surface = parts + surfaces.fractal(grid, 0.1 * _pitch(grid), stream)
    weight = 1 + 6 * _walls(parts, grid)
    return Layout(surface, weight, 0.05 * _pitch(grid), Contamination(unit=_pitch(grid)))


def _steps(grid: Grid, streams: Streams) -> Layout:
    """Gauge steps with vertical walls."""
    return _on_plane(grid, surfaces.steps(grid, [0.0, 8.0, 20.0, 12.0, 0.0]) * _pitch(grid), streams[0])


def _discs(grid: Grid, streams: Streams) -> Layout:
    """Discs with vertical walls, each a separate surface."""
    pitch = _pitch(grid)
    parts = surfaces.discs(grid, 12, (15 * pitch, 40 * pitch), (5 * pitch, 25 * pitch), streams[1])
    return _on_plane(grid, parts, streams[0])


def _pits(grid: Grid, streams: Streams) -> Layout:
    """Casting pits, some with steep sides."""
    pitch = _pitch(grid)
    parts = surfaces.pits(grid, 25, (6 * pitch, 30 * pitch), (3 * pitch, 20 * pitch), streams[1])
    return _on_plane(grid, parts, streams[0])


def _islands(grid: Grid, streams: Streams) -> Layout:
    """An etched layer of islands that cover half of the area."""
    parts = surfaces.islands(grid, 4 * _pitch(grid), 16 * _pitch(grid), 0.5, streams[1])
    return _on_plane(grid, parts, streams[0])


def _quantised(grid: Grid, streams: Streams) -> Layout:
    """Heights rounded to steps of the stage, as simple software stores them: many neighbours are equal."""
    step = 0.25 * _pitch(grid)
    surface = surfaces.tilt(grid, 0.02, 0.005) + surfaces.fractal(grid, 0.1 * _pitch(grid), streams[0])
    levels = np.round(surface / step) * step
    return Layout(levels, np.ones(grid.shape), 0.0, Contamination(unit=step, flank='sharp'))


SCENES: dict[str, Callable[[Grid, Streams], Layout]] = {
    'metal_groove': _metal_groove,
    'steep_groove': _steep_groove,
    'closed_groove': _closed_groove,
    'composite': _composite,
    'flat': _flat,
    'ball': _ball,
    'steps': _steps,
    'discs': _discs,
    'pits': _pits,
    'islands': _islands,
    'quantised': _quantised,
}
"""Every named scene."""
