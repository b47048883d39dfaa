# SPDX-License-Identifier: Apache-2.0
"""Labelled clouds: organized clouds with known outliers.

They are synthetic scenes with added outliers, or scans by the virtual instrument. Clouds of real instruments have
unknown outliers; they are in `measured`.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask
from socialcircle_ros.focus import FocusStack
from socialcircle_ros.metrics.scores import Scores, cluster_sizes, score
from socialcircle_ros.simulation import Cause, Contamination, make_scene, simulate

PAPER_SIZE = (960, 1280)
"""Rows and columns of the cloud in Table 1. Less `NOT_MEASURED` points it has the paper's 1 228 793 points."""
NOT_MEASURED = 7
"""Points of a synthetic cloud that are not measured."""

OutlierKind = Literal['own', 'isolated', 'clustered', 'blurred']
"""Outliers of a synthetic cloud: the scene's own (half in clusters with sharp flanks), or one kind only."""

TITLES = {
    'metal_groove': 'Metal groove',
    'composite': 'Composite material',
    'steep_groove': 'Steep groove',
}
"""Titles of the scenes: the two of the paper, and a groove with walls of 80° that the exact mode cannot climb."""

PAPER_SCENES = ('metal_groove', 'composite')

_SIZES = ((1, 1, 'isolated'), (2, 19, 'clusters to 19'), (20, 59, '20 to 59'), (60, 10**9, '60 and more'))


@dataclass(frozen=True, eq=False)
class LabelledCloud:
    """A cloud and its truth; lengths in µm.

    Attributes:
        title: heading in tables and pictures.
        points: (H, W, 3) float32.
        outlier: (H, W) bool, points further from the true surface than a bound.
        counted: (H, W) bool, measured points of certain truth; scores use these only.
        z_true: (H, W) float64, the true surface.
        pitch: distance of neighbouring points along x.
        groups: (H, W) bool by name: outliers by cluster size, or pixels by cause.
        depth_of_field: in µm, as the focus curves of a scanned stack give it; None without a stack.
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

    def score(self, found: Mask) -> Scores:
        """Compare a mask (H, W) of found outliers with the truth."""
        return score(found, self.outlier, self.counted)


def synthetic_cloud(
    scene: str, size: tuple[int, int], seed: int, kind: OutlierKind = 'own', share: float | None = None
) -> LabelledCloud:
    """Make a scene with added outliers, and remove `NOT_MEASURED` random points.

    Args:
        scene: a scene of `make_scene`.
        size: rows and columns.
        seed: of the random generator.
        kind: of the outliers.
        share: of outliers among the points; None: the scene's own, as in Table 1.
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
    """Scan a specimen with the virtual instrument; its outliers result from the simulated optics.

    Args:
        specimen: a specimen of `simulate`, such as those of `TITLES`, or 'flat'.
        size: rows and columns.
        seed: of the random generator.
    """
    simulation = simulate(specimen, *size, seed=seed)
    stack = FocusStack()
    for frame in simulation.frames():
        stack.add(frame.image, frame.z)
    focus = stack.finish()
    truth = simulation.truth
    verdict = truth.classify(focus.depth)
    grid = simulation.specimen.grid
    points = np.empty((*grid.shape, 3), np.float32)
    points[..., 0], points[..., 1], points[..., 2] = grid.x, grid.y, focus.depth
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


def other_seeds(seeds: tuple[int, ...], count: int) -> tuple[int, ...]:
    """Seeds for the settings search, none of which is among `seeds`."""
    return tuple(range(max(seeds) + 1, max(seeds) + 1 + count))
