import os

import pytest
from hypothesis import given
from hypothesis import strategies as st
from recording.samples import CLOCK, POINTS, SMALL, read, small_topic, some_messages, write, write_mcap

from socialcircle_ros.errors import RecordingError
from socialcircle_ros.recording import Message, open_recording, reader

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


def test_a_missing_part_is_named(tmp_path):
    folder = split_bag(tmp_path / 'bag', some_messages())
    (folder / 'bag_2.mcap').unlink()
    with pytest.raises(RecordingError, match=r'bag_2\.mcap does not exist'):
        open_recording(folder)


@pytest.mark.parametrize(
    ('name', 'sentence'),
    [
        ('bag_0.db3', 'is an sqlite3 bag: convert it to MCAP'),
        ('bag_0.mcap.zstd', 'is compressed file by file'),
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


def test_two_types_on_one_topic_are_refused(tmp_path):
    folder = tmp_path / 'bag'
    folder.mkdir()
    write_mcap(folder / 'bag_0.mcap', some_messages(2), topics=SMALL)
    write_mcap(folder / 'bag_1.mcap', some_messages(2), topics=(POINTS, CLOCK))
    with pytest.raises(RecordingError, match=r'two types, .* on /points'):
        open_recording(folder)


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
