# SPDX-License-Identifier: Apache-2.0
import errno
import itertools
import os
from importlib.metadata import version

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from recording.samples import CLOCK, POINTS, read, small_topic, some_messages, write

from socialcircle_ros.errors import RecordingError, SettingError
from socialcircle_ros.recording import Message, RecordingWriter, open_recording, ros_topic, type_hash
from socialcircle_ros.recording.topics import Attachment, MetadataRecord

AnyReader = pytest.importorskip('rosbags.highlevel', reason='needs rosbags: pip install rosbags').AnyReader
Reader = pytest.importorskip('rosbags.rosbag2', reason='needs rosbags: pip install rosbags').Reader

IMAGE = ros_topic('/image', 'sensor_msgs/msg/Image')
OLD_QOS = """\
- history: 3
  depth: 0
  reliability: 1
  durability: 2
  deadline: {sec: 9223372036, nsec: 854775807}
  lifespan: {sec: 9223372036, nsec: 854775807}
  liveliness: 1
  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}
  avoid_ros_namespace_conventions: false"""

nanoseconds = st.integers(0, 2**63 - 1)
any_messages = st.lists(
    st.builds(
        Message,
        topic=st.sampled_from(['/points', '/clock', '/größe/ж']),
        data=st.binary(max_size=300),
        log_time=nanoseconds,
        publish_time=nanoseconds,
        sequence=st.integers(0, 2**32 - 1),
    ),
    max_size=30,
)


@pytest.fixture(params=['a.mcap', 'bag'])
def target(request, tmp_path):
    return tmp_path / request.param


@settings(max_examples=60, deadline=None)
@given(
    messages=any_messages,
    compression=st.sampled_from(['none', 'lz4', 'zstd']),
    name=st.sampled_from(['a.mcap', 'bag']),
)
def test_written_messages_are_read_back(messages, compression, name, tmp_path_factory):
    topics = (POINTS, CLOCK, small_topic('/größe/ж'))
    path = tmp_path_factory.mktemp('round') / name
    write(path, messages, topics, compression=compression)
    assert read(path) == (sorted(messages, key=lambda message: message.log_time), None)
    with open_recording(path) as reader:
        if messages:
            first = min(i for i, topic in enumerate(topics) if any(m.topic == topic.name for m in messages))
            assert reader.topics[topics[first].name] == topics[first]


def test_topics_and_messages_of_another_recording_are_copied_byte_for_byte(target, tmp_path):
    source = write(tmp_path / 'source.mcap', some_messages(), compression='zstd')
    with open_recording(source) as reader, RecordingWriter(target, source=source) as writer:
        for topic in reader.topics.values():
            writer.add_topic(topic)
        for message in reader.messages():
            writer.write(*message)
    with open_recording(source) as before, open_recording(target) as after:
        assert after.topics == before.topics
        assert list(after.messages()) == list(before.messages())


def test_rosbags_reads_a_directory_with_its_metadata(tmp_path):
    messages = some_messages()
    with Reader(write(tmp_path / 'bag', messages, (POINTS, CLOCK, IMAGE))) as reader:
        assert reader.ros_distro == 'jazzy'
        assert reader.message_count == 40
        assert (reader.start_time, reader.duration) == (1000, 391)
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
        assert counts == {'/points': 20, '/clock': 20, '/image': 0}
        assert {connection.digest for connection in reader.connections} == {
            POINTS.type_hash,
            CLOCK.type_hash,
            IMAGE.type_hash,
        }
        (qos,) = reader.connections[0].ext.offered_qos_profiles
        assert (qos.history.name, qos.depth, qos.reliability.name) == ('KEEP_LAST', 1, 'RELIABLE')
        found = [(connection.topic, bytes(data), time) for connection, time, data in reader.messages()]
    assert found == [(message.topic, message.data, message.log_time) for message in messages]


@pytest.mark.skipif(version('rosbags') < '0.11', reason='rosbags reads directories only before 0.11')
@pytest.mark.parametrize('compression', ['none', 'lz4', 'zstd'])
def test_rosbags_reads_a_file(tmp_path, compression):
    path = write(tmp_path / 'a.mcap', some_messages(), compression=compression)
    with AnyReader([path]) as reader:
        assert {topic: info.msgtype for topic, info in reader.topics.items()} == {
            '/points': 'sensor_msgs/msg/PointCloud2',
            '/clock': 'rosgraph_msgs/msg/Clock',
        }
        assert sum(1 for _ in reader.messages()) == 40


