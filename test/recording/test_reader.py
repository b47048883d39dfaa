# SPDX-License-Identifier: Apache-2.0
import os

import lz4.frame
import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st
from recording.samples import CLOCK, POINTS, SMALL, read, small_topic, some_messages, write, write_mcap

from socialcircle_ros.errors import RecordingError
from socialcircle_ros.recording import Message, RecordingWriter, Topic, open_recording, reader
from socialcircle_ros.recording.compression import LIMIT_VARIABLE
from socialcircle_ros.recording.topics import Attachment, MetadataRecord

times = st.lists(st.integers(0, 30), max_size=60)


def split_bag(folder, messages, parts=3, *, metadata=True):
    folder.mkdir()
    size = -(-len(messages) // parts)
    names = [f'{folder.name}_{i}.mcap' for i in range(parts)]
    for i, name in enumerate(names):
        write_mcap(folder / name, messages[i * size : (i + 1) * size], topics=SMALL)
    if metadata:
        listed = ''.join(f'    - {name}\n' for name in names)
        (folder / 'metadata.yaml').write_text(f'rosbag2_bagfile_information:\n  relative_file_paths:\n{listed}')
    return folder


def test_topics_are_known_after_opening_as_they_were_recorded(tmp_path):
    with open_recording(write(tmp_path / 'a.mcap', some_messages())) as recording:
        assert recording.topics == {'/points': POINTS, '/clock': CLOCK}
        assert recording.message_count == 40
        assert recording.damage is None


@given(log_times=times)
def test_messages_come_in_the_order_of_log_time_then_of_the_file(log_times, tmp_path_factory):
    messages = [Message('/points', bytes([i]), time, 0, i) for i, time in enumerate(log_times)]
    path = write_mcap(tmp_path_factory.mktemp('order') / 'a.mcap', messages, chunk_size=150, topics=SMALL)
    assert read(path) == (sorted(messages, key=lambda message: message.log_time), None)


def test_messages_of_chosen_topics_are_read(tmp_path):
    messages = some_messages()
    path = write_mcap(tmp_path / 'a.mcap', messages, topics=SMALL)
    assert read(path, ['/clock']) == ([m for m in messages if m.topic == '/clock'], None)
    assert read(path, []) == ([], None)
    assert read(path, ['/none']) == ([], None)


def test_a_single_topic_is_one_topic_and_no_part_of_its_name_another(tmp_path):
    topics = [small_topic('/points'), small_topic('/points_filtered')]
    messages = [Message(topic.name, b'a', 5, 5, 0) for topic in topics]
    path = write_mcap(tmp_path / 'a.mcap', messages, topics=topics)
    assert read(path, '/points_filtered') == (messages[1:], None)
    with open_recording(path) as recording:
        assert recording.count('/points_filtered') == recording.count(['/points_filtered']) == 1


@given(log_times=times, since=st.integers(0, 31))
def test_reading_may_begin_in_the_middle(log_times, since, tmp_path_factory):
    messages = [Message('/points', bytes([i]), time, 0, i) for i, time in enumerate(log_times)]
    path = write_mcap(tmp_path_factory.mktemp('since') / 'a.mcap', messages, chunk_size=150, topics=SMALL)
    with open_recording(path) as recording:
        later = [message for message in recording.messages() if message.log_time >= since]
        assert list(recording.messages(since=since)) == later
        assert recording.damage is None


def test_a_recording_can_be_read_twice_and_in_parallel(tmp_path):
    messages = some_messages()
    with open_recording(write_mcap(tmp_path / 'a.mcap', messages, topics=SMALL)) as recording:
        pairs = list(zip(recording.messages(), recording.messages(), strict=True))
        assert pairs == [(message, message) for message in messages]


@pytest.mark.parametrize('metadata', [True, False])
def test_the_parts_of_a_split_bag_are_one_recording(tmp_path, metadata):
    messages = some_messages(60)
    folder = split_bag(tmp_path / 'bag', messages, parts=12, metadata=metadata)
    assert read(folder) == (messages, None)


def test_parts_that_overlap_in_time_are_merged(tmp_path):
    messages = some_messages(60)
    folder = split_bag(tmp_path / 'bag', messages[::2] + messages[1::2], parts=2)
    assert read(folder) == (messages, None)


def test_a_cut_off_part_does_not_affect_the_others(tmp_path):
    messages = some_messages(60)
    folder = split_bag(tmp_path / 'bag', messages)
    part = folder / 'bag_1.mcap'
    part.write_bytes(part.read_bytes()[:700])
    found, damage = read(folder)
    assert found[:20] == messages[:20]
    assert found[-20:] == messages[-20:]
    assert 40 < len(found) < 60
    assert damage.startswith(str(part))


def test_invalid_metadata_is_ignored(tmp_path):
    folder = split_bag(tmp_path / 'bag', some_messages())
    (folder / 'metadata.yaml').write_text('rosbag2_bagfile_information: [')
    assert read(folder) == (some_messages(), None)


def test_metadata_with_aliases_is_ignored(tmp_path):
    folder = split_bag(tmp_path / 'bag', some_messages())
    bomb = ''.join(f'a{i}: &a{i} [*a{i - 1}, *a{i - 1}]\n' for i in range(1, 60))
    (folder / 'metadata.yaml').write_text(f'a0: &a0 [x]\n{bomb}')
    assert read(folder) == (some_messages(), None)


def compressed(path, *, keep=False):
    """Compress a file as rosbag2 does with `--compression-mode file`."""
    packed = path.with_name(f'{path.name}.zstd')
    packed.write_bytes(zstandard.compress(path.read_bytes()))
    if not keep:
        path.unlink()
    return packed


def test_a_file_that_is_compressed_as_a_whole_is_read(tmp_path):
    messages = [message._replace(data=os.urandom(10_000)) for message in some_messages()]
    path = compressed(write_mcap(tmp_path / 'a.mcap', messages, topics=SMALL))
    assert read(path) == (messages, None)
    path.write_bytes(path.read_bytes()[:300_000])
    found, damage = read(path)
    assert found == messages[: len(found)]
    assert len(found) > 10
    assert damage.startswith(str(path))


@pytest.mark.parametrize('listed', ['{name}', '{name}.zstd', None])
@pytest.mark.parametrize('decompressed', ['none', 'one', 'one in part', 'all'])
def test_a_directory_of_compressed_files_is_read_however_far_it_is_decompressed(tmp_path, listed, decompressed):
    messages = some_messages(60)
    folder = split_bag(tmp_path / 'bag', messages)
    files = sorted(folder.glob('*.mcap'))
    for number, file in enumerate(files):
        if decompressed == 'one in part' and number == 1 and listed != '{name}':
            compressed(file, keep=True)
            file.write_bytes(file.read_bytes()[:300])
        elif decompressed == 'none' or (decompressed == 'one' and number != 1):
            compressed(file)
    metadata = folder / 'metadata.yaml'
    if listed is None:
        metadata.unlink()
    else:
        names = ''.join(f'  - {listed.format(name=file.name)}\n' for file in files)
        metadata.write_text(
            f'rosbag2_bagfile_information:\n  compression_mode: FILE\n  relative_file_paths:\n{names}'
        )
    assert read(folder) == (messages, None)


def test_chunks_that_overlap_in_time_and_would_fill_the_memory_are_refused(tmp_path, monkeypatch):
    """Each chunk has its first message at the beginning and its last at the end of the recording."""
    messages = [Message('/points', bytes(10**6), time, 0, 0) for _ in range(20) for time in (1, 10**9)]
    path = write_mcap(tmp_path / 'a.mcap', messages, topics=SMALL, chunk_size=15 * 10**5, compression='ZSTD')
    assert len(read(path)[0]) == 40
    monkeypatch.setenv(LIMIT_VARIABLE, '3')
    with pytest.raises(RecordingError, match=r'has more than 12 MB in chunks that overlap in time'):
        read(path)


@pytest.mark.parametrize('suffix', ['zstd', 'zst'])
def test_a_directory_without_metadata_may_hold_compressed_files(tmp_path, suffix):
    folder = split_bag(tmp_path / 'bag', some_messages(60), metadata=False)
    for file in list(folder.iterdir()):
        compressed(file).rename(f'{file}.{suffix}')
    assert read(folder) == (some_messages(60), None)


def bag_by_message(folder, messages, kind='zstd', pack=zstandard.compress):
    folder.mkdir()
    write_mcap(folder / 'a_0.mcap', [m._replace(data=pack(m.data)) for m in messages], topics=SMALL)
    (folder / 'metadata.yaml').write_text(
        f'rosbag2_bagfile_information: {{compression_mode: MESSAGE, compression_format: {kind},'
        ' relative_file_paths: [a_0.mcap]}'
    )
    return folder


def test_messages_that_are_compressed_one_by_one_are_read(tmp_path):
    messages = some_messages()
    folder = bag_by_message(tmp_path / 'bag', messages)
    assert read(folder) == (messages, None)
    assert read(folder / 'a_0.mcap') == (messages, None)


def test_another_compression_of_messages_is_named(tmp_path):
    folder = bag_by_message(tmp_path / 'bag', some_messages(), 'lz4', lz4.frame.compress)
    with pytest.raises(RecordingError, match='is compressed message by message with lz4: convert it'):
        open_recording(folder)


EXTRAS = (
    Attachment('calibration.yaml', 'text/yaml', b'pitch: 1e-6\n', 5, 6),
    Attachment('empty', '', b'', 0, 0),
    MetadataRecord('site', {'cell': '7', 'operator': ''}),
    MetadataRecord('site', {}),
)


@pytest.mark.parametrize('count', [0, 40])
@pytest.mark.parametrize('indexed', [True, False])
def test_attachments_and_metadata_records_are_read_as_they_were_written(tmp_path, count, indexed):
    path = tmp_path / 'a.mcap'
    with RecordingWriter(path) as writer:
        writer.add_topic(POINTS)
        writer.add_topic(CLOCK)
        for extra in EXTRAS:
            (writer.add_attachment if isinstance(extra, Attachment) else writer.add_metadata)(extra)
        for message in some_messages(count):
            writer.write(*message)
    if not indexed:
        path.write_bytes(path.read_bytes()[:-50])
    with open_recording(path) as recording:
        assert (*recording.attachments(), *recording.metadata()) == EXTRAS
        assert list(recording.messages()) == some_messages(count)
        assert recording.topics.keys() == {'/points', '/clock'}
        assert (recording.damage is None) == indexed


def test_a_damaged_attachment_is_told(tmp_path):
    path = tmp_path / 'a.mcap'
    with RecordingWriter(path) as writer:
        writer.add_topic(POINTS)
        writer.add_attachment(EXTRAS[0])
        writer.write('/points', b'x', 1)
    path.write_bytes(path.read_bytes().replace(b'pitch', b'patch'))
    with open_recording(path) as recording:
        assert list(recording.attachments()) == []
        assert 'an attachment' in recording.damage
        assert len(list(recording.messages())) == 1


def test_attachments_come_before_the_messages(tmp_path):
    with RecordingWriter(tmp_path / 'a.mcap') as writer:
        writer.add_topic(POINTS)
        writer.write('/points', b'x', 1)
        writer.add_metadata(EXTRAS[2])
        with pytest.raises(RecordingError, match='add attachments first'):
            writer.add_attachment(EXTRAS[0])
    with open_recording(tmp_path / 'a.mcap') as recording:
        assert list(recording.metadata()) == [EXTRAS[2]]


def test_a_refusal_tells_the_damage(tmp_path):
    path = write_mcap(tmp_path / 'a.mcap', some_messages(), topics=SMALL)
    with open_recording(path) as recording:
        assert str(recording.refusal('No clouds.')) == 'No clouds.'
    path.write_bytes(path.read_bytes()[:300])
    with open_recording(path) as recording:
        assert str(recording.refusal('No clouds.')) == f'No clouds. {recording.damage}'


def test_a_missing_part_is_named(tmp_path):
    folder = split_bag(tmp_path / 'bag', some_messages())
    (folder / 'bag_2.mcap').unlink()
    with pytest.raises(RecordingError, match=r'bag_2\.mcap does not exist'):
        open_recording(folder)


@pytest.mark.parametrize(
    ('name', 'sentence'),
    [
        ('bag_0.db3', 'is an sqlite3 bag: convert it to MCAP'),
        ('bag_0.db3.zstd', 'is an sqlite3 bag: convert it to MCAP'),
        ('bag_0.mcap.zstd', 'is not an MCAP file'),
        ('._bag_0.mcap', 'holds no recording: give a directory'),
        ('notes.txt', 'holds no recording: give a directory'),
    ],
)
def test_a_directory_without_a_readable_recording_is_refused_with_the_reason(tmp_path, name, sentence):
    (tmp_path / name).write_bytes(b'x')
    with pytest.raises(RecordingError, match=sentence):
        open_recording(tmp_path)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(RecordingError, match=r'none\.mcap does not exist: check the name'):
        open_recording(tmp_path / 'none.mcap')


@pytest.mark.skipif(os.geteuid() == 0, reason='the superuser may read everything')
def test_a_file_without_read_permission_is_refused(tmp_path):
    path = write(tmp_path / 'a.mcap', [])
    path.chmod(0)
    with pytest.raises(RecordingError, match='may not be read: change its permissions'):
        open_recording(path)


def other_type(name, kind='test_msgs/msg/Other', encoding='cdr'):
    return Topic(name, kind, b'uint8 b', 'ros2msg', encoding, {})


def test_messages_of_another_type_on_a_topic_are_kept_apart_under_a_name_of_their_own(tmp_path):
    folder, messages = tmp_path / 'bag', some_messages(4)
    folder.mkdir()
    write_mcap(folder / 'bag_0.mcap', messages, topics=SMALL)
    write_mcap(
        folder / 'bag_1.mcap', messages, topics=[other_type('/points'), other_type('/clock', encoding='json')]
    )
    with open_recording(folder) as recording:
        assert list(recording.topics) == ['/points', '/clock', '/points#2', '/clock#2']
        assert recording.topics['/points#2'] == other_type('/points')
        assert [m.topic for m in recording.messages()] == ['/points', '/points#2', '/clock', '/clock#2'] * 2
        assert [m.topic for m in recording.messages(['/points'])] == ['/points'] * 2
        with RecordingWriter(tmp_path / 'copy.mcap') as writer:
            for name, topic in recording.topics.items():
                writer.add_topic(topic, name)
            for message in recording.messages():
                writer.write(*message)
    with open_recording(tmp_path / 'copy.mcap') as copy, open_recording(folder) as recording:
        assert copy.topics.keys() == recording.topics.keys()
        assert [m.topic for m in copy.messages()] == [m.topic for m in recording.messages()]


@pytest.mark.parametrize(
    ('recorded', 'encoding', 'kind'),
    [
        ('sensor_msgs/PointCloud2', 'cdr', 'sensor_msgs/msg/PointCloud2'),
        ('sensor_msgs/msg/PointCloud2', 'cdr', 'sensor_msgs/msg/PointCloud2'),
        ('sensor_msgs/PointCloud2', 'json', 'sensor_msgs/PointCloud2'),
        ('a/srv/B', 'cdr', 'a/srv/B'),
        ('PointCloud2', 'cdr', 'PointCloud2'),
    ],
)
def test_types_have_the_names_of_ros_2(tmp_path, recorded, encoding, kind):
    topics = [other_type('/points', recorded, encoding), other_type('/clock')]
    with open_recording(write_mcap(tmp_path / 'a.mcap', some_messages(2), topics=topics)) as recording:
        assert recording.topics['/points'].type == kind


def test_a_recording_of_ros_1_is_refused(tmp_path):
    path = write_mcap(tmp_path / 'a.mcap', [], topics=[small_topic('/a', encoding='ros1')], use_chunking=False)
    with pytest.raises(RecordingError, match=r'encoding is ros1: convert it first, for ROS 1 with'):
        open_recording(path)


def test_closing_closes_the_files(tmp_path):
    recording = open_recording(split_bag(tmp_path / 'bag', some_messages()))
    recording.close()
    assert all(file._file.closed for file in recording._files)


def test_parts_are_sorted_by_their_numbers(tmp_path):
    paths = [tmp_path / f'bag_{i}.mcap' for i in (10, 9, 1)]
    assert sorted(paths, key=reader.natural_order) == paths[::-1]


@pytest.mark.parametrize('part', ['messages', 'attachments', 'metadata'])
def test_a_closed_recording_says_so_and_is_not_called_damaged(tmp_path, part):
    path = write(tmp_path / 'a.mcap', some_messages())
    with open_recording(path) as recording:
        pass
    with pytest.raises(RecordingError, match=r'a\.mcap is closed'):
        list(getattr(recording, part)())
    assert recording.damage is None


def test_a_recording_that_is_closed_while_it_is_read_says_so(tmp_path):
    messages = some_messages()
    path = write_mcap(tmp_path / 'a.mcap', messages, topics=SMALL, chunk_size=150)
    with open_recording(path) as recording:
        reading = recording.messages()
        assert next(reading) == messages[0]
    with pytest.raises(RecordingError, match=r'a\.mcap is closed'):
        list(reading)
    assert recording.damage is None
