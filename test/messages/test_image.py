"""Masks as images."""

import numpy as np
import pytest
from mcap_ros2._dynamic import generate_dynamic

from socialcircle_ros.errors import MessageError
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.image import decode_mono8, encode_mono8, mask_pixels
from socialcircle_ros.recording import schema_text

DECODE = generate_dynamic('sensor_msgs/Image', schema_text('sensor_msgs/msg/Image'))['sensor_msgs/Image']


def test_a_mask_says_kept_outlier_and_not_measured():
    inliers = np.array([[True, False, False]])
    outliers = np.array([[False, True, False]])
    assert mask_pixels(inliers, outliers).tolist() == [[0, 255, 127]]


def test_an_encoded_image_is_what_a_stranger_decodes():
    pixels = np.arange(15, dtype=np.uint8).reshape(3, 5)
    image = DECODE(encode_mono8(Header(1, 2, 'cell'), pixels))
    assert (image.header.stamp.sec, image.header.stamp.nanosec, image.header.frame_id) == (1, 2, 'cell')
    assert (image.height, image.width, image.encoding, image.step) == (3, 5, 'mono8', 5)
    assert bytes(image.data) == pixels.tobytes()


def test_an_image_is_read_back_also_from_a_slice():
    pixels = np.arange(60, dtype=np.uint8).reshape(6, 10)[::2, 1:4]
    np.testing.assert_array_equal(decode_mono8(encode_mono8(Header(), pixels)), pixels)


def test_an_image_of_colours_is_no_mask():
    message = encode_mono8(Header(), np.zeros((2, 2), np.uint8)).replace(b'mono8', b'bgra8')
    with pytest.raises(MessageError, match='The image is bgra8; a mask is mono8'):
        decode_mono8(message)
