"""The depth put back to its pixel: what was measured there is the depth of the window's texture.

F of a pixel is a sum over its window (eq. 2), so that its curve peaks at the mean depth of the window, each
pixel weighing as much as its texture. Where the ground slopes, that is the depth at the centroid of the
texture, not at the pixel: at the edge of the frame, where the window is cut off, always to one side. The
weights are known afterwards, as M_l (eq. 1) of the all-in-focus image; the slope is that of the depths round
the pixel. Their product is taken away.
"""

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .measure import Frame, laplacian_row

_LEAST_QUALITY = np.float32(0.5)
"""Depths of less do not count for the slope."""

_LEAST_SHARE = 0.5
"""So much of each half of the window must count."""

_ROUGHEST = np.float32(0.5)
"""Where halves of the window and its middle do not agree by this, in z-steps, there is no slope: an edge."""

_STRIP = 4
"""Rows that share their slopes: on so few pixels a slope does not change, and to find it costs most."""


def centred(
    depth: NDArray[np.float64],
    quality: NDArray[np.float32],
    image: Frame,
    z: NDArray[np.float64],
    step: int,
    half: int,
    threshold: int,
) -> NDArray[np.float64]:
    """Depths at their pixels.

    Args:
        depth: (H, W) as fitted, in z's unit.
        quality: (H, W), 0 to 1.
        image: (H, W), every pixel from its sharpest frame.
        z: (n,) of the frames, ascending.
        step: as in `measure_row`.
        half: likewise.
        threshold: likewise.

    Returns:
        (H, W), NaN where the depth is; unchanged where no slope is known, and never beyond the scan.
    """
    height, width = depth.shape
    if half == 0 or min(height, width) < 2 * half + 1:
        return depth
    result = np.empty_like(depth)
    scale = float(np.median(np.diff(z)))

    def centre(band: slice) -> None:
        _centre(
            depth, quality, image, band.start, band.stop, z[0], z[-1], scale, step, half, threshold, result[band]
        )

    in_bands(centre, height, width)
    return result


