# SPDX-License-Identifier: Apache-2.0
"""Recordings for the tests of this folder."""

from pathlib import Path

from mcap.writer import CompressionType, Writer

from socialcircle_ros.recording import Message, RecordingWriter, Topic, open_recording, ros_topic

POINTS = ros_topic('/points', 'sensor_msgs/msg/PointCloud2')
CLOCK = ros_topic('/clock', 'rosgraph_msgs/msg/Clock')


def some_messages(count=40, size=20):
    """Messages every 10 ns, alternating between two topics."""
    return [
        Message(('/points', '/clock')[i % 2], bytes([i % 256]) * size, 1000 + 10 * i, 1001 + 10 * i, i)
        for i in range(count)
    ]


def write(path, messages, topics=(POINTS, CLOCK), **options):
    with RecordingWriter(path, **options) as writer:
        for topic in topics:
            writer.add_topic(topic)
        for message in messages:
            writer.write(*message)
    return Path(path)


def write_mcap(path, messages, *, chunk_size=200, compression='NONE', topics=(POINTS, CLOCK), **options):
    """Write with mcap alone, so that chunks and indexes can be chosen."""
    writer = Writer(str(path), chunk_size=chunk_size, compression=CompressionType[compression], **options)
    writer.start('ros2', 'test')
    channels = {}
    for topic in topics:
        schema = writer.register_schema(topic.type, topic.schema_encoding, topic.schema)
        channels[topic.name] = writer.register_channel(topic.name, topic.encoding, schema, dict(topic.metadata))
    for message in messages:
        writer.add_message(
            channels[message.topic], message.log_time, message.data, message.publish_time, message.sequence
        )
    writer.finish()
    return Path(path)


def read(path, topics=None):
    """The messages and the damage."""
    with open_recording(path) as reader:
        return list(reader.messages(topics)), reader.damage


def small_topic(name, text=b'uint8 a', encoding='cdr'):
    return Topic(name, 'test_msgs/msg/Any', text, 'ros2msg', encoding, {'a': 'b'})


SMALL = (small_topic('/points'), small_topic('/clock'))
