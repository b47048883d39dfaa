"""Holes in, a filled cloud out."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from socialcircle_ros.cloud import Cloud, Mask, measured_points, organized
from socialcircle_ros.errors import CloudError
from socialcircle_ros.settings import RepairSettings

from .biharmonic import biharmonic_heights
from .grid import fill_points
from .holes import choose_points, find_holes, find_rims, number_points
from .spline import spline_heights


@dataclass(frozen=True)
class RepairResult:
    """A cloud with its holes filled.

    Attributes:
        xyz: (H, W, 3), the data type and unit of the cloud that came in. Points outside the holes are as they
            were, bit for bit; points of holes are filled, or NaN.
        filled: (H, W) bool, the points that were filled.
    """

    xyz: Cloud
    filled: Mask


def repair_holes(xyz: Any, holes: Any, settings: RepairSettings | None = None) -> RepairResult:
    """Fill holes within the limits that the settings give, from the measured points round them.

    A point is filled if its hole is not too large, if it lies between two opposite rims of the hole (in its
    row or its column) and sees the rim on as many sides as asked for, and if the heights that touch the hole
    agree. Its height is found as `method` says; x and y are kept where both are finite, and else lie on the
    grid, linear between the rims.

    Args:
        xyz: (H, W, 3) float32 or float64 organized cloud; a point with a NaN or Inf is not measured.
        holes: (H, W) bool, the points that may be filled, whatever they hold. Points that are not measured
            and not in a hole stay as they are.
        settings: the parameters; None: their defaults.

    Returns:
        A new cloud, and the mask of the filled points.

    Raises:
        CloudError: not an organized cloud, or holes of another shape or type.
    """
    settings = settings or RepairSettings()
    cloud = organized(xyz)
    holes = np.asarray(holes)
    if holes.shape != cloud.shape[:2] or holes.dtype != np.bool_:
        raise CloudError(
            f'holes must be a bool mask of the shape of the cloud {cloud.shape[:2]}, not {holes.dtype} of the'
            f' shape {holes.shape}.'
        )
    z = cloud[:, :, 2]
    measured = measured_points(cloud) & ~holes
    points, starts = find_holes(holes)
    rims = find_rims(points, starts, holes, measured, settings.largest)
    inner, chosen = choose_points(points, starts, rims, measured, z, settings.sides, settings.heights_agree)
    unknowns = number_points(points, inner, measured)
    if settings.method == 'spline':
        heights = spline_heights(z, unknowns, rims)
    else:
        heights = biharmonic_heights(z, unknowns, points, starts)
    filled_xyz = cloud.copy()
    filled = np.zeros(holes.shape, np.bool_)
    fill_points(filled_xyz, filled, points, rims, chosen, heights)
    return RepairResult(filled_xyz, filled)
