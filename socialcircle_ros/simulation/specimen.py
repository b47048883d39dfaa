"""What the instrument looks at: a surface, how it throws the light back, and its glints.

Light comes through the objective (coaxial). A facet throws back ρ · (k_d cos θ + k_s exp(-tan² θ / 2m²)):
a matte part, and a glossy lobe that walls turn away from the lens; steep walls are dark by that alone.
ρ carries the fine texture that focus variation lives on; polished zones have next to none of it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.errors import SettingError

from . import surfaces
from .scenes import SCENES, Layout
from .surfaces import Grid, HeightMap


@dataclass(frozen=True)
class Material:
    """How a surface looks.

    Attributes:
        matte: k_d, the share of light that is scattered everywhere.
        gloss: k_s, the strength of the glossy lobe.
        lobe: m, root mean square slope of what the grid does not resolve.
        contrast: standard deviation of the reflectance from point to point.
        grain: extent of the texture's finest spots, in points; as much again is four times coarser.
        polished: share of the area without texture.
        polished_contrast: what contrast is left there.
        smeared: share of the contrast that is left where the scene expects outliers, as under clear resin.
        stained: share of the area under dark stains.
        stain: reflectance there, against 1.
        burnished: share of the area that is so bright that it saturates.
        burnish: reflectance there, against 1.
        glints: per 10 000 points; facets that throw the lamp straight back.
        glint_strength: median light of a glint, in points of full brightness.
    """

    matte: float = 0.12
    gloss: float = 0.88
    lobe: float = 0.3
    contrast: float = 0.3
    grain: float = 1.2
    polished: float = 0.03
    polished_contrast: float = 0.004
    smeared: float = 1.0
    stained: float = 0.01
    stain: float = 0.06
    burnished: float = 0.005
    burnish: float = 2.5
    glints: float = 3.0
    glint_strength: float = 15.0


@dataclass(frozen=True)
class Glints:
    """Point sources at a depth of their own: a facet of curvature r images the lamp at r/2 from itself.

    Attributes:
        row: (G,) int64.
        column: (G,) int64.
        light: (G,) float64, in points of brightness 1.
        z: (G,) float64, depth of the lamp's image, µm.
    """

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    light: HeightMap
    z: HeightMap


@dataclass(frozen=True)
class Specimen:
    """A surface with its looks.

    Attributes:
        name: of the specimen.
        grid: where its points are.
        surface: (H, W) float64, µm: the true depth of every pixel.
        radiance: (H, W) float32: what each point sends to the lens; 1 is bright, flat, matte metal.
        glints: the mirrors on it.
    """

    name: str
    grid: Grid
    surface: HeightMap
    radiance: NDArray[np.float32]
    glints: Glints


MATERIALS: dict[str, Material] = {
    'metal_groove': Material(),
    'steep_groove': Material(),
    'closed_groove': Material(),
    'composite': Material(matte=0.6, gloss=0.4, lobe=0.4, contrast=0.2, smeared=0.05, stained=0.0),
    'flat': Material(),
    'ball': Material(),
    'steps': Material(),
    'discs': Material(),
    'pits': Material(),
    'islands': Material(),
}
"""The specimens, by the scene whose surface they have."""


def make_specimen(
    name: str,
    rows: int = 480,
    columns: int = 640,
    *,
    pitch: float = 1.0,
    material: Material | None = None,
    seed: int = 0,
) -> Specimen:
    """A named specimen; the same arguments give the same bytes.

    Args:
        name: one of `MATERIALS`.
        rows: of the grid.
        columns: of the grid.
        pitch: µm.
        material: in place of the specimen's own.
        seed: of surface, texture and glints.

    Raises:
        SettingError: no such specimen.
    """
    if name not in MATERIALS:
        raise SettingError(f'There is no specimen {name!r}; use one of: {", ".join(MATERIALS)}.')
    grid = Grid(rows, columns, pitch, pitch)
    build, look, glint = np.random.default_rng(seed).spawn(3)
    layout = SCENES[name](grid, build.spawn(4))
    looks = MATERIALS[name] if material is None else material
    return Specimen(
        name=name,
        grid=grid,
        surface=layout.surface,
        radiance=_radiance(layout, grid, looks, look),
        glints=_glints(layout, grid, looks, glint),
    )


def _radiance(layout: Layout, grid: Grid, material: Material, rng: np.random.Generator) -> NDArray[np.float32]:
    """What each point sends to the lens, (H, W) float32."""
    streams = rng.spawn(5)
    pitch = grid.dx
    fine, coarse = (
        surfaces.gaussian(grid, np.sqrt(0.5), extent * material.grain * pitch, stream)
        for extent, stream in ((1, streams[0]), (4, streams[1]))
    )
    polished = surfaces.islands(grid, 1.0, 24 * pitch, material.polished, streams[2])
    stained = surfaces.islands(grid, 1.0, 16 * pitch, material.stained, streams[3])
    burnished = surfaces.islands(grid, 1.0, 12 * pitch, material.burnished, streams[4])
    contrast = material.contrast + (material.polished_contrast - material.contrast) * polished
    contrast = np.where(layout.weight > 2, material.smeared, 1.0) * contrast
    reflectance = np.maximum(1 + contrast * (fine + coarse), 0.05)
    reflectance *= (1 + (material.stain - 1) * stained) * (1 + (material.burnish - 1) * burnished)

    slope = np.zeros(grid.shape)
    for axis, step in enumerate((grid.dy, grid.dx)):
        if grid.shape[axis] > 1:
            slope += np.gradient(layout.surface, step, axis=axis) ** 2
    matte = material.matte / np.sqrt(1 + slope)
    gloss = material.gloss * np.exp(-slope / (2 * material.lobe**2))
    radiance: NDArray[np.float32] = (reflectance * (matte + gloss)).astype(np.float32)
    return radiance


def _glints(layout: Layout, grid: Grid, material: Material, rng: np.random.Generator) -> Glints:
    """Mirrors, rather where the layout expects trouble; strength log-normal, curvature of either sign."""
    weight = np.sqrt(layout.weight)
    count = int(rng.poisson(material.glints * 1e-4 * weight.sum()))
    total = np.cumsum(weight.ravel())
    place = np.searchsorted(total, rng.uniform(0, total[-1], count), side='right')
    row, column = np.divmod(np.minimum(place, weight.size - 1), grid.columns)
    light = material.glint_strength * np.exp(rng.normal(0.0, 0.8, count))
    radius = grid.dx * np.exp(rng.normal(np.log(20.0), 0.7, count)) * rng.choice(np.array([-1, 1]), count)
    return Glints(row, column, light, layout.surface[row, column] + radius / 2)
