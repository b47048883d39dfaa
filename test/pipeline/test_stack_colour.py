# SPDX-License-Identifier: Apache-2.0
"""Frames in colour give a picture in focus in colour, and clouds with the colours of their points."""

import numpy as np
import pytest

from socialcircle_ros.errors import StackError
from socialcircle_ros.focus import FocusStack, depth_from_focus
from socialcircle_ros.messages.cdr import CdrWriter
from socialcircle_ros.messages.gray import gray_of_colour
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.image import Image, encode_image
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.pipeline.clouds import filter_cloud
from socialcircle_ros.pipeline.stack_cloud import StackCloud
from socialcircle_ros.pipeline.stacks import StackAssembler
from socialcircle_ros.settings import FocusSettings, PipelineSettings, StackSettings

COUNT, SHAPE = 9, (40, 52)


@pytest.fixture(scope='module')
def frames():
    """(N, H, W, 3) R, G, B: green is the texture, red tells the number of the frame, blue the column."""
    texture = np.random.default_rng(0).integers(0, 180, SHAPE)
    sharpest = 3 + 2 * np.arange(SHAPE[1]) / SHAPE[1]
    made = np.zeros((COUNT, *SHAPE, 3), np.uint8)
    for k in range(COUNT):
        made[k, ..., 0] = 10 * k
        made[k, ..., 1] = 60 + texture * np.exp(-(((k - sharpest) / 2) ** 2))
        made[k, ..., 2] = np.arange(SHAPE[1])
    return made


def measured(frames, order):
    stack = FocusStack()
    for k in order:
        stack.add(gray_of_colour(frames[k], blue_first=False), float(k), frames[k])
    return stack.finish()


def cloud_of(frames, encoding):
    made = StackAssembler()
    made.configure(FocusSettings(), StackSettings(pitch_x=1e-6, pitch_y=2e-6, z_step=1e-6))
    for k, frame in enumerate(frames):
        list(made.add_frame(colour_image(frame, encoding, 20_000_000 * (k + 1))))
    (event,) = made.finish()
    assert isinstance(event, StackCloud)
    return event


def colour_image(frame, encoding, stamp):
    """A serialized image with padding behind each row."""
    pixels = frame if encoding == 'rgb8' else frame[..., ::-1]
    height, width = frame.shape[:2]
    padded = np.full((height, 3 * width + 5), 77, np.uint8)
    padded[:, : 3 * width] = pixels.reshape(height, -1)
    writer = CdrWriter()
    Header.at(stamp, 'camera').write(writer)
    writer.uint32(height)
    writer.uint32(width)
    writer.string(encoding)
    writer.boolean(False)
    writer.uint32(padded.shape[1])
    writer.octets(padded.data.cast('B'))
    return writer.finish()


@pytest.mark.parametrize('name', ['upward', 'downward', 'shuffled', 'twice'])
def test_each_pixel_has_the_colour_of_its_sharpest_frame(frames, name):
    order = {
        'upward': range(COUNT),
        'downward': range(COUNT)[::-1],
        'shuffled': np.random.default_rng(2).permutation(COUNT),
        'twice': [*range(COUNT), *range(COUNT)],
    }[name]
    found = measured(frames, order)
    gray = np.stack([gray_of_colour(frame, blue_first=False) for frame in frames])
    assert np.array_equal(found.image, depth_from_focus(gray, np.arange(COUNT)).image)
    assert np.array_equal(gray_of_colour(found.colours, blue_first=False), found.image)
    number = found.colours[..., 0] // 10
    assert np.array_equal(np.take_along_axis(gray, number[None].astype(int), 0)[0], found.image)
    assert len(np.unique(number)) > 1


def test_a_new_stack_has_the_colours_of_its_own_frames(frames):
    stack = FocusStack()
    for shown in (frames, 255 - frames):
        stack.reset()
        for k in range(COUNT):
            stack.add(gray_of_colour(shown[k], blue_first=False), float(k), shown[k])
        found = stack.finish()
    assert np.array_equal(found.colours, measured(255 - frames, range(COUNT)).colours)
    stack.reset()
    for k in range(3):
        stack.add(frames[k, ..., 1], float(k))
    assert stack.finish().colours is None


def test_colours_of_another_size_or_of_some_frames_only_are_refused(frames):
    stack = FocusStack()
    gray = gray_of_colour(frames[0], blue_first=False)
    with pytest.raises(StackError, match=r'must be \(40, 52, 3\)'):
        stack.add(gray, 0.0, frames[0, :, 1:])
    with pytest.raises(StackError, match=r'must be \(40, 52, 3\) uint8, not \(40, 52, 3\) float64'):
        stack.add(gray, 0.0, frames[0] / 2)
    stack.add(gray, 0.0, frames[0])
    with pytest.raises(StackError, match='must have colours, or none'):
        stack.add(gray, 1.0)
    assert stack.places == 1


@pytest.mark.parametrize('encoding', ['rgb8', 'bgr8', '8UC3'])
def test_points_have_the_packed_colours_of_pcl(frames, encoding):
    event = cloud_of(frames, encoding)
    picture = Image.decode(event.image)
    assert picture.encoding == ('rgb8' if encoding == 'rgb8' else 'bgr8')
    colours = picture.pixels()[..., :: 1 if encoding == 'rgb8' else -1]
    assert np.array_equal(colours, measured(frames, range(COUNT)).colours)
    field = PointCloud.decode(event.points).values('rgb')
    assert field.dtype == np.float32
    packed = np.ascontiguousarray(field).view(np.uint32)
    red, green, blue = np.moveaxis(colours.astype(np.uint32), -1, 0)
    assert np.array_equal(packed, (red << 16) + (green << 8) + blue)


def test_the_filter_keeps_each_byte_of_the_colours(frames):
    event = cloud_of(frames, 'rgb8')
    outputs = filter_cloud(event.points, PipelineSettings())
    filtered = {topic.name: data for topic, data in outputs.messages.items()}['points_filtered']
    before, after = PointCloud.decode(event.points), PointCloud.decode(filtered)
    bytes_of = lambda cloud: np.ascontiguousarray(cloud.values('rgb')).view(np.uint32)  # noqa: E731
    assert np.array_equal(bytes_of(before), bytes_of(after))
    kept = np.isfinite(after.xyz()).all(2)
    assert kept.any()
    assert np.array_equal(after.xyz()[kept], before.xyz()[kept])


def test_gray_frames_give_no_colour():
    made = StackAssembler()
    made.configure(FocusSettings(), StackSettings(pitch_x=1e-6, z_step=1e-6))
    texture = np.random.default_rng(0).integers(0, 30, SHAPE)
    for k, brightness in enumerate((1, 8, 2)):
        pixels = (texture * brightness).astype(np.uint8)
        list(made.add_frame(encode_image(Header.at(20_000_000 * (k + 1), ''), pixels)))
    (event,) = made.finish()
    assert Image.decode(event.image).encoding == 'mono8'
    assert 'rgb' not in [field.name for field in PointCloud.decode(event.points).fields]
