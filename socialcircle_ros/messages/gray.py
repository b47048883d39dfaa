# SPDX-License-Identifier: Apache-2.0
"""Gray images from the colour images and Bayer mosaics of cameras."""

import numpy as np
import numpy.typing as npt

from socialcircle_ros.kernels.compiled import kernel

GrayImage = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]


def gray_of_colour(pixels: npt.NDArray[np.uint8], *, blue_first: bool) -> npt.NDArray[np.uint8]:
    """Luma of a colour image, with the weights of ITU-R BT.601 in integers: (77 R + 150 G + 29 B + 128) / 256.

    Args:
        pixels: (H, W, 3) uint8, any strides.
        blue_first: whether the order of the channels is B, G, R.

    Returns:
        (H, W) uint8.
    """
    return _luma(pixels[..., ::-1] if blue_first else pixels)


@kernel
def _luma(pixels: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    height, width = pixels.shape[:2]
    gray = np.empty((height, width), np.uint8)
    for row in range(height):
        for column in range(width):
            red = np.int32(pixels[row, column, 0])
            green = np.int32(pixels[row, column, 1])
            blue = np.int32(pixels[row, column, 2])
            gray[row, column] = (77 * red + 150 * green + 29 * blue + 128) >> 8
    return gray


@kernel
def gray_of_mosaic(pixels: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """The mean of each 2×2 window of a Bayer mosaic, rounded.

    The window of a pixel holds the pixel and its neighbours to the right, below and diagonally below. Whatever the
    pattern, each window has one red, two green and one blue pixel. So the mosaic vanishes, which a focus measure
    would take for texture. A value belongs to the centre of its window, half a pixel to the lower right. The last
    row and column repeat the windows of the row and column before.

    Args:
        pixels: (H, W) uint8, H and W at least 2.

    Returns:
        (H, W) uint8.
    """
    height, width = pixels.shape
    gray = np.empty((height, width), np.uint8)
    for row in range(height):
        r = min(row, height - 2)
        for column in range(width):
            c = min(column, width - 2)
            above = np.int32(pixels[r, c]) + np.int32(pixels[r, c + 1])
            below = np.int32(pixels[r + 1, c]) + np.int32(pixels[r + 1, c + 1])
            gray[row, column] = (above + below + 2) >> 2
    return gray
