"""What is drawn of a cloud: a scene thinned to what a browser bears, and two pictures. NumPy only.

Only points that are kept are ever left out; every outlier is drawn.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.errors import CloudError
from socialcircle_ros.messages.image import NOT_MEASURED, OUTLIER
from socialcircle_ros.report.pictures import any_in_tile, thinned

from . import colours

MOST_POINTS = 150_000
"""Of the points that are kept, and of all points as long as there are fewer outliers than two thirds of it."""

SIDE = 10.0
"""The longer side of the cloud, in the scene's own unit: clouds come in metres and in micrometres."""

PIXELS = 400
"""Of the longer side of a picture, at most."""


_SHADE = 0.3
"""By how much a slope is lighter or darker than the plane."""


@dataclass(frozen=True)
class View:
    """One cloud, ready to be drawn, centred in a scene in which its longer side is `SIDE`."""

    kept: npt.NDArray[np.float32]
    """(n, 3) positions of the kept points that are drawn; z to the same scale as x and y."""
    kept_colours: npt.NDArray[np.uint8]
    outliers: npt.NDArray[np.float32]
    """(m, 3) positions of all outliers."""
    kept_total: int
    step: int
    """One of so many kept points is drawn."""
    pitch: float
    """Distance of neighbours that are drawn, in the scene."""
    span: tuple[float, float]
    """Of the heights that are told apart, in the cloud's unit."""
    height: float
    """That span in the scene, unscaled."""
    size: tuple[float, float]
    """Of the cloud along x and y, in the scene."""

    @property
    def caption(self) -> str:
        """What is shown and what is not, in words."""
        outliers = f'all {len(self.outliers):,} outliers' if len(self.outliers) else 'no outliers'
        if self.step == 1:
            return f'Showing all {self.kept_total:,} kept points and {outliers}.'
        return f'Showing {len(self.kept):,} of {self.kept_total:,} kept points (1 of {self.step}), and {outliers}.'

    @property
    def outlier_size(self) -> float:
        """Of an outlier's mark in the scene: a single one is to be seen, thousands must not hide the surface."""
        few = SIDE / 150 / max(1.0, math.sqrt(len(self.outliers) / 30))
        return max(few, 1.2 * self.pitch / math.sqrt(self.step))

    def stretch(self) -> float:
        """The factor on z that makes heights as visible as a quarter of the shorter side, rounded to 1, 2 or 5."""
        if not self.height > 0:
            return 1.0
        wanted = max(1.0, 0.25 * min(self.size) / self.height)
        decade = 10.0 ** np.floor(np.log10(wanted))
        return float(max(step * decade for step in (1.0, 2.0, 5.0) if step * decade <= wanted))

    def stretched_outliers(self, stretch: float) -> tuple[npt.NDArray[np.float32], int]:
        """Outliers with z times `stretch`; those beyond a side's length are brought back to it, and counted."""
        points = stretched(self.outliers, stretch)
        far = np.abs(points[:, 2]) > SIDE
        points[:, 2] = np.clip(points[:, 2], -SIDE, SIDE)
        return points, int(np.count_nonzero(far))


def stretched(points: npt.NDArray[np.float32], stretch: float) -> npt.NDArray[np.float32]:
    """Points with z times `stretch`."""
    return points * np.array([1, 1, stretch], np.float32)


def view(xyz: npt.NDArray[Any], mask: npt.NDArray[np.uint8], most: int = MOST_POINTS) -> View:
    """Thin a cloud for the scene.

    Args:
        xyz: (H, W, 3).
        mask: (H, W) as on outlier_mask.
        most: points that may be drawn, as far as outliers leave the choice.

    Raises:
        CloudError: mask and cloud are not of one size, or nothing is measured.
    """
    if mask.shape != xyz.shape[:2]:
        raise CloudError(f'The mask is {mask.shape}, the cloud {xyz.shape[:2]}: they are not of one measurement.')
    measured = (mask != NOT_MEASURED) & np.isfinite(xyz).all(axis=2)
    outlier = measured & (mask == OUTLIER)
    kept = measured & ~outlier
    kept_total, outlier_total = int(np.count_nonzero(kept)), int(np.count_nonzero(outlier))
    if kept_total + outlier_total == 0:
        raise CloudError('No point of the cloud is measured.')
    rows, columns = _steps(kept_total / max(most - outlier_total, most // 3))
    drawn = kept[::rows, ::columns]
    grid = xyz[::rows, ::columns]
    points = grid[drawn].astype(np.float64)
    strays = xyz[outlier].astype(np.float64)
    surface = points if len(points) else strays
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
        outliers=((strays - centre) * scale).astype(np.float32),
        kept_total=kept_total,
        step=rows * columns,
        pitch=float(np.sqrt(max(size[0] * size[1], SIDE) / max(1, drawn.size))),
        span=(low, high),
        height=(high - low) * scale,
        size=(float(size[0]), float(size[1])),
    )


def _steps(ratio: float) -> tuple[int, int]:
    """Along rows and columns, about alike, so that their product is at least `ratio`, and little more."""
    near = math.isqrt(max(1, math.floor(ratio)))
    pairs = [(rows, max(1, math.ceil(ratio / rows))) for rows in (near, near + 1)]
    return min(pairs, key=math.prod)


def _lit(
    flat: npt.NDArray[np.uint8], heights: npt.NDArray[Any], drawn: npt.NDArray[np.bool_]
) -> npt.NDArray[np.uint8]:
    """Colours of the drawn points under a slanting light, by slopes relative to the usual one of this surface.

    Without it a rough plane is one flat patch of colour. A neighbour of a gap has no slope, and keeps its colour.
    """
    if min(heights.shape) < 2:
        return flat
    down, right = np.gradient(np.where(drawn, heights, np.nan))
    slope: npt.NDArray[np.float64] = (right - down)[drawn]
    usual = float(np.nanmedian(np.abs(slope))) if np.isfinite(slope).any() else 0.0
    light = 1 - _SHADE * np.tanh(np.nan_to_num(slope / (3 * usual))) if usual > 0 else np.ones(len(flat))
    shaded: npt.NDArray[np.uint8] = (flat * np.asarray(light)[:, None] / (1 + _SHADE)).astype(np.uint8)
    return shaded


def height_picture(xyz: npt.NDArray[Any], mask: npt.NDArray[np.uint8], span: tuple[float, float]) -> Any:
    """The heights that were kept, (h, w, 3) uint8; gray where no point is left."""
    z = thinned(xyz[..., 2], PIXELS)
    picture = colours.coloured(z, span)
    picture[(thinned(mask, PIXELS) != 0) | ~np.isfinite(z)] = colours.NOT_MEASURED
    return picture


def mask_picture(mask: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """The outlier mask, (h, w, 3) uint8; a pixel that holds several points shows an outlier if one is."""
    small = thinned(mask, PIXELS)
    picture = np.full((*small.shape, 3), colours.KEPT, np.uint8)
    picture[small == NOT_MEASURED] = colours.NOT_MEASURED
    picture[any_in_tile(mask == OUTLIER, PIXELS)] = colours.OUTLIER
    return picture
