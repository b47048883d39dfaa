# SPDX-License-Identifier: Apache-2.0
"""Reading ahead and writing behind."""

import threading

import pytest

from socialcircle_ros.errors import RecordingError
from socialcircle_ros.recording import Message, open_recording, overlap
from socialcircle_ros.recording.large_chunks import LARGE
from socialcircle_ros.recording.overlap import WriterBehind, read_ahead
from socialcircle_ros.recording.topics import ros_topic
from socialcircle_ros.recording.writer import RecordingWriter

TOPIC = ros_topic('/a', 'sensor_msgs/msg/PointCloud2')


def messages(count, size=10):
    return [Message('/a', bytes([place % 256]) * size, place, place, place) for place in range(count)]


@pytest.fixture(params=[1, 25, 1 << 20])
def bundle(request, monkeypatch):
    """Bytes of a bundle: every message by itself, some together, all together."""
    monkeypatch.setattr(overlap, 'BUNDLE', request.param)
    return request.param


@pytest.mark.usefixtures('bundle')
@pytest.mark.parametrize('count', [0, 1, 2, 3, 40])
def test_messages_come_whole_and_in_their_order(count):
    assert list(read_ahead(iter(messages(count)))) == messages(count)


@pytest.mark.usefixtures('bundle')
def test_what_reading_raises_comes_behind_the_messages_before_it():
    def broken():
        yield from messages(5)
        raise RecordingError('broken')

    read = []
    with pytest.raises(RecordingError, match='broken'):
        read.extend(iter(read_ahead(broken())))
    stream = read_ahead(broken())
    assert [next(stream) for _ in range(5)] == messages(5)


def test_the_next_messages_are_read_while_the_last_are_worked_on(monkeypatch):
    monkeypatch.setattr(overlap, 'BUNDLE', 1)
    second_was_read = threading.Event()

    def source():
        yield messages(1)[0]
        second_was_read.set()

    stream = read_ahead(source())
    next(stream)

    assert second_was_read.wait(60)


def test_reading_may_be_left_off():
    before = threading.enumerate()
    stream = read_ahead(iter(messages(1000)))
    next(stream)
    stream.close()

    assert set(threading.enumerate()) <= set(before)
    assert list(stream) == []


def test_what_is_written_behind_is_in_the_recording_in_its_order(tmp_path, bundle):
    path = tmp_path / 'a.mcap'
    with RecordingWriter(path) as writer, WriterBehind(writer, bundle) as behind:
        behind.add_topic(TOPIC)
        for message in messages(40):
            behind.write(message)
        behind.add_topic(ros_topic('/later', 'sensor_msgs/msg/PointCloud2'))
        behind.write(Message('/later', b'', 40, 40, 40))
    with open_recording(path) as reader:
        assert list(reader.messages()) == [*messages(40), Message('/later', b'', 40, 40, 40)]


def test_large_messages_are_written_behind_as_they_are_written_at_once(tmp_path):
    large = messages(3, size=LARGE + 3)
    at_once, behind, again = (tmp_path / folder / 'a.mcap' for folder in ('at_once', 'behind', 'again'))
    for path in (at_once, behind, again):
        path.parent.mkdir()  # the name of a file is in it
    with RecordingWriter(at_once) as writer:
        writer.add_topic(TOPIC)
        for message in large:
            writer.write(*message)
    with RecordingWriter(behind) as writer, WriterBehind(writer) as thread:
        writer.add_topic(TOPIC)
        for message in large:
            thread.write(message)
    with open_recording(at_once) as reader, RecordingWriter(again) as writer, WriterBehind(writer) as thread:
        writer.add_topic(TOPIC)
        for message in reader.messages():  # their checksums are known
            thread.write(message)
    assert at_once.read_bytes() == behind.read_bytes() == again.read_bytes()


def test_few_messages_wait_for_a_slow_disk(monkeypatch):
    monkeypatch.setattr(overlap, '_WAITING_BYTES', 30)
    accepted = written = most = 0
    full = threading.Event()

    class SlowWriter:
        def write(self, *_, **__):
            nonlocal written, most
            assert full.wait(60)
            most = max(most, accepted - written)
            written += 1

    with WriterBehind(SlowWriter(), bundle=1) as behind:
        for message in messages(40):
            accepted += 1
            if accepted == 4:  # this one is more than may wait
                full.set()
            behind.write(message)
    assert written == 40
    assert 4 <= most <= 5  # those that wait, and the one that the caller is about to hand over


def test_what_writing_raises_ends_the_block(tmp_path, bundle):
    def write():
        with RecordingWriter(tmp_path / 'a.mcap') as writer, WriterBehind(writer, bundle) as behind:
            for message in messages(40):
                behind.write(message)  # its topic was not added

    with pytest.raises(RecordingError, match='add the topic'):
        write()
    assert list(tmp_path.iterdir()) == []


def test_what_writing_raised_is_told_without_a_further_message(tmp_path):
    def write():
        with RecordingWriter(tmp_path / 'a.mcap') as writer, WriterBehind(writer, bundle=1) as behind:
            behind.write(messages(1)[0])  # its topic was not added
            while True:
                behind.check()

    with pytest.raises(RecordingError, match='add the topic'):
        write()


def test_after_an_error_of_the_caller_nothing_is_left(tmp_path):
    def write():
        with RecordingWriter(tmp_path / 'a.mcap') as writer, WriterBehind(writer) as behind:
            writer.add_topic(TOPIC)
            behind.write(messages(1)[0])
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write()
    assert list(tmp_path.iterdir()) == []
    assert not [thread for thread in threading.enumerate() if thread.name.startswith(('write_behind', 'checksum'))]
