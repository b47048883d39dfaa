"""A cloud for display: points for the scene, and two pictures. No viser.

Large clouds are thinned to what a browser can draw. Only kept points are left out; all outliers are drawn.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Cloud, Mask
from socialcircle_ros.errors import CloudError
from socialcircle_ros.messages.image import NOT_MEASURED, OUTLIER
from socialcircle_ros.pictures.thinning import any_in_tile, thinned

from . import colours

MOST_POINTS = 150_000
"""Most points that are drawn. All outliers are drawn; a third of this number is always left for kept points."""

SIDE = 10.0
"""The longer side of every cloud in the scene: clouds may be in m or in µm."""

PIXELS = 400
"""Most pixels along the longer side of a picture."""

_SHADE = 0.3
"""Largest relative change of brightness by a slope."""


@dataclass(frozen=True)
class View:
    """One cloud, ready to be drawn, centred in a scene in which its longer side is `SIDE`.

    Attributes:
        kept: (n, 3) positions of the drawn kept points; z has the scale of x and y.
        kept_colours: (n, 3) their colours.
        outliers: (m, 3) positions of all outliers.
        kept_total: kept points of the cloud, drawn or not.
        step: one of this many kept points is drawn.
        pitch: distance between drawn neighbours, in the scene.
        span: the heights at the two ends of the colours, in the cloud's unit.
        height: the length of that span in the scene, not stretched.
        size: of the cloud along x and y, in the scene.
    """

    kept: npt.NDArray[np.float32]
    kept_colours: npt.NDArray[np.uint8]
    outliers: npt.NDArray[np.float32]
    kept_total: int
    step: int
    pitch: float
    span: tuple[float, float]
    height: float
    size: tuple[float, float]

    @property
    def caption(self) -> str:
        """One sentence that says how many points are drawn."""
        outliers = f'all {len(self.outliers):,} outliers' if len(self.outliers) else 'no outliers'
        if self.step == 1:
            return f'Showing all {self.kept_total:,} kept points and {outliers}.'
        return f'Showing {len(self.kept):,} of {self.kept_total:,} kept points (1 of {self.step}), and {outliers}.'

    @property
    def outlier_size(self) -> float:
        """Size of an outlier's mark in the scene: large if there are few, so that a single outlier can be seen."""
        large = SIDE / 150 / max(1.0, math.sqrt(len(self.outliers) / 30))
        return max(large, 1.2 * self.pitch / math.sqrt(self.step))

    def stretch(self) -> float:
        """Factor on z that makes the span of heights visible.

        It is the largest of 1, 2 or 5 times a power of ten with which the span is at most a quarter of the shorter
        side of the cloud, and at least 1.
        """
        if not self.height > 0:
            return 1.0
        wanted = max(1.0, 0.25 * min(self.size) / self.height)
        decade = 10.0 ** np.floor(np.log10(wanted))
        return float(max(step * decade for step in (1.0, 2.0, 5.0) if step * decade <= wanted))

    def stretched_outliers(self, stretch: float) -> tuple[npt.NDArray[np.float32], int]:
        """Stretch the outliers.

        Returns:
            Their positions (m, 3), with z limited to ±`SIDE`, and how many the limit has moved.
        """
        points = stretched(self.outliers, stretch)
        far = np.abs(points[:, 2]) > SIDE
        points[:, 2] = np.clip(points[:, 2], -SIDE, SIDE)
        return points, int(np.count_nonzero(far))


def stretched(points: npt.NDArray[np.float32], stretch: float) -> npt.NDArray[np.float32]:
    """Points (n, 3) with z times `stretch`."""
    return points * np.array([1, 1, stretch], np.float32)