def test_metadata_has_the_keys_of_rosbag2_in_jazzy(tmp_path):
    bag = write(tmp_path / 'bag', some_messages())
    content = yaml.safe_load((bag / 'metadata.yaml').read_text())
    information = content['rosbag2_bagfile_information']
    assert list(content) == ['rosbag2_bagfile_information']
    assert list(information) == [
        'version',
        'storage_identifier',
        'duration',
        'starting_time',
        'message_count',
        'topics_with_message_count',
        'compression_format',
        'compression_mode',
        'relative_file_paths',
        'files',
        'custom_data',
        'ros_distro',
    ]
    assert (information['version'], information['storage_identifier']) == (9, 'mcap')
    topic = information['topics_with_message_count'][0]
    assert list(topic) == ['topic_metadata', 'message_count']
    assert topic['topic_metadata']['type_description_hash'] == type_hash(POINTS.type)
    assert topic['topic_metadata']['offered_qos_profiles'][0]['durability'] == 'volatile'
    assert information['files'] == [
        {
            'path': 'bag_0.mcap',
            'starting_time': {'nanoseconds_since_epoch': 1000},
            'duration': {'nanoseconds': 390},
            'message_count': 40,
        }
    ]
    assert sorted(path.name for path in bag.iterdir()) == ['bag_0.mcap', 'metadata.yaml']


