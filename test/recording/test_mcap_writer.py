# SPDX-License-Identifier: Apache-2.0
"""The same calls give the same bytes as mcap's own writer."""

import zlib
from io import BytesIO

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from socialcircle_ros.recording.mcap_writer import McapWriter

CHUNK_SIZE = 500
numbers = st.integers(0, 2**63 - 1)
names = st.sampled_from(['/a', '/größe/ж', ''])
extras = st.dictionaries(names, names, max_size=2)
schemas = st.tuples(st.just('schema'), names, st.just('ros2msg'), st.binary(max_size=300))
channels = st.tuples(st.just('channel'), names, st.just('cdr'), st.integers(0, 2), extras)
metadata = st.tuples(st.just('metadata'), names, extras)
data = st.one_of(
    st.binary(max_size=40), st.integers(0, 3 * CHUNK_SIZE).map(lambda size: bytes(range(7)) * (size // 7))
)
messages = st.tuples(st.just('message'), st.integers(1, 4), numbers, data, numbers, st.integers(0, 2**32 - 1))
attachments = st.lists(st.tuples(numbers, numbers, names, names, st.binary(max_size=40)), max_size=2)
steps = st.lists(st.one_of(schemas, channels, metadata, messages, messages), max_size=30)


class Memory:
    """An output that keeps what is written."""

    def __init__(self):
        self.content = bytearray()

    @property
    def position(self):
        return len(self.content)

    def write(self, *parts):
        for part in parts:
            self.content += part


def drive(writer, attached, steps):
    """Make the same calls on either writer."""
    calls = {
        'schema': writer.register_schema,
        'channel': writer.register_channel,
        'metadata': writer.add_metadata,
        'message': writer.add_message,
    }
    writer.start(profile='ros2', library='test')
    for attachment in attached:
        writer.add_attachment(*attachment)
    for kind, *arguments in steps:
        calls[kind](*arguments)
    writer.finish()


def written(attached, steps, compression, chunked=True):
    memory = Memory()
    drive(McapWriter(memory, CHUNK_SIZE, compression, chunked=chunked), attached, steps)
    return bytes(memory.content)


def written_by_mcap(attached, steps, compression, chunked=True):
    indexes = IndexType.ALL if chunked else IndexType.METADATA | IndexType.ATTACHMENT
    indexes &= IndexType.ALL if attached else ~IndexType.ATTACHMENT
    content = BytesIO()
    options = {
        'compression': CompressionType[compression.upper()],
        'index_types': indexes,
        'use_chunking': chunked,
    }
    drive(Writer(content, CHUNK_SIZE, **options), attached, steps)
    return content.getvalue()


@settings(max_examples=150, deadline=None)
@given(attached=attachments, steps=steps, compression=st.sampled_from(['none', 'lz4', 'zstd']))
def test_a_file_is_the_same_byte_for_byte_as_that_of_mcap(attached, steps, compression):
    assert written(attached, steps, compression) == written_by_mcap(attached, steps, compression)


@settings(max_examples=50, deadline=None)
@given(steps=steps, compression=st.sampled_from(['none', 'lz4', 'zstd']))
def test_a_checksum_that_is_known_before_changes_no_byte(steps, compression):
    known = [(*step, zlib.crc32(step[3])) if step[0] == 'message' else step for step in steps]
    assert written([], known, compression) == written_by_mcap([], steps, compression)


@settings(max_examples=20, deadline=None)
@given(attached=attachments, steps=st.lists(st.one_of(schemas, channels, metadata), max_size=6))
def test_a_file_without_chunks_is_the_same_byte_for_byte_as_that_of_mcap(attached, steps):
    ours = written(attached, steps, 'none', chunked=False)
    assert ours == written_by_mcap(attached, steps, 'none', chunked=False)


def test_mcap_reads_small_and_large_messages_and_checks_them():
    sent = [
        ('message', 1, time, bytes([time]) * size, time + 1, time) for time, size in enumerate((9, 90, 5000, 0, 3))
    ]
    steps = [('schema', 'a', 'ros2msg', b'uint8 a'), ('channel', '/a', 'cdr', 1, {}), *sent]
    reader = make_reader(BytesIO(written([], steps, 'none')), validate_crcs=True)
    found = [(message.log_time, message.data, message.publish_time) for _, _, message in reader.iter_messages()]
    assert found == [step[2:5] for step in sent]
    assert reader.get_summary().statistics.message_count == 5


@pytest.mark.parametrize('kind', [bytes, bytearray, memoryview, lambda data: memoryview(data).cast('I')])
@pytest.mark.parametrize('size', [40, 4000])
def test_the_memory_of_a_message_may_be_used_again_at_once(kind, size):
    memory = Memory()
    writer = McapWriter(memory, CHUNK_SIZE, 'none')
    writer.start('ros2', 'test')
    writer.register_channel('/a', 'cdr', 0, {})
    buffer = bytearray(b'7' * size)
    writer.add_message(1, 5, kind(buffer), 5, 0)
    buffer[:] = b'x' * size
    writer.finish()
    ((_, _, message),) = make_reader(BytesIO(bytes(memory.content)), validate_crcs=True).iter_messages()
    assert message.data == b'7' * size
