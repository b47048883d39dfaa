# SPDX-License-Identifier: Apache-2.0
"""Repair of a cloud as a whole: from a cloud and its holes to a filled cloud."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from socialcircle_ros.arguments import settings_or_default
from socialcircle_ros.cloud import Cloud, Mask, mask_of_points, measured_points, nearest_grid, organized
from socialcircle_ros.errors import CloudError
from socialcircle_ros.settings import RepairSettings

from .biharmonic import biharmonic_heights
from .bounds import mark_beyond
from .grid import fill_points
from .holes import choose_points, find_holes, find_rims, number_points
from .second_differences import measured_heights
from .spline import spline_heights

_LARGEST_RATIO = 16.0
"""Of the pitches; with much larger ones rounding would decide on the heights along the longer one."""


@dataclass(frozen=True, eq=False)
class RepairResult:
    """A cloud with its holes filled.

    Attributes:
        xyz: (H, W, 3), in the data type and unit of the input. Points outside the holes are unchanged, bit for
            bit; points of the holes are filled, or NaN.
        filled: (H, W) bool, the points that are filled.
        beyond: (H, W) bool, those of them with invented heights: beyond the span of the heights round their hole
            by more than half of it, and by more than a tenth of the span of all. 'biharmonic' gives none.
    """

    xyz: Cloud
    filled: Mask
    beyond: Mask

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a person should look at, in sentences."""
        beyond, filled = np.count_nonzero(self.beyond), np.count_nonzero(self.filled)
        if not beyond:
            return ()
        points = f'{beyond} of {filled} filled points are far above or below all heights round their hole'
        return (f"{points}: 'spline' overshoots beside steps; set repair.method to 'biharmonic'.",)


def repair_holes(xyz: npt.ArrayLike, holes: npt.ArrayLike, settings: RepairSettings | None = None) -> RepairResult:
    """Fill holes from the measured points next to them, within the limits of the settings.

    A point is filled if all of these hold:

    - its hole is not larger than `largest`;
    - it is between two opposite rims of the hole, in its row or its column;
    - it has a rim on at least `sides` of its four sides;
    - the heights next to the hole differ by no more than `heights_agree`.

    Its height is found by `method`, for the pitches of the nearest regular grid along rows and along columns. They
    count as equal where x and y do not tell them, and one as at most 16 times the other. The size of a hole and
    its rims are counted in points, whatever the pitches. x and y are kept if both are finite; otherwise they are
    interpolated linearly between the rims.

    'spline', the method of the paper, can invent heights beyond all measured ones: see `RepairResult.beyond`.

    Args:
        xyz: (H, W, 3) float32 or float64 organized cloud; a point with a NaN or Inf is not measured.
        holes: (H, W) bool, the points that may be filled, with any values. Points that are not measured and
            not in a hole stay as they are. What a masked array masks is not in a hole.
        settings: the parameters; None: the defaults.

    Returns:
        A new cloud, and the masks of the filled points and of doubtful ones among them.

    Raises:
        CloudError: this is not an organized cloud, the holes have another shape or data type, or x and y reach too
            far for float64.
        SettingError: the settings are not `RepairSettings`.
    """
    settings = settings_or_default(RepairSettings, settings)
    cloud = organized(xyz)
    mask = mask_of_points('holes', holes, cloud.shape[:2])
    z = cloud[:, :, 2]
    measured = measured_points(cloud) & ~mask
    found = find_holes(mask)
    rims = find_rims(found, mask, measured, settings.largest)
    inner, chosen = choose_points(found, rims, measured, z, settings.sides, settings.heights_agree)
    unknowns = number_points(found.points, inner, measured)
    ratio = _ratio_of_pitches(cloud, measured)
    if settings.method == 'spline':
        heights = spline_heights(z, unknowns, rims, ratio)
    else:
        heights = biharmonic_heights(z, unknowns, found, ratio)
    filled_xyz = cloud.copy()
    filled = np.zeros(mask.shape, np.bool_)
    fill_points(filled_xyz, filled, found.points, rims, chosen, heights)
    beyond = np.zeros(mask.shape, np.bool_)
    if settings.method == 'spline':
        mark_beyond(measured_heights(z, unknowns), unknowns, found, heights, filled, beyond)
    return RepairResult(filled_xyz, filled, beyond)


def _ratio_of_pitches(cloud: Cloud, measured: Mask) -> float:
    """Distance of the rows over that of the columns; 1 where it is not known.

    Raises:
        CloudError: x and y reach too far for float64.
    """
    try:
        with np.errstate(over='ignore', invalid='ignore'):
            grid = nearest_grid(cloud, measured)
    except np.linalg.LinAlgError:
        raise CloudError(
            'x and y reach so far that float64 does not hold their sums: check the unit of the cloud.'
        ) from None
    pitch = None if grid is None else grid.pitch
    if pitch is None:
        return 1.0
    # Rounded, so that the rounding of coordinates changes no height, and equal pitches are equal.
    larger = min(float(f'{max(pitch) / min(pitch):.4g}'), _LARGEST_RATIO)
    return larger if pitch[1] > pitch[0] else 1 / larger
