# SPDX-License-Identifier: Apache-2.0
"""The region of interest that a person draws on the cloud: its counts, its texture and its limits. No viser."""

from dataclasses import dataclass

import numpy as np

from socialcircle_ros.metrics.areal import Texture, texture
from socialcircle_ros.pipeline.limits import Verdict, verdict
from socialcircle_ros.settings import LimitSettings

from .display import Drawing


@dataclass(frozen=True)
class RegionNumbers:
    """A region of a cloud in numbers.

    Attributes:
        place: row, column, height and width.
        points: number of its points.
        measured: number of its measured points.
        kept: number of its measured points that are no outliers.
        texture_measured: of all its measured points, after its own plane is subtracted.
        texture_kept: of its kept points, after their own plane is subtracted.
        verdict: whether it passes the limits of the node; None: no limit is set.
    """

    place: tuple[int, ...]
    points: int
    measured: int
    kept: int
    texture_measured: Texture
    texture_kept: Texture
    verdict: Verdict | None

    @property
    def outliers(self) -> int:
        """Number of its outliers."""
        return self.measured - self.kept


def region_numbers(drawing: Drawing, place: tuple[int, ...], limits: LimitSettings) -> RegionNumbers:
    """Measure a region of a cloud as if it were a cloud of its own.

    Args:
        drawing: the cloud with its outliers.
        place: row, column, height and width, within the cloud.
        limits: of the node.
    """
    row, column, height, width = place
    part = slice(row, row + height), slice(column, column + width)
    xyz, kept, measured = drawing.xyz[part], drawing.kept[part], np.isfinite(drawing.heights[part])
    count = int(np.count_nonzero(measured))
    return RegionNumbers(
        place=place,
        points=measured.size,
        measured=count,
        kept=int(np.count_nonzero(kept)),
        texture_measured=texture(xyz, measured),
        texture_kept=texture(xyz, kept),
        verdict=verdict(limits, xyz, kept, count),
    )
