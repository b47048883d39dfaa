# SPDX-License-Identifier: Apache-2.0
"""Recordings that are kept: on a full disk, after an error, after a kill."""

import contextlib
import errno
import itertools
import os
import random
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recording.samples import CLOCK, POINTS, read, small_topic, some_messages
from storage.disks import fill, small_disk

from socialcircle_ros.errors import RecordingError
from socialcircle_ros.recording import Message, RecordingWriter, mcap_output
from socialcircle_ros.storage import ALIGNMENT, DirectFile

Reader = pytest.importorskip('rosbags.rosbag2', reason='needs rosbags: pip install rosbags').Reader

TESTS = Path(__file__).resolve().parents[1]
TOPICS = (POINTS, CLOCK, small_topic('/größe/ж'))


@pytest.fixture(params=['a.mcap', 'bag'])
def name(request):
    return request.param


def record(path, messages, **options):
    """Write with `keep` until an error; the messages that were taken, and the error."""
    taken = []
    try:
        with RecordingWriter(path, keep=True, **options) as writer:
            for topic in TOPICS:
                writer.add_topic(topic)
            for message in messages:
                writer.write(*message)
                taken.append(message)
    except RecordingError as error:
        return taken, str(error)
    return taken, None


def endless(sizes, start=1_700_000_000_000_000_000):
    """Messages of these sizes, over and over, of bytes that do not compress."""
    rng = random.Random(0)
    number = 0
    while True:
        for topic, size in sizes:
            time = start + number * 1_000_000
            yield Message(TOPICS[topic].name, rng.randbytes(size), time, time, number)
            number += 1


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    megabytes=st.integers(2, 12),
    sizes=st.lists(
        st.tuples(st.integers(0, 2), st.one_of(st.integers(0, 5000), st.integers(0, 3_000_000))),
        min_size=1, max_size=4,
    ).filter(lambda sizes: sum(size for _, size in sizes) > 20_000),
    compression=st.sampled_from(['none', 'lz4', 'zstd']),
    name=st.sampled_from(['a.mcap', 'bag', 'split']),
)  # fmt: skip
def test_every_message_that_was_taken_before_the_disk_was_full_is_read_back(
    tmp_path_factory, megabytes, sizes, compression, name
):
    options = {'max_bytes': 1_500_000} if name == 'split' else {}
    with small_disk(tmp_path_factory.mktemp('full') / 'disk', megabytes << 20) as disk:
        fill(disk, megabytes << 20)
        path = disk / name
        taken, error = record(path, endless(sizes), compression=compression, **options)
        if not path.exists():  # the disk is smaller than the first message
            assert f'{path} cannot be written (No space left on device)' in error
            assert [entry.name for entry in disk.iterdir()] == ['ballast']
            return
        assert f'{path} has ended early, because the disk is full. It holds ' in error
        assert error.endswith('All later messages are missing.')
        messages, damage = read(path)
        # The message that used up the reserve is written, and ends the recording.
        assert messages[: len(taken)] == taken
        assert len(messages) - len(taken) in (0, 1)
        assert f'It holds {len(messages)} message' in error
        assert damage is None
        assert sorted(entry.name for entry in disk.iterdir()) == sorted(['ballast', name])


@pytest.mark.parametrize('sizes', [[(0, 3_000_000)], [(0, 2_000_001), (1, 50)], [(0, 1_500_000), (1, 300_000)]])
@pytest.mark.parametrize('name', ['a.mcap', 'bag', 'split'])
def test_a_full_disk_loses_nothing_that_went_past_the_cache(tmp_path, sizes, name, monkeypatch):
    direct = []
    write = DirectFile.write
    monkeypatch.setattr(DirectFile, 'write', lambda *given: direct.append(write(*given)) or direct[-1])
    with small_disk(tmp_path / 'disk', 60 << 20, real=True) as disk:
        options = {'max_bytes': 5_000_000} if name == 'split' else {}
        taken, error = record(disk / name, endless(sizes), direct=True, **options)
        assert f'{disk / name} has ended early, because the disk is full.' in error
        messages, damage = read(disk / name)
        assert messages[: len(taken)] == taken
        assert len(messages) - len(taken) in (0, 1)
        assert damage is None
    assert sum(direct) > 30_000_000


def test_a_file_that_cannot_be_begun_ends_the_recording_with_those_before(tmp_path, monkeypatch):
    def full(self, topics):
        if self.name.endswith('_1.mcap') and topics:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(mcap_output.McapOutput, 'expect', full)
    taken, error = record(tmp_path / 'bag', endless([(0, 300_000)]), max_bytes=500_000, direct=True)
    assert f'It holds {len(taken)} messages' in error
    assert read(tmp_path / 'bag') == (taken, None)
    assert sorted(each.name for each in (tmp_path / 'bag').iterdir()) == ['bag_0.mcap', 'metadata.yaml']
    with Reader(tmp_path / 'bag') as reader:
        assert reader.message_count == len(taken)