@kernel
def _centre(
    depth: NDArray[np.float64],
    quality: NDArray[np.float32],
    image: Frame,
    first: int,
    end: int,
    lowest: float,
    highest: float,
    scale: float,
    step: int,
    half: int,
    threshold: int,
    result: NDArray[np.float64],
) -> None:
    """`centred` for the rows from first to end; no sum depends on where that is."""
    height, width = depth.shape
    side = 2 * half + 1
    weights = np.zeros((side, width), np.int32)
    columns = np.zeros((2, width + 2 * half), np.int32)
    moments = np.empty((3, width), np.int32)
    heights, counted = np.empty((side, width), np.float32), np.empty((side, width), np.float32)
    vertical = np.empty((6, width), np.float32)
    sums = np.empty((8, width - 2 * half), np.float32)
    slopes = np.empty((2, width), np.float32)
    next_row = min(max(first // _STRIP * _STRIP + _STRIP // 2, half), height - 1 - half) - half
    for entering in range(first - half, end + half):
        row_weights = weights[entering % side]
        _enter(image, entering, step, half, threshold, row_weights, columns)
        row = entering - half
        if row < first:
            continue
        if row == first or row % _STRIP == 0:
            middle = min(max(row // _STRIP * _STRIP + _STRIP // 2, half), height - 1 - half)
            while next_row <= middle + half:
                slot = next_row % side
                _take_heights(depth[next_row], quality[next_row], lowest, 1 / scale, heights[slot], counted[slot])
                next_row += 1
            _sum_columns(heights, middle, half, vertical[0], vertical[1], vertical[2])
            _sum_columns(counted, middle, half, vertical[3], vertical[4], vertical[5])
            for k in range(2):
                above, below, both = vertical[3 * k], vertical[3 * k + 1], vertical[3 * k + 2]
                _sum_rows(above, 0, side, sums[4 * k])
                _sum_rows(below, 0, side, sums[4 * k + 1])
                _sum_rows(both, 0, half, sums[4 * k + 2])
                _sum_rows(both, half + 1, side, sums[4 * k + 3])
            _find_slopes(sums, heights[middle % side], counted[middle % side], half, slopes[0], slopes[1])
        _find_moments(columns[0], columns[1], half, moments[0], moments[1], moments[2])
        _shift(depth[row], moments, slopes, scale, lowest, highest, result[row - first])


@kernel
def _enter(
    image: Frame,
    entering: int,
    step: int,
    half: int,
    threshold: int,
    weights: NDArray[np.int32],
    columns: NDArray[np.int32],
) -> None:
    """Move the window one row down: sums of M_l of each column, and of M_l times its row, from the middle."""
    height, width = image.shape
    total, moment = columns[0][half : half + width], columns[1][half : half + width]
    far = np.int32(half)
    for x in range(width):
        total[x] -= weights[x]
        moment[x] += far * weights[x]
    if 0 <= entering < height:
        laplacian_row(image, entering, step, threshold, weights)
    else:
        weights[:] = 0
    for x in range(width):
        total[x] += weights[x]
        moment[x] += (far + np.int32(1)) * weights[x] - total[x]


@kernel
def _take_heights(
    depth: NDArray[np.float64],
    quality: NDArray[np.float32],
    lowest: float,
    per_step: float,
    heights: NDArray[np.float32],
    counted: NDArray[np.float32],
) -> None:
    """Depths of a row in steps from the lowest frame, and which of them count: 1 or 0."""
    for x in range(depth.size):
        counts = quality[x] >= _LEAST_QUALITY  # 0 where the depth is NaN
        counted[x] = np.float32(1) if counts else np.float32(0)
        heights[x] = np.float32((depth[x] - lowest) * per_step) if counts else np.float32(0)


@kernel
def _sum_columns(
    rows: NDArray[np.float32],
    middle: int,
    half: int,
    above: NDArray[np.float32],
    below: NDArray[np.float32],
    both: NDArray[np.float32],
) -> None:
    """Sums of each column above the middle row, below it, and of both with the middle row itself."""
    side = 2 * half + 1
    above[:] = 0
    below[:] = 0
    for k in range(1, half + 1):
        upper, lower = rows[(middle - k) % side], rows[(middle + k) % side]
        for x in range(above.size):
            above[x] += upper[x]
        for x in range(below.size):
            below[x] += lower[x]
    centre = rows[middle % side]
    for x in range(both.size):
        both[x] = above[x] + centre[x] + below[x]


@kernel
def _sum_rows(values: NDArray[np.float32], first: int, end: int, sums: NDArray[np.float32]) -> None:
    """Of each window that lies within the row: the sum of its values from first to end."""
    sums[:] = 0
    for k in range(first, end):
        shifted = values[k : k + sums.size]
        for x in range(sums.size):
            sums[x] += shifted[x]


@kernel
def _find_slopes(
    sums: NDArray[np.float32],
    heights: NDArray[np.float32],
    counted: NDArray[np.float32],
    half: int,
    along_x: NDArray[np.float32],
    along_y: NDArray[np.float32],
) -> None:
    """Slopes in steps per pixel, from the means of the window's halves; 0 where they do not tell.

    Towards the edge of the frame they are those of the last window that lies within.
    """
    side, inner = 2 * half + 1, sums.shape[1]
    least = np.float32(_LEAST_SHARE * half * side)
    apart = np.float32(1 / (half + 1))
    top, bottom, left, right = sums[0], sums[1], sums[2], sums[3]
    tops, bottoms, lefts, rights = sums[4], sums[5], sums[6], sums[7]
    for x in range(inner):
        upper, lower = np.divide(top[x], tops[x]), np.divide(bottom[x], bottoms[x])
        before, behind = np.divide(left[x], lefts[x]), np.divide(right[x], rights[x])
        here = heights[x + half]
        known = (tops[x] >= least) & (bottoms[x] >= least) & (lefts[x] >= least) & (rights[x] >= least)
        known &= counted[x + half] > np.float32(0)
        known &= abs(np.float32(0.5) * (upper + lower) - here) <= _ROUGHEST
        known &= abs(np.float32(0.5) * (before + behind) - here) <= _ROUGHEST
        along_x[x + half] = (behind - before) * apart if known else np.float32(0)
        along_y[x + half] = (lower - upper) * apart if known else np.float32(0)
    for slopes in (along_x, along_y):
        slopes[:half] = slopes[half]
        slopes[half + inner :] = slopes[half + inner - 1]


@kernel
def _find_moments(
    totals: NDArray[np.int32],
    moments: NDArray[np.int32],
    half: int,
    weight: NDArray[np.int32],
    along_x: NDArray[np.int32],
    along_y: NDArray[np.int32],
) -> None:
    """Of each window: the sum of M_l, and of M_l times its column and row, from the middle; exact."""
    width = weight.size
    total, moment = totals[half : half + width], moments[half : half + width]
    for x in range(width):
        weight[x] = total[x]
    for x in range(width):
        along_y[x] = moment[x]
    along_x[:] = 0
    for k in range(1, half + 1):
        left, right = totals[half - k : half - k + width], totals[half + k : half + k + width]
        distance = np.int32(k)
        for x in range(width):
            weight[x] += left[x] + right[x]
        for x in range(width):
            along_x[x] += distance * (right[x] - left[x])
        left, right = moments[half - k : half - k + width], moments[half + k : half + k + width]
        for x in range(width):
            along_y[x] += left[x] + right[x]


@kernel
def _shift(
    depth: NDArray[np.float64],
    moments: NDArray[np.int32],
    slopes: NDArray[np.float32],
    scale: float,
    lowest: float,
    highest: float,
    result: NDArray[np.float64],
) -> None:
    """Take the slope times the centroid away."""
    weight, right, down = moments[0], moments[1], moments[2]
    along_x, along_y = slopes[0], slopes[1]
    for x in range(depth.size):
        rise = np.float32(right[x]) * along_x[x] + np.float32(down[x]) * along_y[x]
        moved = depth[x] - np.float64(np.divide(rise, np.float32(weight[x]))) * scale
        known = (weight[x] > 0) & (moved >= lowest) & (moved <= highest)
        result[x] = moved if known else depth[x]
