# SPDX-License-Identifier: Apache-2.0
import os
import tracemalloc
from io import BytesIO
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.exceptions import EndOfFile
from mcap.stream_reader import StreamReader
from recording.samples import SMALL, read, some_messages, write_mcap

from socialcircle_ros.errors import RecordingError
from socialcircle_ros.recording import Message, open_recording
from socialcircle_ros.recording.mcap_file import McapFile

LAYOUTS = {
    'chunks': {},
    'lz4': {'compression': 'LZ4'},
    'zstd': {'compression': 'ZSTD'},
    'no chunks': {'use_chunking': False},
    'no checksums': {'enable_crcs': False},
}


@pytest.fixture(params=LAYOUTS)
def recording(request, tmp_path):
    messages = some_messages()
    path = write_mcap(tmp_path / 'intact.mcap', messages, topics=SMALL, **LAYOUTS[request.param])
    return path, messages


def record_ends(data):
    """The offsets at which records outside of chunks end."""
    stream = BytesIO(data)
    ends = [stream.tell()]
    records = StreamReader(stream, emit_chunks=True).records
    try:
        for _ in records:
            ends.append(stream.tell())  # noqa: PERF401 - the stream moves on with each record
    except EndOfFile:
        pass
    return ends


def cut(path, length):
    data = path.read_bytes()
    damaged = path.with_name('damaged.mcap')
    damaged.write_bytes(data[:length])
    return damaged


def assert_prefix_and_one_sentence(path, messages):
    found, damage = read(path)
    assert found == messages[: len(found)]
    assert damage is not None
    assert damage.startswith(str(path))
    assert damage.endswith('.')
    assert '\n' not in damage
    return found


def test_an_intact_file_gives_every_message_and_no_damage(recording):
    path, messages = recording
    assert read(path) == (messages, None)


def test_a_file_cut_at_any_byte_gives_the_messages_before_and_one_sentence(recording):
    path, messages = recording
    lengths = range(8, path.stat().st_size, 7)
    counts = [len(assert_prefix_and_one_sentence(cut(path, length), messages)) for length in lengths]
    assert counts == sorted(counts)
    assert counts[-1] == len(messages)


def test_a_file_cut_between_records_gives_the_messages_before_and_one_sentence(recording):
    path, messages = recording
    for end in record_ends(path.read_bytes())[1:-1]:
        assert_prefix_and_one_sentence(cut(path, end), messages)


def test_messages_at_the_beginning_of_a_cut_off_chunk_are_read(tmp_path):
    messages = some_messages(40)
    path = write_mcap(tmp_path / 'a.mcap', messages, chunk_size=10**6, topics=SMALL)
    half = cut(path, path.stat().st_size // 3)
    with open_recording(half) as reader:
        found = list(reader.messages())
        assert 0 < len(found) == reader.message_count < len(messages)
    assert 'cut off' in reader.damage


@settings(max_examples=150, deadline=None)
@given(data=st.data(), layout=st.sampled_from(sorted(LAYOUTS)))
def test_changed_bytes_raise_a_recording_error_or_nothing(data, layout, tmp_path_factory):
    messages = some_messages(12)
    folder = tmp_path_factory.mktemp('changed')
    path = write_mcap(folder / 'a.mcap', messages, topics=SMALL, **LAYOUTS[layout])
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(8, len(content) - 1))] ^= data.draw(st.integers(1, 255))
    path.write_bytes(content)
    try:
        read(path)
    except RecordingError as error:
        assert str(path) in str(error)


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_changed_bytes_in_a_chunk_are_found_by_its_checksum(data, tmp_path_factory):
    messages = some_messages(40)
    path = write_mcap(tmp_path_factory.mktemp('changed') / 'a.mcap', messages, topics=SMALL)
    chunks = [span.offset + 60 for span in McapFile(path).spans[:-1]]  # the last one is shorter
    place = data.draw(st.sampled_from(chunks)) + data.draw(st.integers(0, 150))
    content = bytearray(path.read_bytes())
    content[place] ^= 0xFF
    path.write_bytes(content)
    found = assert_prefix_and_one_sentence(path, messages)
    assert len(found) < len(messages)


def test_a_damaged_index_loses_nothing(recording):
    path, messages = recording
    content = bytearray(path.read_bytes())
    content[-60] ^= 0xFF  # among the offsets of the summary
    path.write_bytes(content)
    found, damage = read(path)
    assert found == messages
    if damage:  # without a checksum, damage of the offsets is not found; they are not used
        assert 'index' in damage


def test_an_index_that_does_not_match_its_data_is_rebuilt(tmp_path):
    messages = some_messages()
    path = write_mcap(tmp_path / 'a.mcap', messages, topics=SMALL, enable_crcs=False)
    content = path.read_bytes()
    offset = McapFile(path).spans[1].offset.to_bytes(8, 'little')
    path.write_bytes(content.replace(offset, (77).to_bytes(8, 'little')))
    found, damage = read(path)
    assert found == messages
    assert 'index' in damage


