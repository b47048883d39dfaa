"""The focus measure: the sum-modified-Laplacian, eq. 1 to 3 of the paper, exact in whole numbers."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.errors import StackError
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.settings import FocusSettings

Frame = NDArray[np.uint8] | NDArray[np.uint16]


def focus_measure(frame: Frame, settings: FocusSettings | None = None) -> NDArray[np.int32]:
    """Sum-modified-Laplacian of one frame (eq. 1 to 3), exact.

    At the border each sum is over what exists: a direction of eq. 1 counts 0 where one of its two neighbours
    lies outside the frame, and the window of eq. 2 is cut off at the frame's edge. M_l below T counts as 0.

    Args:
        frame: (H, W) uint8 or uint16, gray levels; any strides.
        settings: step, half_window and threshold are used.

    Returns:
        F of each pixel, (H, W) int32, gray levels.

    Raises:
        StackError: the frame is not two-dimensional, empty, or of another data type.
    """
    settings = settings or FocusSettings()
    frame = checked_frame(frame)
    return _measure(frame, settings.step, settings.half_window, settings.threshold)


def checked_frame(frame: Any) -> Frame:
    """`frame` as the kernels take it, or a StackError that says what a frame has to be.

    Views and read-only frames are copied: that costs a tenth of the pass, but a compilation of their own
    costs a thousand passes.
    """
    array = np.asarray(frame)
    if array.ndim != 2 or array.size == 0:
        raise StackError(f'A frame must be a gray image of shape (H, W), not {array.shape}.')
    if array.dtype not in (np.uint8, np.uint16):
        raise StackError(f'A frame must be uint8 or uint16 in the byte order of this machine, not {array.dtype}.')
    return np.require(array, requirements=['C', 'W'])


@kernel
def _measure(frame: Frame, step: int, half: int, threshold: int) -> NDArray[np.int32]:
    """`focus_measure` without its checks."""
    height, width = frame.shape
    measure = np.empty((height, width), np.int32)
    laplacians, columns = measure_buffers(width, half)
    for row in range(height):
        measure_row(frame, row, step, half, threshold, laplacians, columns, measure[row])
    return measure


@kernel
def measure_buffers(width: int, half: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Buffers of `measure_row`: the last 2N+1 rows of M_l, and their sums with N zeros at either end."""
    return np.zeros((2 * half + 1, width), np.int32), np.zeros(width + 2 * half, np.int32)


@kernel
def measure_row(
    frame: Frame,
    row: int,
    step: int,
    half: int,
    threshold: int,
    laplacians: NDArray[np.int32],
    columns: NDArray[np.int32],
    measure: NDArray[np.int32],
) -> None:
    """F of one row (eq. 2); rows are asked for from 0 upwards, each once, with the same buffers.

    Sums run along the columns, so that each M_l is computed once, added once and taken away once.
    """
    height, width = frame.shape
    side = 2 * half + 1
    inner = columns[half : half + width]
    for entering in range(0 if row == 0 else row + half, row + half + 1):
        laplacian = laplacians[entering % side]  # that of the row that leaves the window
        for x in range(width):
            inner[x] -= laplacian[x]
        if entering < height:
            laplacian_row(frame, entering, step, threshold, laplacian)
            for x in range(width):
                inner[x] += laplacian[x]
        else:
            laplacian[:] = 0
    for x in range(width):
        measure[x] = columns[x]
    for k in range(1, side, 2):
        one, next_one = columns[k : k + width], columns[k + 1 : k + 1 + width]
        for x in range(width):
            measure[x] += one[x] + next_one[x]


@kernel
def laplacian_row(frame: Frame, row: int, step: int, threshold: int, laplacian: NDArray[np.int32]) -> None:
    """M_l of one row (eq. 1), 0 below T (eq. 3).

    |2a - b - c| is written as the larger of 2a and b + c less the smaller: unsigned numbers do not need to
    be widened, and the compiler makes vectors of them.
    """
    height, width = frame.shape
    here = frame[row]
    laplacian[:] = 0
    left, centre, right, inner = (
        here[: width - 2 * step],
        here[step : width - step],
        here[2 * step :],
        laplacian[step : width - step],
    )
    for x in range(inner.size):
        twice = np.uint32(np.uint32(2) * centre[x])
        beside = np.uint32(np.uint32(left[x]) + right[x])
        inner[x] = max(twice, beside) - min(twice, beside)
    if step <= row < height - step:
        above, below = frame[row - step], frame[row + step]
        for x in range(width):
            twice = np.uint32(np.uint32(2) * here[x])
            beside = np.uint32(np.uint32(above[x]) + below[x])
            laplacian[x] += max(twice, beside) - min(twice, beside)
    if threshold > 0:
        for x in range(width):
            if laplacian[x] < threshold:
                laplacian[x] = 0
