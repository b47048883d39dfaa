# SPDX-License-Identifier: Apache-2.0
"""The correction of each depth from the centroid of the texture in its window to the pixel itself.

F of a pixel is a sum over its window (eq. 2). Its curve therefore peaks at the mean depth of the window, in which
each pixel weighs as much as its texture. On a slope this is the depth at the centroid of the texture, not at the
pixel. At the edge of the frame, where the window is cut off, the error always has the same sign.

The weights are known once the stack is complete: M_l (eq. 1) of the all-in-focus image. The slope comes from the
depths in the window. The correction subtracts the slope times the centroid.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .measure import Frame, MeasureParameters, laplacian_row

_LEAST_QUALITY = np.float32(0.5)
"""Depths of lower quality do not count for the slope."""

_LEAST_SHARE = 0.5
"""Share of each half of the window that must count."""

_ROUGHEST = np.float32(0.5)
"""Largest difference, in steps, between the mean of two opposite halves and the middle; above it is an edge."""

_STRIP = 4
"""Rows that share their slopes. A slope changes little over so few rows, and it takes most of the time."""


class _ScanRange(NamedTuple):
    """The range of the stack in z, in the unit of z."""

    lowest: float
    highest: float

    step: float
    """The median distance of two frames."""


class _Maps(NamedTuple):
    """What the correction starts from, (H, W) each."""

    depth: NDArray[np.float64]
    quality: NDArray[np.float32]
    image: Frame


class _Window(NamedTuple):
    """The rows in the window, and what is known of it; work arrays. Row r is at index r modulo 2N + 1."""

    weights: NDArray[np.int32]
    """(2N + 1, W): M_l."""

    columns: NDArray[np.int32]
    """(2, W + 2N): sums over each column of M_l and of M_l times its row, with N zeros at either end."""

    moments: NDArray[np.int32]
    """(3, W): sums over each window of M_l, of M_l times its column, and of M_l times its row."""

    heights: NDArray[np.float32]
    """(2N + 1, W): depths in steps from the lowest frame, 0 where they do not count."""

    counted: NDArray[np.float32]
    """(2N + 1, W): 1 where the depth counts, else 0."""

    vertical: NDArray[np.float32]
    """(6, W): sums of the columns of `heights` and `counted`: above, below, and all."""

    sums: NDArray[np.float32]
    """(8, W - 2N): sums over each half of a window: top, bottom, left, right of `heights`, then of `counted`."""

    slopes: NDArray[np.float32]
    """(2, W): along x and along y, in steps per pixel."""


def correct_for_centroid(
    depth: NDArray[np.float64],
    quality: NDArray[np.float32],
    image: Frame,
    z: NDArray[np.float64],
    parameters: MeasureParameters,
) -> NDArray[np.float64]:
    """Correct each depth from the centroid of the texture in its window to its pixel.

    Args:
        depth: (H, W) from the fit, in the unit of z.
        quality: (H, W), 0 to 1.
        image: (H, W), every pixel from its sharpest frame.
        z: (n,) of the frames, ascending.
        parameters: of the focus measure.

    Returns:
        The depths (H, W), NaN where `depth` is. A depth is unchanged where the slope is not known, or where the
        corrected depth would be outside the scan.
    """
    height, width = depth.shape
    if parameters.half_window == 0 or min(height, width) < 2 * parameters.half_window + 1:
        return depth
    result = np.empty_like(depth)
    maps = _Maps(depth, quality, image)
    scan = _ScanRange(float(z[0]), float(z[-1]), float(np.median(np.diff(z))))

    def correct(rows: slice) -> None:
        _correct(maps, rows.start, rows.stop, scan, parameters, result[rows])

    in_bands(correct, height, width)
    return result


@kernel
def _correct(
    maps: _Maps, first: int, end: int, scan: _ScanRange, parameters: MeasureParameters, result: NDArray[np.float64]
) -> None:
    """`correct_for_centroid` for the rows from `first` to `end`; no result depends on where they are divided."""
    height, width = maps.depth.shape
    half = parameters.half_window
    side = 2 * half + 1
    window = _make_window(width, half)
    next_row = min(max(first // _STRIP * _STRIP + _STRIP // 2, half), height - 1 - half) - half
    for entering in range(first - half, end + half):
        _move_down(maps.image, entering, parameters, window.weights[entering % side], window.columns)
        row = entering - half
        if row < first:
            continue
        if row == first or row % _STRIP == 0:
            middle = min(max(row // _STRIP * _STRIP + _STRIP // 2, half), height - 1 - half)
            while next_row <= middle + half:
                slot = next_row % side
                depth, quality = maps.depth[next_row], maps.quality[next_row]
                _take_heights(depth, quality, scan, window.heights[slot], window.counted[slot])
                next_row += 1
            _sum_halves(window, middle, half)
            heights, counted = window.heights[middle % side], window.counted[middle % side]
            _find_slopes(window.sums, heights, counted, half, window.slopes)
        _find_moments(window.columns, half, window.moments)
        _shift(maps.depth[row], window.moments, window.slopes, scan, result[row - first])


@kernel
def _make_window(width: int, half: int) -> _Window:
    side = 2 * half + 1
    return _Window(
        np.zeros((side, width), np.int32),
        np.zeros((2, width + 2 * half), np.int32),
        np.empty((3, width), np.int32),
        np.empty((side, width), np.float32),
        np.empty((side, width), np.float32),
        np.empty((6, width), np.float32),
        np.empty((8, width - 2 * half), np.float32),
        np.empty((2, width), np.float32),
    )


@kernel
def _move_down(
    image: Frame,
    entering: int,
    parameters: MeasureParameters,
    weights: NDArray[np.int32],
    columns: NDArray[np.int32],
) -> None:
    """Move the window down by one row: update the column sums of M_l, and of M_l times its row from the middle.

    Args:
        image: (H, W).
        entering: the row that enters the window; outside the image its weights are 0.
        parameters: of the focus measure.
        weights: (W,), M_l of the row that leaves; overwritten by that of the row that enters.
        columns: (2, W + 2N), updated.
    """
    height, width = image.shape
    half = parameters.half_window
    total, moment = columns[0][half : half + width], columns[1][half : half + width]
    far = np.int32(half)
    for x in range(width):
        total[x] -= weights[x]
        moment[x] += far * weights[x]
    if 0 <= entering < height:
        laplacian_row(image, entering, parameters, weights)
    else:
        weights[:] = 0
    for x in range(width):
        total[x] += weights[x]
        moment[x] += (far + np.int32(1)) * weights[x] - total[x]


@kernel
def _take_heights(
    depth: NDArray[np.float64],
    quality: NDArray[np.float32],
    scan: _ScanRange,
    heights: NDArray[np.float32],
    counted: NDArray[np.float32],
) -> None:
    """Write the depths of a row in steps from the lowest frame, and 1 or 0 for whether each of them counts."""
    lowest, per_step = scan.lowest, 1 / scan.step
    for x in range(depth.size):
        counts = quality[x] >= _LEAST_QUALITY  # the quality is 0 where the depth is NaN
        counted[x] = np.float32(1) if counts else np.float32(0)
        heights[x] = np.float32((depth[x] - lowest) * per_step) if counts else np.float32(0)


@kernel
def _sum_halves(window: _Window, middle: int, half: int) -> None:
    """Write the sums over the halves of all windows with the middle row `middle`."""
    side = 2 * half + 1
    vertical, sums = window.vertical, window.sums
    _sum_columns(window.heights, middle, half, vertical[0], vertical[1], vertical[2])
    _sum_columns(window.counted, middle, half, vertical[3], vertical[4], vertical[5])
    for k in range(2):
        above, below, both = vertical[3 * k], vertical[3 * k + 1], vertical[3 * k + 2]
        _sum_rows(above, 0, side, sums[4 * k])
        _sum_rows(below, 0, side, sums[4 * k + 1])
        _sum_rows(both, 0, half, sums[4 * k + 2])
        _sum_rows(both, half + 1, side, sums[4 * k + 3])


@kernel
def _sum_columns(
    rows: NDArray[np.float32],
    middle: int,
    half: int,
    above: NDArray[np.float32],
    below: NDArray[np.float32],
    both: NDArray[np.float32],
) -> None:
    """Write the sums of each column above the middle row, below it, and of all rows with the middle one."""
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
    """Write the sum of the values from `first` to `end` of each window that is entirely in the row."""
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
    slopes: NDArray[np.float32],
) -> None:
    """Write the slopes in steps per pixel, from the means of the halves of the window; 0 where they are not known.

    A pixel near the edge of the frame has the slope of the nearest window that is entirely in the row.

    Args:
        sums: (8, W - 2N), see `_Window`.
        heights: (W,) of the middle row.
        counted: (W,) of the middle row.
        half: N.
        slopes: (2, W), written.
    """
    along_x, along_y = slopes[0], slopes[1]
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
    for along in (along_x, along_y):
        along[:half] = along[half]
        along[half + inner :] = along[half + inner - 1]


@kernel
def _find_moments(columns: NDArray[np.int32], half: int, window_moments: NDArray[np.int32]) -> None:
    """Write the sums over each window of M_l, and of M_l times its column and its row from the middle; exact.

    Args:
        columns: (2, W + 2N), see `_Window`.
        half: N.
        window_moments: (3, W), written.
    """
    totals, moments = columns[0], columns[1]
    weight, along_x, along_y = window_moments[0], window_moments[1], window_moments[2]
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
    scan: _ScanRange,
    result: NDArray[np.float64],
) -> None:
    """Write the depths of a row less the slope times the centroid."""
    lowest, highest, step = scan.lowest, scan.highest, scan.step
    weight, right, down = moments[0], moments[1], moments[2]
    along_x, along_y = slopes[0], slopes[1]
    for x in range(depth.size):
        rise = np.float32(right[x]) * along_x[x] + np.float32(down[x]) * along_y[x]
        moved = depth[x] - np.float64(np.divide(rise, np.float32(weight[x]))) * step
        known = (weight[x] > 0) & (moved >= lowest) & (moved <= highest)
        result[x] = moved if known else depth[x]
