# SPDX-License-Identifier: Apache-2.0
"""Hostile input from a seeded generator: messages, parameters, transitions and recordings.

The same seed gives the same input. The tests and `attack.soak` share it.
"""

from random import Random

import numpy as np

from socialcircle_ros.messages import point_cloud
from socialcircle_ros.messages.cdr import CdrWriter
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.image import encode_image
from socialcircle_ros.messages.joint_state import JointState
from socialcircle_ros.recording import RecordingWriter, ros_topic
from socialcircle_ros.settings import PARAMETERS

NUMBERS = (0, 1, 2, 3, 4, 7, 8, 12, 255, 256, 65_535, 65_536, 2**31 - 1, 2**31, 2**32 - 1)
HEIGHTS = (np.nan, np.inf, -np.inf, 0.0, -0.0, 1e-45, 1e-38, 1e30, 3.4e38, -3.4e38)
FIELD_NAMES = ('x', 'y', 'z', 'z', 'intensity', '', 'ж', 'x' * 300)
ENCODINGS = ('mono8', 'mono16', 'rgb8', 'bgr8', 'bayer_rggb8', '32FC1', '8UC1', '', 'mono8\0', 'no encoding')
STAMPS = ((0, 0), (1, 0), (-1, 0), (2**31 - 1, 999_999_999), (-(2**31), 0), (1, 2**32 - 1))
FRAME_IDS = ('microscope', '', 'x' * 1000, 'ж' * 5, '$(reboot)', 'a\nb')
TEXTS = ('', 'paper', 'adaptive', '$(reboot)', '../../etc/passwd', 'x' * 2000, 'ж\n', '{[', '\0')
PERIOD_NS = 20_000_000

STORMED = tuple(
    name for name in PARAMETERS if name.startswith(('circle.', 'focus.', 'stack.', 'repair.', 'output.'))
)


def damaged(random: Random, data: bytes) -> bytes:
    """The bytes with one to four faults of a medium or of a hostile writer."""
    changed = bytearray(data)
    for _ in range(random.randint(1, 4)):
        place = random.randrange(len(changed) + 1)
        length = random.choice((1, 2, 4, 8, 64, 700))
        kind = random.randrange(6)
        if kind == 0:
            del changed[place:]
        elif kind == 1:
            del changed[place : place + length]
        elif kind == 2:
            changed[place:place] = random.randbytes(length)
        elif kind == 3:
            changed[place : place + length] = random.randbytes(len(changed[place : place + length]))
        elif kind == 4:
            changed[place:place] = changed[place : place + length]
        else:
            number = random.choice((*NUMBERS, 2**62)).to_bytes(8, 'little')[: random.choice((4, 8))]
            changed[place : place + len(number)] = number
    return bytes(changed)


def _header(random: Random) -> Header:
    if random.random() < 0.5:
        return Header(1, 2, 'microscope')
    return Header(*random.choice(STAMPS), random.choice(FRAME_IDS))


def hostile_cloud(random: Random) -> bytes:
    """A PointCloud2 that contradicts itself, holds extreme numbers, or is damaged."""
    height, width, step = random.randint(1, 24), random.randint(1, 24), 12
    points = np.random.default_rng(random.getrandbits(32)).normal(size=(height, width, 3)).astype('<f4')
    for _ in range(random.choice((0, 0, 3, 40))):
        where = random.randrange(height), random.randrange(width), random.randrange(3)
        points[where] = random.choice(HEIGHTS)
    numbers = {'height': height, 'width': width, 'point_step': step, 'row_step': step * width}
    fields = [['x', 0, 7, 1], ['y', 4, 7, 1], ['z', 8, 7, 1]]
    for _ in range(random.choice((0, 1, 1, 2))):
        field = random.choice(fields)
        part = random.randrange(6)
        if part < 4:
            field[part] = random.choice((FIELD_NAMES, NUMBERS, range(12), NUMBERS)[part])
        else:
            numbers[random.choice(list(numbers))] = random.choice(NUMBERS)
    if random.random() < 0.1:
        fields.insert(random.randrange(4), [random.choice(FIELD_NAMES), 0, 7, 1])
    writer = CdrWriter()
    _header(random).write(writer)
    writer.uint32(numbers['height'])
    writer.uint32(numbers['width'])
    writer.uint32(len(fields))
    for name, offset, datatype, count in fields:
        writer.string(name)
        writer.uint32(offset)
        writer.uint8(datatype)
        writer.uint32(count)
    writer.boolean(random.random() < 0.1)
    writer.uint32(numbers['point_step'])
    writer.uint32(numbers['row_step'])
    writer.octets(points.tobytes())
    writer.boolean(random.random() < 0.5)
    message = writer.finish()
    return damaged(random, message) if random.random() < 0.3 else message