def test_the_numbers_of_an_older_rosbag2_s_qos_become_words(tmp_path):
    topic = small_topic('/a')
    old = type(topic)(**{**vars(topic), 'metadata': {'offered_qos_profiles': OLD_QOS}})
    bag = write(tmp_path / 'bag', [Message('/a', b'', 1, 1, 0)], [old])
    with open_recording(bag) as reader:
        (profile,) = yaml.safe_load(reader.topics['/a'].qos)
    assert [profile[key] for key in ('history', 'depth', 'reliability', 'durability', 'liveliness')] == [
        'unknown',
        0,
        'reliable',
        'volatile',
        'automatic',
    ]
    information = yaml.safe_load((bag / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
    assert information['topics_with_message_count'][0]['topic_metadata']['offered_qos_profiles'] == [profile]


BOMB = '- &a0 {history: 1}\n' + ''.join(f'- &a{i} [{f"*a{i - 1}, " * 9}]\n' for i in range(1, 12))


@pytest.mark.parametrize('qos', ['[: ??', BOMB, '[' * 5000], ids=['not YAML', 'aliases', 'deep'])
def test_invalid_qos_is_kept_as_it_is(tmp_path, qos):
    topic = small_topic('/a')
    odd = type(topic)(**{**vars(topic), 'metadata': {'offered_qos_profiles': qos}})
    path = write(tmp_path / 'a.mcap', [Message('/a', b'', 1, 1, 0)], [odd])
    with open_recording(path) as reader:
        assert reader.topics == {'/a': odd}


def test_a_recording_without_messages_keeps_its_topics(target):
    write(target, [])
    with open_recording(target) as reader:
        assert reader.topics == {'/points': POINTS, '/clock': CLOCK}
        assert list(reader.messages()) == []
        assert reader.damage is None


def test_a_topic_may_come_after_the_first_messages(target):
    messages = some_messages()
    with RecordingWriter(target) as writer:
        writer.add_topic(POINTS)
        writer.write(*messages[0])
        writer.add_topic(CLOCK)
        writer.add_topic(POINTS)
        writer.write(*messages[1])
    assert read(target) == (messages[:2], None)


def test_buffers_other_than_bytes_are_stored_as_they_are(tmp_path):
    with RecordingWriter(tmp_path / 'a.mcap') as writer:
        writer.add_topic(POINTS)
        writer.write('/points', bytearray(b'one'), 1)
        writer.write('/points', memoryview(b'two'), 2)
    messages, _ = read(tmp_path / 'a.mcap')
    assert messages == [Message('/points', b'one', 1, 1, 0), Message('/points', b'two', 2, 2, 0)]


def test_an_unfinished_recording_has_another_name(target):
    with RecordingWriter(target) as writer:
        writer.add_topic(POINTS)
        assert not target.exists()
        assert [path.suffix for path in target.parent.iterdir()] == ['.partial']
    assert list(target.parent.iterdir()) == [target]


@pytest.mark.parametrize('error', [KeyboardInterrupt, ValueError])
def test_an_error_or_ctrl_c_leaves_nothing_behind(target, error):
    def interrupted():
        yield from some_messages(4)
        raise error

    with pytest.raises(error):
        write(target, interrupted())
    assert list(target.parent.iterdir()) == []


def test_an_error_keeps_the_recording_that_was_to_be_replaced(target):
    write(target, some_messages(4))
    with pytest.raises(KeyboardInterrupt), RecordingWriter(target, overwrite=True):
        raise KeyboardInterrupt
    assert read(target) == (some_messages(4), None)


def test_an_existing_recording_is_only_overwritten_on_request(target):
    write(target, some_messages(4))
    with pytest.raises(RecordingError, match=r'exists already: give another name, or overwrite it'):
        RecordingWriter(target)
    write(target, some_messages(6), overwrite=True)
    assert read(target) == (some_messages(6), None)
    assert list(target.parent.iterdir()) == [target]


def test_other_files_and_folders_are_never_overwritten(tmp_path):
    folder = tmp_path / 'thesis'
    folder.mkdir()
    (folder / 'thesis.tex').write_text('...')
    (folder / 'notes').write_text('...')
    for path, overwrite in itertools.product((folder, folder / 'notes'), (True, False)):
        with pytest.raises(RecordingError, match='is not a recording, and is not overwritten'):
            RecordingWriter(path, overwrite=overwrite)
    with pytest.raises(RecordingError, match=r'because it ends in \.tex'):
        RecordingWriter(folder / 'thesis.tex', overwrite=True)
    (tmp_path / 'a.mcap').mkdir()
    with pytest.raises(RecordingError, match='is not a recording'):
        RecordingWriter(tmp_path / 'a.mcap', overwrite=True)


def test_the_recording_that_is_read_is_not_written_into(target):
    source = write(target, some_messages(4))
    inner = source / 'bag_0.mcap' if source.is_dir() else source
    for path, read_from in [(source, source), (inner, source), (source, inner)]:
        with pytest.raises(RecordingError, match='would be written into the recording that is read'):
            RecordingWriter(path, overwrite=True, source=read_from)


def test_a_missing_directory_is_named(tmp_path):
    with pytest.raises(RecordingError, match=r'none/a\.mcap cannot be written: make the directory .*none first'):
        RecordingWriter(tmp_path / 'none' / 'a.mcap')


@pytest.mark.skipif(os.geteuid() == 0, reason='the superuser may write everywhere')
def test_a_directory_without_write_permission_is_reported(target):
    target.parent.chmod(0o500)
    with pytest.raises(RecordingError, match='cannot be written'):
        RecordingWriter(target)


def test_a_full_disk_is_reported_and_leaves_nothing_behind(target, monkeypatch):
    writer = RecordingWriter(target)
    writer.add_topic(POINTS)

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(writer._file._writer, 'add_message', full)
    with pytest.raises(RecordingError, match=r'cannot be written \(No space left on device\)'), writer:
        writer.write('/points', b'x', 1)
    assert list(target.parent.iterdir()) == []


def test_a_disk_that_is_full_at_the_end_is_reported_and_leaves_nothing_behind(target, monkeypatch):
    writer = RecordingWriter(target)
    writer.add_topic(POINTS)
    writer.write('/points', b'x', 1)

    def full():
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(writer._file._writer, 'finish', full)
    with pytest.raises(RecordingError, match='check the space'):
        writer.close()
    assert list(target.parent.iterdir()) == []


@pytest.mark.parametrize(
    ('message', 'sentence'),
    [
        (('/none', b'', 1, 1, 0), r'has no topic /none: add the topic'),
        (('/points', b'', -1, 1, 0), r'cannot hold the times -1 and 1'),
        (('/points', b'', 1, 2**63, 0), r'cannot hold the times'),
        (('/points', b'', 1, 1, 2**32), r'cannot hold the sequence number'),
    ],
)
def test_a_message_that_is_out_of_range_is_refused(tmp_path, message, sentence):
    with RecordingWriter(tmp_path / 'a.mcap') as writer:
        writer.add_topic(POINTS)
        with pytest.raises(RecordingError, match=sentence):
            writer.write(*message)


def test_two_topics_of_one_name_are_refused(tmp_path):
    with RecordingWriter(tmp_path / 'a.mcap') as writer:
        writer.add_topic(POINTS)
        with pytest.raises(RecordingError, match=r'two different topics named /points'):
            writer.add_topic(small_topic('/points'))


def test_a_split_recording_lists_its_files(tmp_path):
    messages = some_messages(40)
    with RecordingWriter(tmp_path / 'bag', max_duration_s=100e-9) as writer:
        for topic in (POINTS, CLOCK, IMAGE):
            writer.add_topic(topic)
        for message in messages:
            writer.write(*message)
    information = yaml.safe_load((tmp_path / 'bag' / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
    assert information['relative_file_paths'] == [f'bag_{number}.mcap' for number in range(4)]
    assert [file['message_count'] for file in information['files']] == [10] * 4
    assert [file['starting_time']['nanoseconds_since_epoch'] for file in information['files']] == [
        1000, 1100, 1200, 1300,
    ]  # fmt: skip
    assert information['message_count'] == 40
    assert read(tmp_path / 'bag') == (messages, None)
    with Reader(tmp_path / 'bag') as reader:
        assert [bytes(data) for _, _, data in reader.messages()] == [message.data for message in messages]
    for number in range(4):
        with open_recording(tmp_path / 'bag' / f'bag_{number}.mcap') as part:
            assert list(part.messages()) == messages[10 * number : 10 * number + 10]
            assert part.damage is None


def test_a_file_is_split_when_it_has_its_size(tmp_path):
    messages = some_messages(30, size=300_000)
    write(tmp_path / 'bag', messages, max_bytes=1_000_000)
    files = sorted((tmp_path / 'bag').glob('*.mcap'), key=lambda path: int(path.stem.removeprefix('bag_')))
    assert [path.name for path in files] == [f'bag_{number}.mcap' for number in range(8)]
    assert all(1_000_000 < path.stat().st_size < 1_300_000 for path in files[:-1])
    assert read(tmp_path / 'bag') == (messages, None)


def test_topics_of_a_split_recording_are_in_each_file(tmp_path):
    messages = [Message('/points', b'', time, time, 0) for time in range(1, 10)]
    write(tmp_path / 'bag', messages, (POINTS, CLOCK, IMAGE), max_duration_s=3e-9)
    for path in (tmp_path / 'bag').glob('*.mcap'):
        with open_recording(path) as part:
            assert part.topics == {'/points': POINTS, '/clock': CLOCK, '/image': IMAGE}


def test_one_file_cannot_be_split(tmp_path):
    with pytest.raises(RecordingError, match=r'is one file and cannot be split: give a name without \.mcap'):
        RecordingWriter(tmp_path / 'a.mcap', max_bytes=1000)
    assert list(tmp_path.iterdir()) == []


def test_nothing_can_be_written_after_the_end(target):
    with RecordingWriter(target) as writer:
        writer.add_topic(POINTS)
    with pytest.raises(RecordingError, match='is closed'):
        writer.write('/points', b'', 1)


def test_links_devices_and_pipes_are_never_overwritten(tmp_path):
    write(tmp_path / 'true.mcap', some_messages(4))
    (tmp_path / 'link.mcap').symlink_to('true.mcap')
    (tmp_path / 'dangling.mcap').symlink_to('nowhere')
    os.mkfifo(tmp_path / 'pipe.mcap')
    write(tmp_path / 'true', some_messages(4))
    (tmp_path / 'link').symlink_to('true')
    for name, kind in [('link.mcap', 'a symbolic link'), ('dangling.mcap', 'a symbolic link'),
                       ('pipe.mcap', 'a named pipe'), ('link', 'a symbolic link')]:  # fmt: skip
        with pytest.raises(RecordingError, match=f'{name} is {kind}, and is not overwritten'):
            RecordingWriter(tmp_path / name, overwrite=True)
    assert read(tmp_path / 'true.mcap') == read(tmp_path / 'true') == (some_messages(4), None)


def test_what_a_recording_holds_names_a_date_only_where_its_times_are_dates(tmp_path):
    for name, time, told in (
        ('counted', 12_500_000_000, 'It holds 1 message, the last of the time 12.500000000 s.'),
        ('dated', 1_790_000_000_000_000_000, 'It holds 1 message, the last of 2026-09-'),
    ):
        with RecordingWriter(tmp_path / f'{name}.mcap') as writer:
            writer.add_topic(IMAGE)
            writer.write(IMAGE.name, b'', time)
            assert writer.contents().startswith(told)


@pytest.mark.parametrize(
    'add',
    [
        lambda writer: writer.add_topic(POINTS),
        lambda writer: writer.add_attachment(Attachment('a', '', b'', 0, 0)),
        lambda writer: writer.add_metadata(MetadataRecord('a', {})),
        lambda writer: writer.write('/points', b'', 0),
    ],
)
def test_nothing_is_added_to_a_recording_that_is_closed(tmp_path, add):
    with RecordingWriter(tmp_path / 'a.mcap') as writer:
        pass
    before = (tmp_path / 'a.mcap').read_bytes()
    with pytest.raises(RecordingError, match='is closed: nothing can be written any more'):
        add(writer)
    assert (tmp_path / 'a.mcap').read_bytes() == before


def test_another_compression_is_refused(tmp_path):
    with pytest.raises(SettingError, match="compression cannot be 'gzip'; use one of: none, lz4, zstd"):
        RecordingWriter(tmp_path / 'a.mcap', compression='gzip')
    assert not list(tmp_path.iterdir())
