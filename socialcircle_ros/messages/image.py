"""sensor_msgs/Image: camera frames in, masks out."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.errors import MessageError

from .cdr import CdrReader, CdrWriter
from .gray import gray_of_colour, gray_of_mosaic
from .header import Header

TYPE = 'sensor_msgs/msg/Image'

KEPT, NOT_MEASURED, OUTLIER = 0, 127, 255
"""What the pixels of an outlier mask say."""

_MONO = {'mono8': 1, '8UC1': 1, 'mono16': 2, '16UC1': 2}
_COLOUR = {'rgb8': False, 'bgr8': True, '8UC3': True}
"""Whether blue comes first; OpenCV's 8UC3 is BGR."""
_MOSAIC = ('bayer_rggb8', 'bayer_bggr8', 'bayer_gbrg8', 'bayer_grbg8')


@dataclass(frozen=True)
class Image:
    """An image where it lies in its serialized message."""

    message: bytes
    header: Header
    height: int
    width: int
    encoding: str
    is_bigendian: bool
    step: int
    data_start: int
    data_length: int

    @classmethod
    def decode(cls, message: bytes) -> 'Image':
        """Walk through a serialized Image; no pixel is looked at or copied.

        Raises:
            MessageError: the bytes are not an Image, or end early.
        """
        reader = CdrReader(message)
        header = Header.read(reader)
        height, width, encoding = reader.uint32(), reader.uint32(), reader.string()
        is_bigendian, step = reader.boolean(), reader.uint32()
        data_start, data_length = reader.octets()
        return cls(message, header, height, width, encoding, is_bigendian, step, data_start, data_length)

    def pixels(self) -> npt.NDArray[Any]:
        """The image as it was sent, a view: (H, W) uint8 or uint16, or (H, W, 3) uint8 for colour.

        Raises:
            MessageError: an encoding that is not taken here, or an image that contradicts itself.
        """
        channels = 3 if self.encoding in _COLOUR else 1
        size = _MONO.get(self.encoding, 1)
        if self.encoding not in (*_MONO, *_COLOUR, *_MOSAIC):
            raise MessageError(
                f'The image is {self.encoding!r}; send mono8, mono16, rgb8, bgr8 or bayer_*8 with 8 bits.'
            )
        if self.height == 0 or self.width == 0:
            raise MessageError(f'The image is empty: height {self.height}, width {self.width}.')
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

    def gray(self) -> npt.NDArray[Any]:
        """The image in gray, (H, W) uint8 or native uint16; a view where it is gray already.

        Raises:
            MessageError: as `pixels`; a mosaic smaller than 2×2.
        """
        pixels = self.pixels()
        if self.encoding in _COLOUR:
            return gray_of_colour(pixels, blue_first=_COLOUR[self.encoding])
        if self.encoding in _MOSAIC:
            if min(pixels.shape) < 2:
                raise MessageError(f'A Bayer image needs at least 2×2 pixels, not {pixels.shape}.')
            return gray_of_mosaic(pixels)  # type: ignore[no-any-return]
        native = pixels.dtype.newbyteorder('=')
        return pixels if pixels.flags.aligned and pixels.dtype.isnative else pixels.astype(native)


def encode_image(header: Header, pixels: npt.NDArray[Any]) -> bytes:
    """A serialized image of `pixels`: (H, W) uint8 as mono8, uint16 as mono16, float32 as 32FC1."""
    height, width = pixels.shape
    writer = CdrWriter()
    header.write(writer)
    writer.uint32(height)
    writer.uint32(width)
    writer.string({1: 'mono8', 2: 'mono16', 4: '32FC1'}[pixels.dtype.itemsize])
    writer.boolean(False)
    writer.uint32(width * pixels.dtype.itemsize)
    little = np.ascontiguousarray(pixels, pixels.dtype.newbyteorder('<'))
    writer.octets(little.view(np.uint8).data.cast('B'))
    return writer.finish()


def mask_pixels(inliers: npt.NDArray[np.bool_], outliers: npt.NDArray[np.bool_]) -> npt.NDArray[Any]:
    """The outlier mask as pixels, (H, W) uint8: 0 kept, 255 outlier, 127 not measured."""
    unmeasured = ~(inliers | outliers)
    return outliers * np.uint8(OUTLIER) + unmeasured * np.uint8(NOT_MEASURED)


def decode_mono8(message: bytes) -> npt.NDArray[np.uint8]:
    """The pixels of a serialized mono8 image, such as a mask: (H, W) uint8, a view.

    Raises:
        MessageError: not a mono8 image, or one that is cut short.
    """
    image = Image.decode(message)
    if image.encoding not in ('mono8', '8UC1'):
        raise MessageError(f'The image is {image.encoding}; a mask is mono8.')
    return image.pixels()
