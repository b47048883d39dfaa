"""What the filters are tried on: clouds of known truth, painted or out of a rendered focus stack."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask
from socialcircle_ros.focus import FocusStack
from socialcircle_ros.metrics.scores import cluster_sizes
from socialcircle_ros.simulation import Cause, Contamination, make_scene, simulate

PAPER_SIZE = (960, 1280)
"""Rows and columns of the cloud in Table 1: less `NOT_MEASURED` points it has its 1 228 793."""
NOT_MEASURED = 7

OutlierKind = Literal['own', 'isolated', 'clustered', 'blurred']
"""Which outliers: as the scene has them (half of them clustered, with sharp flanks), or of one kind."""

TITLES = {
    'metal_groove': 'Metal groove',
    'composite': 'Composite material',
    'steep_groove': 'Steep groove',
}
"""The scenes: of the paper, and one whose walls of 80° the exact mode cannot climb."""

PAPERS_SCENES = ('metal_groove', 'composite')
"""The two of the paper."""

_SIZES = ((1, 1, 'isolated'), (2, 19, 'clusters to 19'), (20, 59, '20 to 59'), (60, 10**9, '60 and more'))


@dataclass(frozen=True, eq=False)
class LabelledCloud:
    """A cloud and the truth about it; lengths in µm.

    Attributes:
        title: for people.
        points: (H, W, 3) float32.
        outlier: (H, W) bool, by definition: further off the true surface than a bound.
        counted: (H, W) bool, the measured points whose truth is certain.
        z_true: (H, W) float64.
        pitch: distance of neighbours in x and y.
        groups: of the points, (H, W) bool each: by size of cluster, or by cause.
        depth_of_field: of a focus stack, as its curves tell it, in the unit of the heights.
    """

    title: str
    points: npt.NDArray[np.float32]
    outlier: Mask
    counted: Mask
    z_true: npt.NDArray[np.float64]
    pitch: float
    groups: dict[str, Mask]
    depth_of_field: float | None = None

    @property
    def measured(self) -> int:
        """Number of measured points."""
        return int(np.isfinite(self.points[..., 2]).sum())

    @property
    def contamination(self) -> float:
        """Share of the counted points that are outliers."""
        return float(self.outlier[self.counted].mean())


def synthetic_cloud(
    scene: str, size: tuple[int, int], seed: int, kind: OutlierKind = 'own', share: float | None = None
) -> LabelledCloud:
    """A scene with outliers painted on, and `NOT_MEASURED` points missing by chance.

    Args:
        scene: any that `make_scene` knows.
        size: rows and columns.
        seed: of everything random.
        kind: of outliers.
        share: of outliers; None: the scene's own, as in Table 1.
    """
    contamination = None
    if kind != 'own':
        contamination = Contamination(
            clustered=0.0 if kind == 'isolated' else 1.0,
            amplitude=(6.0, 40.0),
            flank='blurred' if kind == 'blurred' else 'sharp',
        )
    made = make_scene(scene, *size, seed=seed, share=share, contamination=contamination)
    missing = np.random.default_rng([seed, NOT_MEASURED]).choice(made.outlier.size, NOT_MEASURED, replace=False)
    points = made.points
    points.reshape(-1, 3)[missing] = np.nan
    measured = np.isfinite(points[..., 2])
    sizes = cluster_sizes(made.cluster, made.outlier)
    return LabelledCloud(
        title=_title(scene),
        points=points,
        outlier=made.outlier & measured,
        counted=measured & ~made.ambiguous,
        z_true=made.z_true,
        pitch=made.pitch[0],
        groups={name: (sizes >= low) & (sizes <= high) for low, high, name in _SIZES},
    )


def scanned_cloud(specimen: str, size: tuple[int, int], seed: int) -> LabelledCloud:
    """A specimen scanned by the virtual instrument: its outliers come out of the physics.

    Args:
        specimen: that the virtual instrument has a material for, such as those of `TITLES`, or 'flat'.
        size: rows and columns.
        seed: of everything random.
    """
    simulation = simulate(specimen, *size, seed=seed)
    stack = FocusStack()
    for frame in simulation.frames():
        stack.add(frame.image, frame.z)
    focus = stack.finish()
    depth = focus.depth
    truth = simulation.truth
    verdict = truth.classify(depth)
    grid = simulation.specimen.grid
    points = np.empty((*grid.shape, 3), np.float32)
    points[..., 0], points[..., 1], points[..., 2] = grid.x, grid.y, depth
    points[verdict.missing] = np.nan
    causes = {cause.name.lower().replace('_', ' '): truth.main_cause == cause for cause in Cause if cause.name}
    causes['none of these'] = truth.main_cause == Cause.NONE
    return LabelledCloud(
        title=f'{_title(specimen)}, from a rendered focus stack',
        points=points,
        outlier=verdict.bad,
        counted=verdict.good | verdict.bad,
        z_true=truth.depth,
        pitch=grid.dx,
        groups={name: where for name, where in causes.items() if (verdict.bad & where).any()},
        depth_of_field=focus.depth_of_field,
    )


def _title(scene: str) -> str:
    return TITLES.get(scene, scene.replace('_', ' ').capitalize())


def with_z_scaled(points: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The cloud with heights in a unit in which 4 σ of the differences of neighbours are 2 pitches.

    For instruments whose heights are far smaller, or larger, than their pitch; σ is robust (1.4826 times the
    median). A cloud without differences stays as it is.
    """
    along = np.abs(np.diff(points[..., 2].astype(np.float64), axis=1))
    across = np.abs(np.diff(points[..., 0].astype(np.float64), axis=1))
    sigma = 1.4826 * float(np.nanmedian(along))
    if not sigma > 0:
        return points
    scaled = points.copy()
    scaled[..., 2] *= 2 * float(np.nanmedian(across)) / (4 * sigma)
    return scaled


def other_seeds(seeds: tuple[int, ...], count: int) -> tuple[int, ...]:
    """Seeds for the search of parameters: none of those that the scores come from."""
    return tuple(range(max(seeds) + 1, max(seeds) + 1 + count))
