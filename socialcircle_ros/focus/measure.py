# SPDX-License-Identifier: Apache-2.0
"""The focus measure of the paper: the sum-modified-Laplacian (SML, eq. 1 to 3), in exact integer arithmetic.

Source: S. K. Nayar, Y. Nakagawa, Shape from focus, IEEE Trans. Pattern Anal. Mach. Intell. 16 (1994) 824-831,
DOI 10.1109/34.308479. The symbols are those of the paper: M_l is the modified Laplacian, F the focus measure,
s the step, N the half-window and T the threshold.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.arguments import settings_or_default
from socialcircle_ros.errors import StackError
from socialcircle_ros.kernels.compiled import kernel
from socialcircle_ros.settings import FocusSettings

Frame = NDArray[np.uint8] | NDArray[np.uint16]
"""A gray image (H, W)."""


FINE_STEP = 2
"""Step of the fine scale, where the step is chosen from the frames."""


class MeasureParameters(NamedTuple):
    """The parameters of the focus measure, as the kernels take them."""

    step: int
    """s of eq. 1, pixels."""

    half_window: int
    """N of eq. 2, pixels."""

    threshold: int
    """T of eq. 3, gray levels."""

    @classmethod
    def of(cls, settings: FocusSettings) -> 'MeasureParameters':
        """The parameters that the settings give; where the step is chosen, those of the fine scale."""
        return cls(settings.step or FINE_STEP, settings.half_window, settings.threshold)


REFERENCE = {np.dtype(np.uint8): 64.0, np.dtype(np.uint16): 16384.0}
"""Mean gray level to which F of a frame is scaled, by data type: a quarter of the range."""


class MeasureBuffers(NamedTuple):
    """Work arrays of `measure_row`; `measure_buffers` makes them."""

    laplacians: NDArray[np.int32]
    """(2N + 1, W): M_l of the rows in the window; row r is at index r modulo 2N + 1."""

    columns: NDArray[np.int32]
    """(W + 2N,): sums of the columns of `laplacians`, with N zeros at either end."""


def focus_measure(frame: Frame, settings: FocusSettings | None = None) -> NDArray[np.int32]:
    """Compute the sum-modified-Laplacian of one frame (eq. 1 to 3); the result is exact.

    Each sum at the border covers what exists: a direction of eq. 1 counts as 0 where one of its two neighbours
    is outside the frame, and the window of eq. 2 ends at the edge of the frame. M_l below T counts as 0.

    Args:
        frame: (H, W) uint8 or uint16, gray levels; any strides.
        settings: step (0: 2), half_window and threshold are used; None: the defaults.

    Returns:
        F of each pixel, (H, W) int32, gray levels.

    Raises:
        StackError: the frame is not two-dimensional, is empty, or has another data type.

    Example:
        >>> focus_measure(np.eye(5, dtype=np.uint8), FocusSettings(step=1, half_window=0))[2]
        array([0, 2, 4, 2, 0], dtype=int32)
    """
    return measure_frame(checked_frame(frame), MeasureParameters.of(settings_or_default(FocusSettings, settings)))


def scale_of(frame: Frame) -> float:
    """The factor to make a frame as bright as the reference. A frame darker than one gray level counts as 1."""
    return REFERENCE[frame.dtype] / max(float(_light(frame)), 1.0)


@kernel
def _light(frame: Frame) -> float:
    """Mean gray level of all pixels.

    With some rows left out, a ruling that repeats with those that are read would show its own contrast, which
    changes with the focus, as flicker. All rows take hardly longer than a few: the time is that of the memory.
    """
    height, width = frame.shape
    total = np.int64(0)
    for row in range(height):
        pixels = frame[row]
        for x in range(width):
            total += np.int64(pixels[x])
    return float(total / (height * width))


def checked_frame(frame: object) -> Frame:
    """Return `frame` as a C-contiguous, writable array, as the kernels take it.

    Views and read-only frames are copied. The copy takes a tenth of the time of one pass over the frame; a
    kernel compiled for another layout would take as long as a thousand passes.

    Raises:
        StackError: this is not a gray image of a supported data type, or pixels of it are masked.
    """
    if np.ma.is_masked(frame):
        raise StackError('A frame cannot have masked pixels: give all of them as they were taken.')
    array = np.asarray(frame)
    if array.ndim != 2 or array.size == 0:
        raise StackError(f'A frame must be a gray image of shape (H, W), not {array.shape}.')
    if array.dtype not in (np.uint8, np.uint16):
        raise StackError(f'A frame must be uint8 or uint16 in the byte order of this machine, not {array.dtype}.')
    return np.require(array, requirements=['C', 'W'])


@kernel
def measure_frame(frame: Frame, parameters: MeasureParameters) -> NDArray[np.int32]:
    """`focus_measure` of a checked frame."""
    height, width = frame.shape
    measure = np.empty((height, width), np.int32)
    buffers = measure_buffers(width, parameters.half_window)
    for row in range(height):
        measure_row(frame, row, 0, parameters, buffers, measure[row])
    return measure


@kernel
def measure_buffers(width: int, half_window: int) -> MeasureBuffers:
    """Return the work arrays of `measure_row` for rows of `width` pixels."""
    return MeasureBuffers(
        np.zeros((2 * half_window + 1, width), np.int32), np.zeros(width + 2 * half_window, np.int32)
    )


@kernel
def measure_row(
    frame: Frame,
    row: int,
    first: int,
    parameters: MeasureParameters,
    buffers: MeasureBuffers,
    measure: NDArray[np.int32],
) -> None:
    """Write F of one row (eq. 2) to `measure`, (W,).

    Call it for the rows `first`, `first` + 1, ... in turn with the same new buffers. The column sums move down
    with the window, so that each M_l is computed once, added once and subtracted once.
    """
    height, width = frame.shape
    half = parameters.half_window
    laplacians, columns = buffers.laplacians, buffers.columns
    side = 2 * half + 1
    inner = columns[half : half + width]
    for entering in range(max(row - half, 0) if row == first else row + half, row + half + 1):
        laplacian = laplacians[entering % side]  # still holds the row that leaves the window
        for x in range(width):
            inner[x] -= laplacian[x]
        if entering < height:
            laplacian_row(frame, entering, parameters, laplacian)
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
def laplacian_row(frame: Frame, row: int, parameters: MeasureParameters, laplacian: NDArray[np.int32]) -> None:
    """Write M_l of one row (eq. 1) to `laplacian`, (W,); values below T become 0 (eq. 3).

    |2a - b - c| is computed as max(2a, b + c) - min(2a, b + c). Unsigned integers then need no wider type, and
    the compiler vectorises the loop.
    """
    height, width = frame.shape
    step, threshold = parameters.step, parameters.threshold
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
