# SPDX-License-Identifier: Apache-2.0
"""How evenly the texture of a window is spread over it, and what that means for the quality.

F of a pixel is a sum over its window (eq. 2). The depth is that of the pixels which have the texture. Where a few
have most of it, as around a glint, a scratch or a speck of dust, it says little about the pixel in the middle. It
may be that of a reflection, which is not on the surface at all, however sharp its peak is.

The measure is the effective number of pixels, (Σ M_l)² / Σ M_l², as a share of the window. M_l (eq. 1) is that of
the all-in-focus image. The share is 0.64 to 0.8 where the texture is random, and 0.2 where one bright point
outshines the rest. On simulated stacks the odds that the depth is good grow with its sixth power.
"""

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.kernels.bands import in_bands
from socialcircle_ros.kernels.compiled import kernel

from .measure import Frame, MeasureParameters, laplacian_row
from .reasons import FEW_PIXELS

_EVEN_ODDS = 0.25
"""Share of the window at which a depth is as likely good as not, if there is no noise."""


def lower_where_few_pixels_have_texture(
    image: Frame, parameters: MeasureParameters, quality: NDArray[np.float32], reasons: NDArray[np.uint8]
) -> None:
    """Multiply the quality by the probability that the depth of the texture is that of the pixel.

    Args:
        image: (H, W), every pixel from its sharpest frame.
        parameters: of the focus measure; all texture counts, also below its threshold.
        quality: (H, W), 0 to 1, updated.
        reasons: (H, W), bits of `Reason`, updated where that probability is below a half.
    """
    every = parameters._replace(threshold=0)

    def lower(rows: slice) -> None:
        _lower(image, rows.start, every, quality[rows], reasons[rows])

    in_bands(lower, *image.shape)


@kernel
def _lower(
    image: Frame,
    first: int,
    parameters: MeasureParameters,
    quality: NDArray[np.float32],
    reasons: NDArray[np.uint8],
) -> None:
    """`lower_where_few_pixels_have_texture` for the rows from `first`; sums are exact in any division of rows."""
    height, width = image.shape
    half = parameters.half_window
    side = 2 * half + 1
    laplacians = np.zeros((side, width), np.int32)  # row r is at index r modulo 2N + 1
    sums, squares = np.zeros(width, np.int64), np.zeros(width, np.int64)
    for entering in range(first - half, first + len(quality) + half):
        laplacian = laplacians[entering % side]
        for x in range(width):
            leaving = np.int64(laplacian[x])
            sums[x] -= leaving
            squares[x] -= leaving * leaving
        if 0 <= entering < height:
            laplacian_row(image, entering, parameters, laplacian)
            for x in range(width):
                value = np.int64(laplacian[x])
                sums[x] += value
                squares[x] += value * value
        else:
            laplacian[:] = 0
        row = entering - half
        if row >= first:
            rows = min(row + half, height - 1) - max(row - half, 0) + 1
            _lower_row(sums, squares, half, rows, quality[row - first], reasons[row - first])


@kernel
def _lower_row(
    sums: NDArray[np.int64],
    squares: NDArray[np.int64],
    half: int,
    rows: int,
    quality: NDArray[np.float32],
    reasons: NDArray[np.uint8],
) -> None:
    """Lower the quality of one row.

    Args:
        sums: (W,), of M_l over each column of the window.
        squares: (W,), of the squares of M_l.
        half: N.
        rows: of the window that are in the frame.
        quality: (W,), updated.
        reasons: (W,), updated.
    """
    width = sums.size
    total, square = np.int64(0), np.int64(0)
    for x in range(-half, width):
        if x + half < width:
            total += sums[x + half]
            square += squares[x + half]
        if x - half - 1 >= 0:
            total -= sums[x - half - 1]
            square -= squares[x - half - 1]
        if x < 0 or square == 0:
            continue
        pixels = rows * (min(x + half, width - 1) - max(x - half, 0) + 1)
        share = np.float64(total) * np.float64(total) / (np.float64(square) * pixels * _EVEN_ODDS)
        odds = share * share * share * share * share * share
        quality[x] *= np.float32(odds / (1 + odds))
        if odds < 1 and quality[x] > 0:
            reasons[x] |= FEW_PIXELS