class Partly:
    """A file system that takes only some units past its cache."""

    units = ()

    def __init__(self, descriptor):
        self._descriptor, self._units = descriptor, list(self.units)

    def write(self, data, position):
        assert position % ALIGNMENT == 0
        size = min(self._units.pop() if self._units else 0, len(data) // ALIGNMENT) * ALIGNMENT
        assert os.pwrite(self._descriptor, data[:size], position) == size
        return size

    def flush(self):
        pass

    def close(self):
        self._units = []


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    sizes=st.lists(st.one_of(st.integers(0, 5000), st.integers(1_000_000, 1_100_000)), min_size=1, max_size=6),
    units=st.lists(st.integers(0, 300), max_size=6),
)
def test_a_recording_has_the_same_bytes_whatever_goes_past_the_cache(tmp_path, sizes, units, monkeypatch):
    monkeypatch.setattr(Partly, 'units', units)
    messages = list(itertools.islice(endless([(0, size) for size in sizes]), len(sizes)))
    written = []
    for kind, options in ((DirectFile, {}), (DirectFile, {'direct': True}), (Partly, {'direct': True})):
        monkeypatch.setattr(mcap_output, 'DirectFile', kind)
        assert record(tmp_path / 'a.mcap', messages, overwrite=True, **options) == (messages, None)
        written.append((tmp_path / 'a.mcap').read_bytes())
    assert written[1:] == written[:1] * 2


def open_below(folder):
    """The open files of this process in a folder, also those that were deleted."""
    links = []
    for each in Path('/proc/self/fd').iterdir():
        with contextlib.suppress(OSError):  # another thread has closed it
            links.append(str(each.readlink()))
    return [link for link in links if link.startswith(str(folder))]


def test_no_descriptor_of_a_recording_stays_open(tmp_path, name):
    with (tmp_path / 'open').open('w'):
        assert open_below(tmp_path) == [str(tmp_path / 'open')]
    for options in ({}, {'max_bytes': 1_500_000} if name == 'bag' else {}):
        messages = list(itertools.islice(endless([(0, 1_200_000)]), 4))
        assert record(tmp_path / name, messages, direct=True, overwrite=True, **options) == (messages, None)
    with pytest.raises(KeyboardInterrupt), RecordingWriter(tmp_path / f'b{name}', direct=True) as writer:
        writer.add_topic(POINTS)
        raise KeyboardInterrupt
    assert open_below(tmp_path) == []


def test_the_recording_on_a_full_disk_is_one_of_rosbag2(tmp_path):
    with small_disk(tmp_path / 'disk', 8 << 20) as disk:
        taken, _ = record(disk / 'bag', endless([(0, 100_000)]), max_bytes=2_000_000)
        with Reader(disk / 'bag') as reader:
            found = [bytes(data) for _, _, data in reader.messages()]
        assert found[: len(taken)] == [message.data for message in taken]


def test_a_topic_that_comes_when_the_disk_is_full_ends_the_recording(tmp_path):
    with small_disk(tmp_path / 'disk', 4 << 20) as disk:
        with (
            pytest.raises(RecordingError, match='the disk is full'),
            RecordingWriter(disk / 'a.mcap', keep=True) as writer,
        ):
            writer.add_topic(POINTS)
            writer.write('/points', b'1', 1)
            fill(disk)
            for number in range(10_000):
                writer.add_topic(small_topic(f'/topic{number}'))
        assert read(disk / 'a.mcap') == ([Message('/points', b'1', 1, 1, 0)], None)


def test_a_disk_that_is_full_at_the_start_leaves_nothing(tmp_path, name):
    with small_disk(tmp_path / 'disk', 4 << 20) as disk:
        fill(disk)
        with pytest.raises(RecordingError, match=r'cannot be written \(No space left on device\)'):
            RecordingWriter(disk / name, keep=True)
        assert [entry.name for entry in disk.iterdir()] == ['ballast']


@pytest.mark.parametrize('error', [ValueError, KeyboardInterrupt])
def test_an_error_keeps_what_was_written(tmp_path, name, error):
    with pytest.raises(error), RecordingWriter(tmp_path / name, keep=True) as writer:
        for topic in TOPICS:
            writer.add_topic(topic)
        for message in some_messages(7):
            writer.write(*message)
        raise error
    assert read(tmp_path / name) == (some_messages(7), None)
    assert [entry.name for entry in tmp_path.iterdir()] == [name]


