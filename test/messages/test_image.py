# SPDX-License-Identifier: Apache-2.0
"""Images: camera frames, masks and scores."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.errors import MessageError
from socialcircle_ros.messages.cdr import CdrWriter
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.image import Image, decode_mono8, encode_image, mask_pixels
from socialcircle_ros.recording import schema_text

generate_dynamic = pytest.importorskip('mcap_ros2._dynamic', reason='needs mcap-ros2-support').generate_dynamic

DECODE = generate_dynamic('sensor_msgs/Image', schema_text('sensor_msgs/msg/Image'))['sensor_msgs/Image']


def test_mask_pixels_are_kept_outlier_or_not_measured():
    inliers = np.array([[True, False, False]])
    outliers = np.array([[False, True, False]])
    assert mask_pixels(inliers, outliers).tolist() == [[0, 255, 127]]


def test_an_encoded_image_is_decoded_by_another_library():
    pixels = np.arange(15, dtype=np.uint8).reshape(3, 5)
    image = DECODE(encode_image(Header(1, 2, 'cell'), pixels))
    assert (image.header.stamp.sec, image.header.stamp.nanosec, image.header.frame_id) == (1, 2, 'cell')
    assert (image.height, image.width, image.encoding, image.step) == (3, 5, 'mono8', 5)
    assert bytes(image.data) == pixels.tobytes()


def test_a_score_is_an_image_of_floats_and_keeps_nan():
    score = np.array([[0.25, np.nan, 1.0], [0.0, 0.75, 0.5]], np.float32)
    image = DECODE(encode_image(Header(1, 2, 'cell'), score))
    assert (image.height, image.width, image.encoding, image.step) == (2, 3, '32FC1', 12)
    assert not image.is_bigendian
    assert bytes(image.data) == score.tobytes()


def test_a_score_is_refused_as_a_mask():
    with pytest.raises(MessageError, match='The image is 32FC1; a mask is mono8'):
        decode_mono8(encode_image(Header(), np.zeros((2, 2), np.float32)))


def test_a_slice_is_encoded_and_read_back():
    pixels = np.arange(60, dtype=np.uint8).reshape(6, 10)[::2, 1:4]
    np.testing.assert_array_equal(decode_mono8(encode_image(Header(), pixels)), pixels)


def test_a_colour_image_is_refused_as_a_mask():
    message = encode_image(Header(), np.zeros((2, 2), np.uint8)).replace(b'mono8', b'bgra8')
    with pytest.raises(MessageError, match='The image is bgra8; a mask is mono8'):
        decode_mono8(message)


def message(encoding, pixels, *, step=0, bigendian=False):
    """A serialized image with padding after each row."""
    rows = [np.ascontiguousarray(row).tobytes() for row in pixels]
    step = step or len(rows[0]) + 5
    writer = CdrWriter()
    Header(1, 2, 'camera').write(writer)
    writer.uint32(pixels.shape[0])
    writer.uint32(pixels.shape[1])
    writer.string(encoding)
    writer.boolean(bigendian)
    writer.uint32(step)
    writer.octets(b''.join(row + bytes(step - len(row)) for row in rows))
    return writer.finish()


SHAPES = st.tuples(st.integers(2, 6), st.integers(2, 7))


@given(SHAPES, st.integers(0, 2**32))
def test_gray_frames_are_read_with_padding_and_in_both_byte_orders(shape, seed):
    rng = np.random.default_rng(seed)
    small, large = rng.integers(0, 256, shape, np.uint8), rng.integers(0, 65536, shape, np.uint16)
    np.testing.assert_array_equal(Image.decode(message('mono8', small)).gray(), small)
    np.testing.assert_array_equal(Image.decode(message('mono16', large.astype('<u2'))).gray(), large)
    swapped = Image.decode(message('mono16', large.astype('>u2'), bigendian=True)).gray()
    np.testing.assert_array_equal(swapped, large)
    assert swapped.dtype.isnative


@given(SHAPES, st.integers(0, 2**32))
def test_colour_becomes_luma(shape, seed):
    rgb = np.random.default_rng(seed).integers(0, 256, (*shape, 3), np.uint8)
    expected = [[(77 * int(r) + 150 * int(g) + 29 * int(b) + 128) // 256 for r, g, b in row] for row in rgb]
    np.testing.assert_array_equal(Image.decode(message('rgb8', rgb)).gray(), expected)
    np.testing.assert_array_equal(Image.decode(message('bgr8', rgb[..., ::-1])).gray(), expected)


@given(SHAPES, st.integers(0, 2**32), st.sampled_from(['rggb', 'bggr', 'gbrg', 'grbg']))
def test_a_mosaic_becomes_the_mean_of_each_two_by_two_window(shape, seed, pattern):
    mosaic = np.random.default_rng(seed).integers(0, 256, shape, np.uint8)
    rows, columns = shape
    expected = np.empty(shape, int)
    for row in range(rows):
        for column in range(columns):
            r, c = min(row, rows - 2), min(column, columns - 2)
            expected[row, column] = (int(mosaic[r : r + 2, c : c + 2].astype(int).sum()) + 2) // 4
    np.testing.assert_array_equal(Image.decode(message(f'bayer_{pattern}8', mosaic)).gray(), expected)


def test_a_mosaic_of_a_uniform_colour_has_no_texture():
    mosaic = np.empty((6, 8), np.uint8)
    mosaic[::2, ::2], mosaic[::2, 1::2], mosaic[1::2, ::2], mosaic[1::2, 1::2] = 200, 120, 120, 40
    assert len(np.unique(Image.decode(message('bayer_rggb8', mosaic)).gray())) == 1


@pytest.mark.parametrize(
    ('data', 'sentence'),
    [
        (message('yuv422', np.zeros((3, 4), np.uint8)), "encoding 'yuv422' is not supported; send mono8, mono16"),
        (message('mono8', np.zeros((3, 4), np.uint8))[:-3], 'ends early|more bytes follow'),
        (message('mono16', np.zeros((3, 4), np.uint8), step=7), 'contradicts itself: step is 7'),
        (message('rgb8', np.zeros((3, 4), np.uint8), step=11), 'contradicts itself: step is 11'),
        (message('bayer_rggb8', np.zeros((1, 4), np.uint8)), 'at least 2×2 pixels'),
        (
            message('mono8', np.zeros((3, 4), np.uint8)).replace(
                struct.pack('<2I', 3, 4), struct.pack('<2I', 4, 4)
            ),
            'cut short: data has 27 bytes, but step × height = 9 × 4 = 36',
        ),
    ],
)
def test_a_bad_frame_is_refused_with_the_reason(data, sentence):
    with pytest.raises(MessageError, match=sentence):
        Image.decode(data).gray()


def test_a_mono_frame_is_not_copied():
    data = message('mono8', np.zeros((3, 4), np.uint8))
    assert np.shares_memory(Image.decode(data).gray(), np.frombuffer(data, np.uint8))