def view_of(xyz: Cloud, mask: npt.NDArray[np.uint8], most: int = MOST_POINTS) -> View:
    """Prepare a cloud for the scene.

    Args:
        xyz: (H, W, 3).
        mask: (H, W) uint8, with the values of `outlier_mask`.
        most: points that are drawn at most, unless there are more outliers.

    Raises:
        CloudError: mask and cloud differ in size, or no point is measured.
    """
    if mask.shape != xyz.shape[:2]:
        raise CloudError(
            f'The mask has the shape {mask.shape} and the cloud {xyz.shape[:2]}; they must be of one measurement.'
        )
    measured = (mask != NOT_MEASURED) & np.isfinite(xyz).all(axis=2)
    outlier = measured & (mask == OUTLIER)
    kept = measured & ~outlier
    kept_total, outlier_total = int(np.count_nonzero(kept)), int(np.count_nonzero(outlier))
    if kept_total + outlier_total == 0:
        raise CloudError('The cloud has no measured point.')
    rows, columns = _steps(kept_total / max(most - outlier_total, most // 3))
    drawn = kept[::rows, ::columns]
    grid = xyz[::rows, ::columns]
    points = grid[drawn].astype(np.float64)
    outliers = xyz[outlier].astype(np.float64)
    surface = points if len(points) else outliers
    low, high = (float(height) for height in np.percentile(surface[:, 2], [0.5, 99.5]))
    first, last = surface.min(axis=0), surface.max(axis=0)
    extent = float(np.max((last - first)[:2]))
    scale = SIDE / extent if extent > 0 else 1.0
    centre = np.array([*(first + last)[:2] / 2, (low + high) / 2])
    size = (last - first) * scale
    return View(
        kept=((points - centre) * scale).astype(np.float32),
        kept_colours=_lit(
            colours.coloured(points[:, 2], (low, high)), np.where(drawn, grid[..., 2], np.nan), drawn
        ),
        outliers=((outliers - centre) * scale).astype(np.float32),
        kept_total=kept_total,
        step=rows * columns,
        pitch=float(np.sqrt(max(size[0] * size[1], SIDE) / max(1, drawn.size))),
        span=(low, high),
        height=(high - low) * scale,
        size=(float(size[0]), float(size[1])),
    )


def _steps(ratio: float) -> tuple[int, int]:
    """Steps along rows and columns, nearly equal; their product is at least `ratio`, and little more."""
    near = math.isqrt(max(1, math.floor(ratio)))
    pairs = [(rows, max(1, math.ceil(ratio / rows))) for rows in (near, near + 1)]
    return min(pairs, key=math.prod)


def _lit(flat: npt.NDArray[np.uint8], heights: npt.NDArray[np.floating], drawn: Mask) -> npt.NDArray[np.uint8]:
    """Shade colours as oblique light would, so that the texture of a rough plane can be seen.

    Slopes are taken relative to the median slope of the surface. A point beside a gap is shaded as a level one.

    Args:
        flat: (n, 3) colours of the drawn points.
        heights: (H, W) of the thinned grid.
        drawn: (H, W) which of them are drawn.
    """
    if min(heights.shape) < 2:
        return flat
    down, right = np.gradient(np.where(drawn, heights, np.nan))
    slope: npt.NDArray[np.float64] = (right - down)[drawn]
    median = float(np.nanmedian(np.abs(slope))) if np.isfinite(slope).any() else 0.0
    light = 1 - _SHADE * np.tanh(np.nan_to_num(slope / (3 * median))) if median > 0 else np.ones(len(flat))
    shaded: npt.NDArray[np.uint8] = (flat * np.asarray(light)[:, None] / (1 + _SHADE)).astype(np.uint8)
    return shaded


def height_picture(xyz: Cloud, mask: npt.NDArray[np.uint8], span: tuple[float, float]) -> npt.NDArray[np.uint8]:
    """The heights of kept points as a picture (h, w, 3) uint8; pixels without a kept point are gray."""
    z: npt.NDArray[np.floating] = thinned(xyz[..., 2], PIXELS)
    picture = colours.coloured(z, span)
    picture[(thinned(mask, PIXELS) != 0) | ~np.isfinite(z)] = colours.NOT_MEASURED
    return picture


def mask_picture(mask: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """The outlier mask as a picture (h, w, 3) uint8; a pixel of several points shows an outlier among them."""
    small = thinned(mask, PIXELS)
    picture = np.full((*small.shape, 3), colours.KEPT, np.uint8)
    picture[small == NOT_MEASURED] = colours.NOT_MEASURED
    picture[any_in_tile(mask == OUTLIER, PIXELS)] = colours.OUTLIER
    return picture
