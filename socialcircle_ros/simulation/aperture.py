# SPDX-License-Identifier: Apache-2.0
"""The light cone of the objective: its rays, and the share of it that walls do not block."""

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.kernels.compiled import kernel

from .optics import Optics
from .sampling import Light
from .surfaces import TrueHeights


def aperture_openness(surface: TrueHeights, optics: Optics) -> Light:
    """Return the share of the light cone above each point that no wall blocks, (H, W) float32, 0 to 1."""
    steepest = max(
        (float(np.abs(np.diff(surface, axis=axis)).max()) for axis in (0, 1) if surface.shape[axis] > 1),
        default=0.0,
    )
    share = np.ones(surface.shape, dtype=np.float32)
    if steepest * optics.cone > optics.pitch:
        _write_openness(surface, pupil(32) * optics.cone / optics.pitch, float(surface.max()), share)
    return share


def pupil(count: int) -> NDArray[np.float64]:
    """Points spread evenly over the unit disc, (count, 2).

    Source: H. Vogel, A better way to construct the sunflower head, Math. Biosci. 44 (1979) 179-189,
    DOI 10.1016/0025-5564(79)90080-4.
    """
    index = np.arange(count) + 0.5
    radius, angle = np.sqrt(index / count), index * np.pi * (3 - np.sqrt(5))
    points: NDArray[np.float64] = np.stack([radius * np.sin(angle), radius * np.cos(angle)], axis=1)
    return points


@kernel
def _write_openness(surface: TrueHeights, slopes: NDArray[np.float64], top: float, share: Light) -> None:
    """Write the share of the rays from each point upward that the surface does not block.

    Args:
        surface: (H, W), µm.
        slopes: (M, 2), points that a ray moves along rows and columns per µm of height.
        top: greatest height of the surface, µm.
        share: (H, W), written.
    """
    rows, columns = surface.shape
    for row in range(rows):
        for column in range(columns):
            free = 0
            for ray in range(slopes.shape[0]):
                down, right = slopes[ray, 0], slopes[ray, 1]
                rise = 0.7 / np.sqrt(down * down + right * right)
                height = surface[row, column] + rise
                blocked = False
                while height < top:
                    lift = height - surface[row, column]
                    y, x = int(row + lift * down + 0.5), int(column + lift * right + 0.5)
                    if not (0 <= y < rows and 0 <= x < columns):
                        break
                    if surface[y, x] > height:
                        blocked = True
                        break
                    height += rise
                free += not blocked
            share[row, column] = free / slopes.shape[0]