def test_an_error_before_the_first_message_leaves_nothing(tmp_path, name):
    with pytest.raises(ValueError, match='early'), RecordingWriter(tmp_path / name, keep=True) as writer:
        writer.add_topic(POINTS)
        raise ValueError('early')
    assert list(tmp_path.iterdir()) == []


def test_a_message_that_is_torn_by_an_error_is_left_out(tmp_path, name, monkeypatch):
    written = endless([(0, 300_000)])
    taken = []
    told = 'a message was interrupted while it was written. It holds 6 messages'
    with pytest.raises(RecordingError, match=told), RecordingWriter(tmp_path / name, keep=True) as writer:
        writer.add_topic(POINTS)
        for message in (next(written) for _ in range(7)):
            writer.write(*message)
            taken.append(message)
        monkeypatch.setattr(writer._file._writer, 'add_message', lambda *_: (_ for _ in ()).throw(MemoryError))
        writer.write(*message)
    messages, damage = read(tmp_path / name)
    assert messages == taken[:6]  # two chunks of three; the last message was in memory
    assert damage is not None


FULL_FILES = """
    import resource
    from pathlib import Path
    from recording.samples import POINTS, read
    from recording.test_mcap_output import endless, record
    resource.setrlimit(resource.RLIMIT_FSIZE, (3_000_000, resource.RLIM_INFINITY))
    taken, error = record(Path({name!r}), endless([(0, 100_000)]), compression={compression!r})
    messages, damage = read(Path({name!r}))
    assert messages == taken[: len(messages)], 'order'
    assert len(taken) - 9 < len(messages) <= len(taken), (len(taken), len(messages))
    assert damage, 'no damage'
    print(error)
    """


@pytest.mark.parametrize('compression', ['none', 'lz4'])
def test_a_disk_that_refuses_to_write_keeps_the_chunks_before(tmp_path, name, compression):
    program = textwrap.dedent(FULL_FILES.format(name=str(tmp_path / name), compression=compression))
    done = subprocess.run([sys.executable, '-c', program], cwd=TESTS, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert 'has ended early, because File too large. It holds ' in done.stdout
    assert 'All later messages are missing, and so are the index and ' in done.stdout
    assert [entry.name for entry in tmp_path.iterdir()] == [name]


KILLED = """
    import os, signal
    from pathlib import Path
    from recording.samples import POINTS
    from recording.test_mcap_output import endless
    from socialcircle_ros.recording import RecordingWriter
    writer = RecordingWriter(Path({name!r}), keep=True)
    writer.add_topic(POINTS)
    for message, _ in zip(endless([(0, 300_000)]), range(7)):
        writer.write(*message)
    os.kill(os.getpid(), signal.SIGKILL)
    """


@pytest.mark.parametrize('next_name', ['record', 'filter'])
def test_the_recording_of_a_killed_process_is_kept_and_can_be_read(tmp_path, name, caplog, next_name):
    program = textwrap.dedent(KILLED.format(name=str(tmp_path / name)))
    done = subprocess.run([sys.executable, '-c', program], cwd=TESTS, check=False)
    assert done.returncode == -signal.SIGKILL
    with RecordingWriter(tmp_path / name, keep=next_name == 'record'):
        pass
    kept = tmp_path / ('a_unfinished.mcap' if name == 'a.mcap' else 'bag_unfinished')
    assert f'it is kept as {kept}' in caplog.text
    messages, damage = read(kept)
    assert len(messages) == 6
    assert damage is not None


def test_a_name_that_another_program_took_meanwhile_is_left_to_it(tmp_path, name):
    told = r'has been made by another program meanwhile: the recording is .*_2'
    with pytest.raises(RecordingError, match=told), RecordingWriter(tmp_path / name, keep=True) as writer:
        writer.add_topic(POINTS)
        writer.write('/points', b'mine', 1)
        with RecordingWriter(tmp_path / name) as other:
            other.add_topic(POINTS)
            other.write('/points', b'theirs', 1)
    second = tmp_path / ('a_2.mcap' if name == 'a.mcap' else 'bag_2')
    assert [read(path)[0][0].data for path in (tmp_path / name, second)] == [b'theirs', b'mine']


def test_a_name_that_was_taken_meanwhile_is_not_replaced_without_keep(tmp_path, name):
    told = 'has been made by another program meanwhile: give another name'
    first, other = RecordingWriter(tmp_path / name), RecordingWriter(tmp_path / name)
    with pytest.raises(RecordingError, match=told), first, other:
        other.add_topic(POINTS)
        other.write('/points', b'theirs', 1)
    assert read(tmp_path / name)[0][0].data == b'theirs'
    assert [entry.name for entry in tmp_path.iterdir()] == [name]
