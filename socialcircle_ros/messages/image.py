"""sensor_msgs/Image."""

from typing import Any

import numpy as np
import numpy.typing as npt

from .cdr import CdrWriter
from .header import Header

TYPE = 'sensor_msgs/msg/Image'

KEPT, NOT_MEASURED, OUTLIER = 0, 127, 255
"""What the pixels of an outlier mask say."""


def encode_mono8(header: Header, pixels: npt.NDArray[np.uint8]) -> bytes:
    """A serialized mono8 image of `pixels`, (H, W) uint8."""
    height, width = pixels.shape
    writer = CdrWriter()
    header.write(writer)
    writer.uint32(height)
    writer.uint32(width)
    writer.string('mono8')
    writer.boolean(False)
    writer.uint32(width)
    writer.octets(np.ascontiguousarray(pixels).data.cast('B'))
    return writer.finish()


def mask_pixels(inliers: npt.NDArray[np.bool_], outliers: npt.NDArray[np.bool_]) -> npt.NDArray[Any]:
    """The outlier mask as pixels, (H, W) uint8: 0 kept, 255 outlier, 127 not measured."""
    pixels = np.full(inliers.shape, NOT_MEASURED, np.uint8)
    pixels[inliers] = KEPT
    pixels[outliers] = OUTLIER
    return pixels
