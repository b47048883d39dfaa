# SPDX-License-Identifier: Apache-2.0
"""The index of an MCAP file is trusted whole or not at all."""

import struct

import pytest
from mcap.opcode import Opcode
from mcap.records import ChunkIndex, Statistics
from recording.samples import SMALL, read, some_messages, write_mcap

from socialcircle_ros.recording import open_recording
from socialcircle_ros.recording.mcap_file import McapFile
from socialcircle_ros.recording.mcap_records import FOOTER, split, stream

MESSAGES = some_messages()


@pytest.fixture
def path(tmp_path):
    return write_mcap(tmp_path / 'a.mcap', MESSAGES, topics=SMALL, enable_crcs=False, compression='ZSTD')


def change_summary(path, change):
    """Rewrite the summary with other records; `change` gets and returns lists of opcode and body."""
    data = path.read_bytes()
    footer = len(data) - FOOTER.size - 8
    start = FOOTER.unpack_from(data, footer)[2]
    records = change([(opcode, bytes(body)) for opcode, body in split(data[start:footer])])
    summary = b''.join(struct.pack('<BQ', opcode, len(body)) + body for opcode, body in records)
    path.write_bytes(data[:start] + summary + FOOTER.pack(Opcode.FOOTER, 20, start, 0, 0) + data[-8:])


def changed(opcode, kind, **values):
    """Change attributes of the records with an opcode; a callable gets the old value."""

    def change(records):
        return [(code, rewritten(body) if code == opcode else body) for code, body in records]

    def rewritten(body):
        from mcap.data_stream import RecordBuilder

        record = kind.read(stream(memoryview(body)))
        for name, value in values.items():
            setattr(record, name, value(getattr(record, name)) if callable(value) else value)
        builder = RecordBuilder()
        record.write(builder)
        return builder.end()[9:]

    return change


def without(opcode, which):
    def change(records):
        left = [place for place, (code, _) in enumerate(records) if code == opcode]
        return [record for place, record in enumerate(records) if place != left[which]]

    return change


def statistics(**values):
    return changed(Opcode.STATISTICS, Statistics, **values)


def chunks(**values):
    return changed(Opcode.CHUNK_INDEX, ChunkIndex, **values)


def both(*changes):
    def change(records):
        for one in changes:
            records = one(records)
        return records

    return change


LESS = lambda count: count - 1  # noqa: E731
MISMATCHES = {
    'nothing': lambda records: records,
    'no schemas': lambda records: [item for item in records if item[0] != Opcode.SCHEMA],
    'no schemas and none counted': both(
        lambda records: [item for item in records if item[0] != Opcode.SCHEMA], statistics(schema_count=0)
    ),
    'a channel is missing': without(Opcode.CHANNEL, 0),
    'a channel is missing and not counted': both(
        without(Opcode.CHANNEL, 0), statistics(channel_count=LESS, channel_message_counts={})
    ),
    'a chunk is missing': without(Opcode.CHUNK_INDEX, 1),
    'a chunk is missing and not counted': both(without(Opcode.CHUNK_INDEX, 1), statistics(chunk_count=LESS)),
    'the first chunk is missing and not counted': both(
        without(Opcode.CHUNK_INDEX, 0), statistics(chunk_count=LESS)
    ),
    'the last chunk is missing and not counted': both(
        without(Opcode.CHUNK_INDEX, -1), statistics(chunk_count=LESS)
    ),
    'counts that contradict each other': statistics(message_count=LESS),
    'statistics are missing': without(Opcode.STATISTICS, 0),
    'more channels are counted': statistics(channel_count=5),
    'times of chunks': chunks(message_start_time=7),
    'later times of chunks': chunks(message_end_time=lambda time: time + 1),
    'sizes of chunks': chunks(uncompressed_size=3),
    'lengths of chunks': chunks(chunk_length=LESS),
    'places of chunks': chunks(chunk_start_offset=LESS),
    'compression of chunks': chunks(compression='lz4'),
    'topics of chunks': chunks(message_index_offsets={9: 9}),
}


@pytest.mark.parametrize('name', MISMATCHES)
def test_whichever_part_of_the_index_does_not_match_every_message_is_read(path, name):
    change_summary(path, MISMATCHES[name])
    with open_recording(path) as reader:
        assert reader.topics == {topic.name: topic for topic in SMALL}
        assert reader.message_count == len(MESSAGES)
        assert list(reader.messages()) == MESSAGES
        assert reader.damage is None or 'all messages are read' in reader.damage


def test_an_index_that_matches_is_used(path, monkeypatch):
    monkeypatch.setattr(McapFile, '_index_from_scan', lambda _: pytest.fail('the file was scanned'))
    assert read(path) == (MESSAGES, None)


def test_messages_outside_of_the_chunks_that_the_index_names_are_read(tmp_path):
    """A recorder that writes some messages without a chunk."""
    path = write_mcap(tmp_path / 'a.mcap', MESSAGES[:20], topics=SMALL, enable_crcs=False)
    data = path.read_bytes()
    footer = len(data) - FOOTER.size - 8
    start = FOOTER.unpack_from(data, footer)[2]
    end = start - 13  # before the record that ends the data
    loose = b''
    for message in MESSAGES[20:]:
        channel = 1 + (message.topic == '/clock')
        body = (
            struct.pack('<HIQQ', channel, message.sequence, message.log_time, message.publish_time) + message.data
        )
        loose += struct.pack('<BQ', Opcode.MESSAGE, len(body)) + body
    moved = FOOTER.pack(Opcode.FOOTER, 20, start + len(loose), 0, 0)
    path.write_bytes(data[:end] + loose + data[end:footer] + moved + data[-8:])
    assert read(path) == (MESSAGES, None)


@pytest.mark.parametrize('indexed', [True, False])
def test_a_chunk_with_an_unknown_compression_is_named(path, indexed):
    data = path.read_bytes().replace(b'\x04\0\0\0zstd', b'\x04\0\0\0brot')
    path.write_bytes(data if indexed else data[: len(data) - 200])
    found, damage = read(path)
    assert found == []
    assert "a chunk has the unknown compression 'brot'" in damage
    with open_recording(path) as reader:
        assert "compression 'brot'" in str(reader.refusal('There is nothing.'))


def test_a_number_with_two_meanings_is_damage(tmp_path):
    messages = some_messages(4)
    path = write_mcap(tmp_path / 'a.mcap', messages, topics=SMALL, use_chunking=False)
    content = path.read_bytes()
    again = content.index(b'\x04', content.index(messages[3].data))
    clash = (
        b'\x04'
        + struct.pack('<Q', 30)
        + struct.pack('<HH', 1, 1)
        + b'\x05\0\0\0/else'
        + b'\x03\0\0\0cdr'
        + bytes(10)
    )
    path.write_bytes(content[:again] + clash[: 9 + 30] + content[again:])
    found, damage = read(path)
    assert found == messages
    assert damage is not None
