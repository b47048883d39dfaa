"""sensor_msgs/Image."""

from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.errors import MessageError

from .cdr import CdrReader, CdrWriter
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


def decode_mono8(message: bytes) -> npt.NDArray[np.uint8]:
    """The pixels of a serialized mono8 image, (H, W) uint8, a view where rows have no padding.

    Raises:
        MessageError: not a mono8 image, or one that is cut short.
    """
    reader = CdrReader(message)
    Header.read(reader)
    height, width, encoding = reader.uint32(), reader.uint32(), reader.string()
    reader.boolean()
    step = reader.uint32()
    start, length = reader.octets()
    if encoding not in ('mono8', '8UC1'):
        raise MessageError(f'The image is {encoding}; a mask is mono8.')
    if step < width or length < step * height:
        raise MessageError(f'The image is cut short: {length} bytes for {height} rows of {step}.')
    return np.ndarray((height, width), np.uint8, message, offset=start, strides=(step, 1))
