# SPDX-License-Identifier: Apache-2.0
"""A cloud for the scene: points with colours, and where each of them lies in the cloud. No viser.

Large clouds are thinned to what a browser can draw. Only kept points are left out; all outliers are drawn.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask

from . import colours
from .display import Drawing

MOST_POINTS = 150_000
"""Most points that are drawn. All outliers are drawn; a third of this number is always left for kept points."""

SIDE = 10.0
"""The longer side of every cloud in the scene: clouds may be in m or in µm."""

_SHADE = 0.3
"""Largest relative change of brightness by a slope."""

_FEW = 2.0  # a point beside the pointer is taken if it is at most so much further from it than the nearest one

PointPlaces = npt.NDArray[np.intp]
"""(n, 2) row and column of points."""


@dataclass(frozen=True, eq=False)
class View:
    """One cloud, ready to be drawn, centred in a scene in which its longer side is `SIDE`.

    Columns go along the x of the scene and rows against its y, so that row 0 is at the top, seen from above.

    Attributes:
        drawing: the cloud.
        kept: (n, 3) positions of the drawn kept points; z has the scale of x and y.
        kept_colours: (n, 3) their colours.
        kept_places: (n, 2) their rows and columns.
        outliers: (m, 3) positions of all outliers.
        outlier_places: (m, 2) their rows and columns.
        kept_total: kept points of the cloud, drawn or not.
        step: one of this many kept points is drawn.
        pitch: distance between drawn neighbours, in the scene.
        centre: coordinate across, coordinate down and height at the middle of the scene.
        scale: length of 1 of the cloud's unit in the scene.
        height: the span of the heights in the scene, not stretched.
    """

    drawing: Drawing
    kept: npt.NDArray[np.float32]
    kept_colours: npt.NDArray[np.uint8]
    kept_places: PointPlaces
    outliers: npt.NDArray[np.float32]
    outlier_places: PointPlaces
    kept_total: int
    step: int
    pitch: float
    centre: tuple[float, float, float]
    scale: float
    height: float

    @property
    def size(self) -> tuple[float, float]:
        """Size of the cloud along x and y of the scene."""
        return self.drawing.across.length * self.scale, self.drawing.down.length * self.scale

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
        if not self.height > 0 or not min(self.size) > 0:
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

    def position(self, row: float, column: float, height: float, stretch: float) -> tuple[float, float, float]:
        """Where a place of the cloud is in the scene."""
        across, down, _ = self.centre
        x = (self.drawing.across.at(column) - across) * self.scale * self.drawing.across.sign
        y = -(self.drawing.down.at(row) - down) * self.scale * self.drawing.down.sign
        return x, y, (height - self.centre[2]) * self.scale * stretch

    def place(self, x: float, y: float) -> tuple[float, float]:
        """Row and column, which may be between two, at a position of the scene, seen from above."""
        width, depth = self.size
        rows, columns = self.drawing.down.count, self.drawing.across.count
        return (0.5 - y / depth) * rows - 0.5, (0.5 + x / width) * columns - 0.5

    def nearest(
        self, origin: npt.NDArray[np.float64], direction: npt.NDArray[np.float64], stretch: float
    ) -> tuple[int, int] | None:
        """Row and column of the drawn point that a ray meets, with outliers before kept points.

        Args:
            origin: (3,) of the ray, in the scene.
            direction: (3,) of the ray.
            stretch: factor on z in the scene.

        Returns:
            None if no point is near the ray.
        """
        unit = np.asarray(direction, np.float64) / np.linalg.norm(direction)
        best: tuple[float, tuple[int, int]] | None = None
        candidates = (
            (self.stretched_outliers(stretch)[0], self.outlier_places, self.outlier_size),
            (stretched(self.kept, stretch), self.kept_places, 1.1 * self.pitch),
        )
        for points, places, size in candidates:
            if not len(points):
                continue
            offset = points.astype(np.float64) - origin
            along = offset @ unit
            distance = np.linalg.norm(offset - along[:, None] * unit, axis=1)
            hit = np.flatnonzero((along > 0) & (distance <= max(_FEW * size, SIDE / 60)))
            if len(hit):
                first = hit[np.argmin(distance[hit] + 0.1 * (along[hit] - along[hit].min()))]
                found = float(distance[first]), (int(places[first, 0]), int(places[first, 1]))
                if best is None:
                    best = found
        return best[1] if best is not None else None


def stretched(points: npt.NDArray[np.float32], stretch: float) -> npt.NDArray[np.float32]:
    """Points (n, 3) with z times `stretch`."""
    return points * np.array([1, 1, stretch], np.float32)


def view_of(drawing: Drawing, most: int = MOST_POINTS) -> View:
    """Prepare a cloud for the scene.

    Args:
        drawing: the cloud.
        most: points that are drawn at most, unless there are more outliers.
    """
    kept, outlier = drawing.kept, drawing.outliers
    kept_total, outlier_total = int(np.count_nonzero(kept)), int(np.count_nonzero(outlier))
    rows, columns = _steps(kept_total / max(most - outlier_total, most // 3))
    drawn = np.zeros_like(kept)
    drawn[::rows, ::columns] = kept[::rows, ::columns]
    across, down = drawing.across, drawing.down
    low, high = np.percentile(drawing.heights[kept if kept_total else outlier], (0.5, 99.5)).astype(float).tolist()
    extent = max(across.length, down.length)
    scale = SIDE / extent if extent > 0 else 1.0
    middle = (across.first + across.last) / 2, (down.first + down.last) / 2, (low + high) / 2

    def positions(where: Mask) -> npt.NDArray[np.float32]:
        found = drawing.xyz[where]
        points = np.column_stack([
            (across.coordinates(found) - middle[0]) * across.sign,
            (down.coordinates(found) - middle[1]) * -down.sign,
            drawing.heights[where] - middle[2],
        ])  # fmt: skip
        return (points * scale).astype(np.float32)

    flat = colours.coloured(drawing.values[drawn], drawing.span, drawing.display.colour_map)
    small = drawn[::rows, ::columns]
    grid = np.where(small, drawing.heights[::rows, ::columns], np.nan)
    width, depth = across.length * scale, down.length * scale
    return View(
        drawing=drawing,
        kept=positions(drawn),
        kept_colours=_lit(flat, grid, small),
        kept_places=np.argwhere(drawn),
        outliers=positions(outlier),
        outlier_places=np.argwhere(outlier),
        kept_total=kept_total,
        step=rows * columns,
        pitch=float(np.sqrt(max(width * depth, SIDE) / max(1, small.size))),
        centre=middle,
        scale=scale,
        height=(high - low) * scale,
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
    down, right = np.gradient(heights)
    slope: npt.NDArray[np.float64] = (right - down)[drawn]
    median = float(np.nanmedian(np.abs(slope))) if np.isfinite(slope).any() else 0.0
    light = 1 - _SHADE * np.tanh(np.nan_to_num(slope / (3 * median))) if median > 0 else np.ones(len(flat))
    shaded: npt.NDArray[np.uint8] = (flat * np.asarray(light)[:, None] / (1 + _SHADE)).astype(np.uint8)
    return shaded