def hostile_frame(random: Random) -> bytes:
    """An Image whose numbers contradict each other, or that is damaged."""
    height, width = random.randint(1, 30), random.randint(1, 30)
    values = {'height': height, 'width': width, 'step': width}
    for _ in range(random.choice((0, 1, 1, 2))):
        values[random.choice(list(values))] = random.choice(NUMBERS)
    writer = CdrWriter()
    _header(random).write(writer)
    writer.uint32(values['height'])
    writer.uint32(values['width'])
    writer.string(random.choice(ENCODINGS) if random.random() < 0.4 else 'mono8')
    writer.uint8(random.choice((0, 0, 0, 1, 255)))
    writer.uint32(values['step'])
    writer.octets(random.randbytes(height * width))
    message = writer.finish()
    return damaged(random, message) if random.random() < 0.3 else message


def hostile_joint_state(random: Random) -> bytes:
    """A JointState with extreme positions or stamps, with names that do not match, or damaged."""
    names = [random.choice(('stage', '', 'ж', 'x' * 200)) for _ in range(random.randint(0, 3))]
    positions = [
        random.choice((0.0, 1e-6, 1e300, float('nan'), float('inf'))) for _ in range(random.randint(0, 3))
    ]
    message = JointState(_header(random), names, positions).encode()
    return damaged(random, message) if random.random() < 0.4 else message


def hostile_parameter(random: Random) -> tuple[str, object]:
    """The name of a parameter of the node, and a value that may be allowed or not."""
    name = random.choice(STORMED)
    row = PARAMETERS[name]
    values = (
        row.default,
        *(row.limits.choices or ()),
        random.choice(TEXTS),
        random.choice((0, 1, -1, 3, 5, 31, 2**31, 2**63 - 1, -(2**63))),
        random.choice((0.0, 0.5, -1.0, 1e-300, 1e300, float('nan'), float('inf'))),
        random.choice((True, False)),
        random.choice(([0, 0, 0, 0], [0, 0, 9, 9], [1], [-1] * 4, [0.5, 2.0], ['a', 'b'])),
    )
    return name, random.choice(values)


def good_stack() -> list[tuple[bytes, bytes]]:
    """Joint states and frames of nine steps of a textured plane that is sharpest in the middle."""
    texture = np.random.default_rng(1).integers(0, 200, (24, 30))
    stack = []
    for number in range(9):
        header = Header.at((number + 1) * PERIOD_NS, 'camera')
        pixels = (texture * np.exp(-(((number - 4) / 2) ** 2))).astype(np.uint8)
        stack.append((JointState(header, ['stage'], [number * 1e-6]).encode(), encode_image(header, pixels)))
    return stack


def write_recording(path, clouds) -> None:
    """A recording of clouds on /cell/points, and of their numbers on another topic."""
    with RecordingWriter(path, compression='none' if path.suffix == '.mcap' else 'zstd') as writer:
        for name in ('/cell/points', '/other/points'):
            writer.add_topic(ros_topic(name, point_cloud.TYPE))
        for number, message in enumerate(clouds):
            writer.write('/cell/points', message, 100 * number + 100, 100 * number + 100, number)