def test_an_index_that_counts_too_many_messages_is_reported(tmp_path):
    messages = some_messages(10)
    path = write_mcap(tmp_path / 'a.mcap', messages, chunk_size=10**6, topics=SMALL, enable_crcs=False)
    content = path.read_bytes()
    at = content.index(messages[4].data) - 22 - 9
    path.write_bytes(content[:at] + b'\x77' + content[at + 1 :])  # a record with an unknown opcode
    found, damage = read(path)
    assert found == messages[:4] + messages[5:]
    assert 'counts 10 messages, but 9' in damage


@pytest.mark.parametrize(
    'options', [{'use_statistics': False}, {'repeat_channels': False}, {'use_chunking': False}]
)
def test_an_intact_file_without_a_full_index_is_read_in_order_without_damage(tmp_path, options):
    messages = some_messages()
    shuffled = messages[20:] + messages[:20]
    path = write_mcap(tmp_path / 'a.mcap', shuffled, topics=SMALL, **options)
    assert read(path) == (messages, None)


def test_garbage_after_the_magic_is_damage(tmp_path):
    path = write_mcap(tmp_path / 'a.mcap', some_messages(4), topics=SMALL)
    path.write_bytes(path.read_bytes()[:8] + bytes(range(256)) * 40)
    assert assert_prefix_and_one_sentence(path, []) == []


def test_a_huge_length_allocates_little_memory(tmp_path):
    path = write_mcap(tmp_path / 'a.mcap', some_messages(10), chunk_size=10**6, topics=SMALL)
    content = bytearray(path.read_bytes())
    span = McapFile(path).spans[0]
    content[span.offset + 1 + 5] = 0x7F  # a high byte of the chunk's length
    path.write_bytes(content)
    tracemalloc.start()
    assert_prefix_and_one_sentence(path, some_messages(10))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 5e6


@pytest.mark.parametrize('method', ['LZ4', 'ZSTD'])
@pytest.mark.parametrize('indexed', [True, False])
@pytest.mark.parametrize('stated', [2 * 10**9, 1000])
def test_a_chunk_that_would_fill_the_memory_is_damage(tmp_path, method, indexed, stated):
    """A chunk of 100 MB in some kilobytes, that states a size above the limit, or less than it is."""
    big = Message('/points', bytes(10**8), 1, 1, 0)
    path = write_mcap(tmp_path / 'a.mcap', [big], compression=method, topics=SMALL, chunk_size=10**9)
    span = McapFile(path).spans[0]
    content = bytearray(path.read_bytes())
    content[span.offset + 25 : span.offset + 33] = stated.to_bytes(8, 'little')
    path.write_bytes(content if indexed else content[: span.offset + span.length])
    tracemalloc.start()
    found, damage = read(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found == []
    assert ('expands to 2000 MB, above the limit' if stated > 10**9 else 'length of a chunk') in damage
    assert peak < 5e6


@pytest.mark.parametrize('compression', ['NONE', 'LZ4', 'ZSTD'])
def test_memory_does_not_grow_with_the_recording(tmp_path, compression):
    def peak(count):
        messages = (message._replace(data=os.urandom(50_000)) for message in some_messages(count))
        path = write_mcap(tmp_path / f'{count}.mcap', messages, chunk_size=10**5, compression=compression)
        tracemalloc.start()
        with open_recording(path) as reader:
            number = sum(1 for _ in reader.messages())
        result = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert number == count
        return result

    few, many = peak(20), peak(400)
    assert many < few + 500_000


@pytest.mark.parametrize(
    ('content', 'sentence'),
    [
        (b'', r'is empty: the recorder ended'),
        (b'SQLite format 3\0' + bytes(100), r'is an sqlite3 bag: .* `ros2 bag convert`'),
        (b'#ROSBAG V2.0\n' + bytes(100), r'is a bag of ROS 1: .* `rosbags-convert`'),
        (b'\x1f\x8b\x08' + bytes(100), r'is compressed with gzip: .*`gzip -d`'),
        (b'\x04\x22\x4d\x18' + bytes(100), r'is compressed with lz4: .*`lz4 -d`'),
        (b'BZh91AY' + bytes(100), r'is compressed with bzip2'),
        (b'\xfd7zXZ\0' + bytes(100), r'is compressed with xz'),
        (b'PK\x03\x04' + bytes(100), r'is a zip archive'),
        (b'\x89MCAP', r'is not an MCAP file'),
    ],
)
def test_another_format_is_refused_with_advice(tmp_path, content, sentence):
    path = tmp_path / 'x.mcap'
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=f'x.mcap {sentence}'):
        open_recording(path)


def test_spans_follow_one_another_in_the_file(recording):
    path, _ = recording
    file = McapFile(path)
    assert all(one.offset + one.length <= other.offset for one, other in pairwise(file.spans))
    file.close()
