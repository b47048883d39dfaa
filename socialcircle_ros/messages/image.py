# SPDX-License-Identifier: Apache-2.0
"""sensor_msgs/Image: camera frames to arrays, and masks and scores to images."""

from dataclasses import dataclass
from typing import cast

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask
from socialcircle_ros.errors import MessageError

from .cdr import CdrReader, CdrWriter
from .gray import GrayImage, gray_of_colour, gray_of_mosaic
from .header import Header

TYPE = 'sensor_msgs/msg/Image'

KEPT, NOT_MEASURED, OUTLIER = 0, 127, 255
"""The values of the pixels of an outlier mask."""

_MONO = {'mono8': 1, '8UC1': 1, 'mono16': 2, '16UC1': 2}
"""Bytes per pixel."""

COLOUR_ENCODINGS = {'rgb8': False, 'bgr8': True, '8UC3': True}
"""Whether blue comes first; OpenCV's 8UC3 is BGR."""

_MOSAIC = ('bayer_rggb8', 'bayer_bggr8', 'bayer_gbrg8', 'bayer_grbg8')


@dataclass(frozen=True)
class Image:
    """The description of an image, and its pixels in place.

    Attributes:
        message: the serialized message.
        header: the time and the frame of reference.
        height: rows of pixels.
        width: columns of pixels.
        encoding: of the pixels, such as `mono8`.
        is_bigendian: whether the first byte of a pixel is its most significant one.
        step: bytes from one row to the next.
        data_start: the offset of the first pixel in `message`.
        data_length: bytes of all rows.
    """

    message: bytes | memoryview
    header: Header
    height: int
    width: int
    encoding: str
    is_bigendian: bool
    step: int
    data_start: int
    data_length: int

    @classmethod
    def decode(cls, message: bytes | memoryview) -> 'Image':
        """Read the description of a serialized Image; the pixels are neither read nor copied.

        Raises:
            MessageError: the message is not an Image, or ends early.
        """
        reader = CdrReader(message)
        header = Header.read(reader)
        height, width, encoding = reader.uint32(), reader.uint32(), reader.string()
        is_bigendian, step = reader.boolean(), reader.uint32()
        data_start, data_length = reader.octets()
        return cls(message, header, height, width, encoding, is_bigendian, step, data_start, data_length)

    def pixels(self) -> GrayImage:
        """The pixels as they were sent.

        Returns:
            A view of the message: (H, W) uint8 or uint16, or (H, W, 3) uint8 for colour.

        Raises:
            MessageError: the encoding is not supported, the image contradicts itself, or a Bayer image is smaller
                than 2×2.
        """
        channels = 3 if self.encoding in COLOUR_ENCODINGS else 1
        size = _MONO.get(self.encoding, 1)
        if self.encoding not in (*_MONO, *COLOUR_ENCODINGS, *_MOSAIC):
            raise MessageError(
                f'The encoding {self.encoding!r} is not supported; send mono8, mono16, rgb8, bgr8 or bayer_*8.'
            )
        if self.height == 0 or self.width == 0:
            raise MessageError(f'The image is empty: height {self.height}, width {self.width}.')
        if self.encoding in _MOSAIC and min(self.height, self.width) < 2:
            raise MessageError(f'A Bayer image needs at least 2×2 pixels, not {(self.height, self.width)}.')
        if self.step < self.width * channels * size:
            raise MessageError(
                f'The image contradicts itself: step is {self.step}, but {self.width} pixels of {self.encoding}'
                f' take {self.width * channels * size} bytes.'
            )
        if self.data_length < self.step * self.height:
            raise MessageError(
                f'The image is cut short: data has {self.data_length} bytes, but step × height = {self.step} ×'
                f' {self.height} = {self.step * self.height}.'
            )
        kind = np.dtype(f'{">" if self.is_bigendian else "<"}u{size}')
        shape = (self.height, self.width, 3) if channels == 3 else (self.height, self.width)
        strides = (self.step, 3, 1) if channels == 3 else (self.step, size)
        return np.ndarray(shape, kind, self.message, offset=self.data_start, strides=strides)

    def colours(self) -> npt.NDArray[np.uint8] | None:
        """The three channels in the order in which they were sent: (H, W, 3), a view of the message; or None.

        Raises:
            MessageError: as `pixels`.
        """
        return cast('npt.NDArray[np.uint8]', self.pixels()) if self.encoding in COLOUR_ENCODINGS else None

    @property
    def blue_first(self) -> bool:
        """Whether the order of three channels is B, G, R."""
        return COLOUR_ENCODINGS.get(self.encoding, False)

    def gray(self) -> GrayImage:
        """The image in gray.

        Returns:
            (H, W) uint8 or uint16 in native byte order; a view of the message if the pixels are gray already.

        Raises:
            MessageError: as `pixels`.
        """
        pixels = self.pixels()
        if self.encoding in COLOUR_ENCODINGS:
            return gray_of_colour(
                cast('npt.NDArray[np.uint8]', pixels), blue_first=COLOUR_ENCODINGS[self.encoding]
            )
        if self.encoding in _MOSAIC:
            return gray_of_mosaic(cast('npt.NDArray[np.uint8]', pixels))
        # Only 16-bit pixels can be unaligned or in foreign byte order.
        return pixels if pixels.flags.aligned and pixels.dtype.isnative else pixels.astype(np.uint16)


def encode_image(
    header: Header, pixels: GrayImage | npt.NDArray[np.float32], *, blue_first: bool = False
) -> bytes:
    """Serialize an image.

    Args:
        header: the time and the frame of reference.
        pixels: (H, W) uint8, uint16 or float32; the encoding is mono8, mono16 or 32FC1. Or (H, W, 3) uint8, which
            is rgb8 or bgr8.
        blue_first: whether the order of the three channels is B, G, R.
    """
    height, width = pixels.shape[:2]
    encoding = {1: 'mono8', 2: 'mono16', 4: '32FC1'}[pixels.dtype.itemsize]
    if pixels.ndim == 3:
        encoding = 'bgr8' if blue_first else 'rgb8'
    writer = CdrWriter()
    header.write(writer)
    writer.uint32(height)
    writer.uint32(width)
    writer.string(encoding)
    writer.boolean(False)
    writer.uint32(pixels[:1].nbytes)
    little = np.ascontiguousarray(pixels, pixels.dtype.newbyteorder('<'))
    writer.octets(little.view(np.uint8).data.cast('B'))
    return writer.finish()


def mask_pixels(inliers: Mask, outliers: Mask) -> npt.NDArray[np.uint8]:
    """The pixels of an outlier mask.

    Args:
        inliers: (H, W) bool, the points that were kept.
        outliers: (H, W) bool.

    Returns:
        (H, W) uint8: 0 kept, 255 outlier, 127 not measured.
    """
    unmeasured = ~(inliers | outliers)
    return outliers * np.uint8(OUTLIER) + unmeasured * np.uint8(NOT_MEASURED)


def decode_mono8(message: bytes) -> npt.NDArray[np.uint8]:
    """The pixels of a serialized mono8 image, such as a mask.

    Returns:
        (H, W) uint8, a view of the message.

    Raises:
        MessageError: the message is not a mono8 image, or is cut short.
    """
    image = Image.decode(message)
    if image.encoding not in ('mono8', '8UC1'):
        raise MessageError(f'The image is {image.encoding}; a mask is mono8.')
    return cast('npt.NDArray[np.uint8]', image.pixels())
