# SPDX-License-Identifier: Apache-2.0
"""From the screen to the cloud: rays of a camera, and the region below a rectangle on the screen. No viser."""

import math

import numpy as np
import numpy.typing as npt

from .view import View

Vector = npt.NDArray[np.float64]
"""(3,) in the scene."""


def ray(screen: tuple[float, float], wxyz: npt.ArrayLike, fov: float, aspect: float) -> Vector:
    """The direction in which a camera sees a place of the screen.

    Args:
        screen: 0 to 1 from the left, and 0 to 1 from the top.
        wxyz: rotation from the camera to the scene; the camera looks along its z, with y down.
        fov: vertical field of view, in rad.
        aspect: width of the screen by its height.
    """
    half = math.tan(fov / 2)
    direction = np.array([(2 * screen[0] - 1) * half * aspect, (2 * screen[1] - 1) * half, 1.0])
    w, *axis = np.asarray(wxyz, np.float64)
    turned = np.cross(axis, direction)
    found: Vector = direction + 2 * (w * turned + np.cross(axis, turned))
    return found / np.linalg.norm(found)


def on_ground(origin: npt.ArrayLike, direction: Vector) -> tuple[float, float] | None:
    """Where a ray meets the plane of the middle height; None where it does not."""
    start = np.asarray(origin, np.float64)
    if abs(direction[2]) < 1e-9 or -start[2] / direction[2] <= 0:
        return None
    found = start - start[2] / direction[2] * direction
    return float(found[0]), float(found[1])


def region_between(
    view: View, one: tuple[float, float], other: tuple[float, float], most: float = math.inf
) -> list[int]:
    """The region [row, column, height, width] between two corners in the scene.

    It lies within the cloud. A larger one than is allowed is reduced round its middle.

    Args:
        view: the cloud.
        one: x and y of a corner in the scene, seen from above.
        other: x and y of the opposite corner.
        most: number of points that it may have.
    """
    drawing = view.drawing
    corners = [view.place(*corner) for corner in (one, other)]
    found = []
    for axis, count in enumerate((drawing.down.count, drawing.across.count)):
        first, last = sorted(round(corner[axis]) for corner in corners)
        first, last = min(max(first, 0), count - 1), min(max(last, 0), count - 1)
        found.append((first, last - first + 1))
    (row, height), (column, width) = found
    shrink = math.sqrt(height * width / most)
    if shrink > 1:
        smaller = [max(1, math.floor(side / shrink)) for side in (height, width)]
        row, column = row + (height - smaller[0]) // 2, column + (width - smaller[1]) // 2
        height, width = smaller
    return [row, column, height, width]
