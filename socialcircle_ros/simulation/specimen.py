# SPDX-License-Identifier: Apache-2.0
"""The specimen: a surface, the light that it reflects, and its glints.

The light comes through the objective (coaxial illumination). A facet with the slope angle θ reflects
ρ · (k_d cos θ + k_s exp(-tan² θ / 2m²)): a matte part and a glossy lobe. Steep walls are dark, because they
reflect the lobe away from the lens. ρ is the reflectance. It has the fine texture that focus variation needs;
polished areas have almost none.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.errors import SettingError

from . import surfaces
from .scenes import SCENES, Layout
from .surfaces import Grid, TrueHeights


@dataclass(frozen=True)
class Material:
    """The optical properties of a surface.

    Attributes:
        matte: k_d, strength of the matte part.
        gloss: k_s, strength of the glossy lobe.
        lobe: m, root mean square slope of the roughness that the grid does not resolve.
        contrast: standard deviation of the reflectance from point to point.
        grain: correlation length of the fine texture, in points; half of the variance is four times coarser.
        polished: share of the area that is polished.
        polished_contrast: contrast of polished areas.
        smeared: factor of the contrast where the scene expects outliers, as under clear resin.
        stained: share of the area under dark stains.
        stain: factor of the reflectance of stains.
        burnished: share of the area that is so bright that it saturates.
        burnish: factor of the reflectance of burnished areas.
        glints: number per 10 000 points; facets that reflect the lamp straight into the lens.
        glint_strength: median light of a glint, in multiples of the light of a bright point.
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


@dataclass(frozen=True, eq=False)
class Glints:
    """Point sources off the surface: a facet with a radius of curvature r images the lamp at a distance of r/2.

    Attributes:
        row: (G,) int64.
        column: (G,) int64.
        light: (G,) float64, in multiples of the light of a bright point.
        z: (G,) float64, of the image of the lamp, µm.
    """

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    light: NDArray[np.float64]
    z: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Specimen:
    """A surface with its reflected light.

    Attributes:
        name: of the specimen.
        grid: of its points.
        surface: (H, W) float64, µm: the true depth of each pixel.
        radiance: (H, W) float32: light from each point to the lens; 1 is flat, bright metal.
        glints: its specular reflections.
    """

    name: str
    grid: Grid
    surface: TrueHeights
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
"""The materials of the named specimens. A specimen has the surface of the scene of the same name."""


def make_specimen(
    name: str,
    rows: int = 480,
    columns: int = 640,
    *,
    pitch: float = 1.0,
    material: Material | None = None,
    seed: int = 0,
) -> Specimen:
    """Make a named specimen. The same arguments give the same bytes.

    Args:
        name: one of `MATERIALS`.
        rows: of the grid.
        columns: of the grid.
        pitch: along x and y, µm.
        material: its optical properties; None: those of `MATERIALS`.
        seed: of surface, texture and glints.

    Raises:
        SettingError: there is no such specimen.
    """
    if name not in MATERIALS:
        raise SettingError(f'There is no specimen {name!r}; use one of: {", ".join(MATERIALS)}.')
    grid = Grid(rows, columns, pitch, pitch)
    build, texture, glint = np.random.default_rng(seed).spawn(3)
    layout = SCENES[name](grid, build.spawn(4))
    material = MATERIALS[name] if material is None else material
    return Specimen(
        name=name,
        grid=grid,
        surface=layout.surface,
        radiance=_radiance(layout, grid, material, texture),
        glints=_glints(layout, grid, material, glint),
    )


def _radiance(layout: Layout, grid: Grid, material: Material, rng: np.random.Generator) -> NDArray[np.float32]:
    """Light from each point to the lens, (H, W) float32."""
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
    """Draw the glints: more where the scene expects outliers, log-normal light, curvatures of either sign."""
    weight = np.sqrt(layout.weight)
    count = int(rng.poisson(material.glints * 1e-4 * weight.sum()))
    total = np.cumsum(weight.ravel())
    place = np.searchsorted(total, rng.uniform(0, total[-1], count), side='right')
    row, column = np.divmod(np.minimum(place, weight.size - 1), grid.columns)
    light = material.glint_strength * np.exp(rng.normal(0.0, 0.8, count))
    radius = grid.dx * np.exp(rng.normal(np.log(20.0), 0.7, count)) * rng.choice(np.array([-1, 1]), count)
    return Glints(row, column, light, layout.surface[row, column] + radius / 2)
