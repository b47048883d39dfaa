# SPDX-License-Identifier: Apache-2.0
"""The commands that use the graph: play, record, demo, node."""

import contextlib
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='live tests need ROS 2')

from examples import cloud
from storage.disks import small_disk

from socialcircle_ros.messages.image import TYPE as IMAGE
from socialcircle_ros.messages.point_cloud import TYPE as CLOUD
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.recording import RecordingWriter, open_recording, ros_topic

pytestmark = pytest.mark.live

BAGS = Path(__file__).resolve().parents[2] / 'bags'


@contextlib.contextmanager
def started(tmp_path, *arguments):
    """A command in the background, ended with Ctrl-C."""
    command = [sys.executable, '-m', 'socialcircle_ros.commands.main', *map(str, arguments)]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        process.output = process.communicate(timeout=300)


def test_the_messages_of_the_first_seconds_can_be_left_out(run):
    _, messages = contents(BAGS / 'parts.mcap')
    times = sorted(message.log_time for message in messages)
    offset = (times[len(times) // 2] - times[0]) / 1e9
    wanted = sum(time >= times[len(times) // 2] for time in times)
    assert 0 < wanted < len(times)
    done = run('play', BAGS / 'parts.mcap', '-r', '50', '--start-offset', offset, '--wait', '0')
    assert f'{wanted} messages played' in done.out


def contents(path):
    with open_recording(path) as reader:
        return dict(reader.topics), list(reader.messages())


def test_a_played_recording_is_recorded_byte_for_byte(run, tmp_path):
    with started(tmp_path, 'record', '/round/points', '/round/truth/outlier_mask', '-o', 'again.mcap') as recorder:
        done = run('play', BAGS / 'parts.mcap', '--namespace', '/round', '--rate', '4', '--wait', '60')
        assert done.code == 0, done.err
        assert '16 messages played' in done.out
    out, err = recorder.output
    assert recorder.returncode == 0, err
    assert '16 messages written to again.mcap' in out
    topics, messages = contents(tmp_path / 'again.mcap')
    _, played = contents(BAGS / 'parts.mcap')
    assert topics['/round/points'].type_hash == ros_topic('/points', CLOUD).type_hash
    for name in ('/points', '/truth/outlier_mask'):
        assert [m.data for m in messages if m.topic == f'/round{name}'] == [
            m.data for m in played if m.topic == name
        ]


def test_a_recording_of_one_cell_is_played_into_another(run, tmp_path):
    with RecordingWriter(tmp_path / 'night.mcap') as writer:
        for name in ('/cell1/points', '/cell1/outlier_mask'):
            writer.add_topic(ros_topic(name, CLOUD))
            writer.write(name, cloud(9, 9), 1)
    with started(tmp_path, 'record', '/cell2/points', '/other/cell1/points', '-o', 'again.mcap') as recorder:
        done = run('play', 'night.mcap', '--namespace', '/cell2', '--topic', '/cell1/points', '--wait', '60')
        assert done.code == 0, done.err
        done = run('play', 'night.mcap', '--prefix', '/other', '--topic', '/cell1/points', '--wait', '60')
        assert done.code == 0, done.err
    assert recorder.returncode == 0, recorder.output
    _, messages = contents(tmp_path / 'again.mcap')
    assert [message.topic for message in messages] == ['/cell2/points', '/other/cell1/points']


def test_recorded_timing_is_kept_and_the_clock_follows(run, tmp_path):
    with RecordingWriter(tmp_path / 'two.mcap') as writer:
        writer.add_topic(ros_topic('/clocked/points', CLOUD))
        for stamp in (10_000_000_000, 12_000_000_000):
            writer.write('/clocked/points', cloud(9, 9, stamp=stamp), stamp)
    with started(tmp_path, 'record', '/clocked/points', '/clock', '-o', 'again.mcap') as recorder:
        done = run('play', 'two.mcap', '--clock', '--wait', '60')
        assert done.code == 0, done.err
    assert recorder.returncode == 0, recorder.output
    topics, messages = contents(tmp_path / 'again.mcap')
    # A recorder that waits for a core receives late, and the first message may go late, but none goes too early.
    first, second = (m.publish_time for m in messages if m.topic == '/clocked/points')
    assert second - first > 0.5e9
    ticks = [m for m in messages if m.topic == '/clock']
    assert topics['/clock'].type == 'rosgraph_msgs/msg/Clock'
    assert len(ticks) > 5


@pytest.mark.parametrize('ending', [signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize('name', ['night.mcap', 'night'])
def test_a_recording_that_a_signal_ends_holds_all_messages_before(run, tmp_path, ending, name):
    with started(tmp_path, 'record', '/ended/points', '-o', name) as recorder:
        done = run('play', BAGS / 'parts.mcap', '--namespace', '/ended', '--rate', '8', '--wait', '60')
        assert done.code == 0, done.err
        recorder.send_signal(ending)
        recorder.wait(60)
    out, err = recorder.output
    assert recorder.returncode == 128 + ending
    assert f'Ended by {ending.name}; all later messages are missing.' in err
    place = name if name.endswith('.mcap') else f'the directory {name}'
    assert f'8 messages written to {place}.' in out
    with open_recording(tmp_path / name) as reader:
        assert len(list(reader.messages())) == 8
        assert reader.damage is None
    assert [path.name for path in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize('options', [('night.mcap',), ('night', '--max-bag-size', '1M')])
def test_a_full_disk_ends_a_recording_that_can_be_read(tmp_path, options):
    with small_disk(tmp_path / 'disk', 6 << 20) as disk:
        name, *more = options
        played = ['play', BAGS / 'parts.mcap', '--loop', '--namespace', '/full', '--rate', '20', '--wait', '60']
        recorded = ['record', '/full/points', '-o', disk / name, *more]
        with started(tmp_path, *recorded) as recorder, started(tmp_path, *played):
            recorder.wait(60)
        err = recorder.output[1]
        assert recorder.returncode == 1, err
        assert f'{disk} has only ' in err
        assert f'Error: {disk / name} has ended early, because the disk is full. It holds ' in err
        assert 'Traceback' not in err
        with open_recording(disk / name) as reader:
            messages = list(reader.messages())
            assert len(messages) > 8
            assert f'It holds {len(messages)} messages, the last of ' in err
            assert reader.damage is None
        assert [path.name for path in disk.iterdir()] == [name]


def test_the_recording_of_a_killed_recorder_gets_a_name_from_the_next(run, tmp_path):
    with started(tmp_path, 'record', '/killed/points', '-o', 'night.mcap') as recorder:
        done = run('play', BAGS / 'parts.mcap', '--namespace', '/killed', '--rate', '8', '--wait', '60')
        assert done.code == 0, done.err
        recorder.kill()
        recorder.wait()
    done = run('record', '/killed/points', '-o', 'night.mcap', '--duration', '0.1')
    assert done.code == 0, done.err
    assert 'was left by a process that was killed; it is kept as ' in done.err
    with open_recording(tmp_path / 'night_unfinished.mcap') as reader:
        assert 5 <= len(list(reader.messages())) <= 8
        assert 'damaged' in reader.damage
    assert sorted(path.name for path in tmp_path.iterdir()) == ['night.mcap', 'night_unfinished.mcap']


@pytest.mark.parametrize(
    ('arguments', 'code', 'sentence'),
    [
        (['record', '-o', 'x.mcap', '--max-bag-size', '1G'], 2, 'x.mcap is one file and cannot be split'),
        (['record', '-o', 'x', '--min-free', 'much'], 2, "'much' is no size; give bytes"),
        (['play', 'nowhere.mcap'], 1, 'nowhere.mcap'),
        (['play', BAGS / 'parts.mcap', '--rate', '0'], 2, '0.0 is not in the range x>0'),
        (['play', BAGS / 'parts.mcap', '--rate', 'inf'], 2, 'inf is no number up to 1e+12'),
        (['play', BAGS / 'parts.mcap', '--wait', 'nan'], 2, 'nan is no number up to 1e+12'),
        (['play', BAGS / 'parts.mcap', '-p'], 2, 'needs a terminal'),
        (['play', BAGS / 'parts.mcap', '/points'], 2, "'/points' is not for this command: topics follow --topics"),
        (['play', BAGS / 'parts.mcap', '--start-offset', '1e6'], 1, 'no message to play after the first 1e+06 s'),
        (['record', '-e', '(', '-o', 'a.mcap'], 2, "'(' is no regular expression"),
        (['play', BAGS / 'parts.mcap', '--topic', '/nowhere'], 1, 'has no topic /nowhere'),
        (['play', BAGS / 'parts.mcap', '--namespace', 'bad x'], 2, "'bad x' is not a valid namespace"),
        (['play', BAGS / 'parts.mcap', '--namespace', '1st'], 2, 'no digit at the start'),
        (['play', BAGS / 'parts.mcap', '--namespace', '/a', '--prefix', '/b'], 2, 'cannot be given with --prefix'),
        (['record', '-o', 'no/folder/x.mcap'], 1, 'no/folder'),
        (['demo', 'nowhere.npz'], 1, 'nowhere.npz does not exist'),
        (['demo', 'nowhere.mcap'], 1, 'nowhere.mcap'),
        (['demo', '-o', '/proc/demo'], 1, '/proc/demo cannot be written'),
        (['tune', 'nowhere.mcap'], 1, 'nowhere.mcap'),
        (['tune', 'cell1'], 1, 'cell1 does not exist; if it is the namespace of a cell, write /cell1.'),
        (['tune', BAGS / 'stack.yaml'], 1, 'stack.yaml'),
        (['node', '--ros-args', '-p', 'circle.window:=4'], 1, 'circle.window'),
        (['node', 'circle.window:=5'], 2, 'arguments for ROS follow --ros-args'),
        (['node', '--ros-args', '--params-file', 'nowhere.yaml'], 1, 'nowhere.yaml cannot be read: No such file'),
        (['node', '--ros-args', '--params-file', 'notes.txt'], 1, 'notes.txt holds no parameters'),
    ],
)
def test_an_error_is_one_sentence(run, tmp_path, arguments, code, sentence):
    (tmp_path / 'notes.txt').write_text('Remember the milk.\n')
    done = run(*arguments)
    assert done.code == code, done.err
    assert sentence in done.err
    assert 'Traceback' not in done.err


def test_where_no_log_can_be_written_a_sentence_names_the_cure(run, tmp_path):
    (tmp_path / 'file').touch()
    for arguments in (['play', BAGS / 'parts.mcap', '--wait', '0'], ['record', '-o', 'a.mcap', '--duration', '0']):
        done = run(*arguments, env={**os.environ, 'ROS_LOG_DIR': str(tmp_path / 'file' / 'log')})
        assert done.code == 1
        assert 'Set ROS_LOG_DIR to a folder that can be written.' in done.err
        assert 'Traceback' not in done.err


def test_a_topic_whose_type_is_not_installed_is_skipped_and_reported(run, tmp_path):
    from socialcircle_ros.recording import Topic

    odd = Topic('/odd', 'odd_msgs/msg/Odd', b'string text\n', 'ros2msg', 'cdr', {})
    with RecordingWriter(tmp_path / 'odd.mcap') as writer:
        writer.add_topic(odd)
        writer.add_topic(ros_topic('/odd/mask', IMAGE))
        writer.write('/odd', b'\0\1\0\0', 1)
        writer.write('/odd/mask', b'\0\1\0\0', 2)
    done = run('play', 'odd.mcap', '--wait', '0')
    assert done.code == 0, done.err
    assert "Not played: /odd: Type 'odd_msgs/msg/Odd' is not installed here" in done.err
    assert 'No node subscribes to /odd/mask' in done.err
    assert '1 message played' in done.out


def test_a_topic_without_messages_is_reported(run):
    done = run('record', '/nowhere', '-o', 'x.mcap', '--duration', '0.5')
    assert done.code == 0
    assert 'No message came on /nowhere' in done.err


def summary(output):
    """The rows of the README's table: recording, mode, and least and most of outliers, precision and recall."""
    found, name = {}, ''
    for own, mode, cells in re.findall(r'^(.*?) *(adaptive|paper) +([0-9].*)$', output, re.MULTILINE):
        name = own.split()[0] if own else name
        _, outliers, *_, precision, recall = cells.split()
        found.setdefault((name, mode), []).append((int(outliers), float(precision), float(recall)))
    return {
        key: [(min(column), max(column)) for column in zip(*rows, strict=True)]
        for key, rows in found.items()
        if key[0] != 'padded'
    }


def ends_of(cell):
    """Least and most in a cell such as 1,883 to 1,955, or one number twice."""
    numbers = [float(each.replace(',', '')) for each in cell.split(' to ')]
    return numbers[0], numbers[-1]


def assert_same(printed, written):
    """The same rows, but for what another processor may round in another way."""
    assert list(printed) == [row[:2] for row in written]
    for spans, row in zip(printed.values(), written, strict=True):
        for span, cell, off in zip(spans, row[2:], (3, 0.002, 0.002), strict=True):
            assert span == pytest.approx(ends_of(cell), abs=off, rel=0)


def test_the_demo_prints_a_table_and_names_the_files_that_it_wrote(run, tmp_path):
    done = run('demo', timeout=300)
    assert done.code == 0, done.err
    for name in ('metal_groove', 'parts', 'padded', 'stack'):
        assert f'out/demo/{name}_cleaned.mcap' in done.out
        assert (tmp_path / f'out/demo/{name}.png').stat().st_size > 10_000
    rows = [
        line.split()
        for line in done.out.splitlines()
        if line.startswith(('metal_groove', 'parts', 'padded', 'stack'))
    ]
    assert len(rows) == 12
    assert {row[2] for row in rows} == {'adaptive'}
    measured = {row[0]: int(row[3]) for row in rows if row[0] in ('parts', 'padded')}
    assert measured['parts'] == 19200
    assert measured['padded'] < 10800
    # The first cloud of each recording in the other mode; the stack is the last.
    again = [line.split() for line in done.out.splitlines() if line.split()[:1] == ['paper']]
    assert len(again) == 4
    assert all(float(row[-1]) > 0.99 and float(row[-2]) > 0.99 for row in again[:-1])
    stack = next(row for row in rows if row[0] == 'stack')
    assert float(stack[-1]) > 0.99
    assert float(stack[-2]) > 0.99
    assert max(len(line) for line in done.out.splitlines() if not line.startswith('  ')) <= 100
    readme = (BAGS.parent / 'README.md').read_text(encoding='utf-8')
    row = r'^\| `(\w+)`.*? \| (adaptive|paper).*? \| (.+) \| (.+) \| (.+) \|$'
    assert_same(summary(done.out), re.findall(row, readme, re.MULTILINE))
    topics, messages = contents(tmp_path / 'out/demo/metal_groove_cleaned.mcap')
    assert {'/points', '/points_filtered', '/outlier_mask', '/social_circle/measurement'} == set(topics)
    assert len(messages) == 4


def test_the_demo_plays_a_measurement_file(run, tmp_path):
    import numpy as np

    z = np.random.default_rng(0).random((80, 90))
    z[40, 40] = 50
    np.savez(tmp_path / 'part.npz', z=z, dx=1.0, dy=1.0)
    done = run('demo', 'part.npz', timeout=300)
    assert done.code == 0, done.err
    _, messages = contents(tmp_path / 'out/demo/part_cleaned.mcap')
    (filtered,) = (m.data for m in messages if m.topic == '/points_filtered')
    assert np.isnan(PointCloud.decode(filtered).xyz()[40, 40]).all()


def test_the_demo_of_the_paper_s_mode_shows_the_adaptive_mode_as_the_other(run, tmp_path):
    with RecordingWriter(tmp_path / 'one.mcap') as writer:
        writer.add_topic(ros_topic('/points', CLOUD))
        writer.write('/points', cloud(40, 50), 1)
    parameters = tmp_path / 'paper.yaml'
    parameters.write_text('/**:\n  ros__parameters:\n    circle.mode: paper\n')
    done = run('demo', 'one.mcap', '--params-file', str(parameters), timeout=300)
    assert done.code == 0, done.err
    modes = [mode for line in done.out.splitlines() for mode in ('paper', 'adaptive') if f' {mode} ' in line]
    assert modes[:2] == ['paper', 'adaptive']


def test_the_demo_continues_after_a_refused_cloud(run, tmp_path):
    with RecordingWriter(tmp_path / 'mixed.mcap') as writer:
        writer.add_topic(ros_topic('/points', CLOUD))
        writer.write('/points', cloud(1, 9), 1)
        writer.write('/points', cloud(), 2)
    done = run('demo', 'mixed.mcap', timeout=300)
    assert done.code == 0, done.err
    assert 'refused' in done.out
    assert (tmp_path / 'out/demo/mixed.png').exists()


def test_a_replay_does_not_wait_for_topics_that_get_no_subscriber(run, tmp_path):
    with started(tmp_path, 'record', '/wanted/points', '-o', 'again.mcap') as recorder:
        # `run` ends the command earlier than this wait.
        done = run('play', BAGS / 'parts.mcap', '--namespace', '/wanted', '--rate', '8', '--wait', '3600')
        assert done.code == 0, done.err
        assert 'No node subscribes to /wanted/truth/outlier_mask; playing anyway' in done.err
    assert '8 messages written' in recorder.output[0]


def test_a_replay_that_is_terminated_ends_cleanly(tmp_path):
    with started(tmp_path, 'play', BAGS / 'parts.mcap', '--loop', '--wait', '0', '--namespace', '/term') as player:
        assert 'No node subscribes to' in player.stderr.readline()
        player.send_signal(signal.SIGTERM)
        player.wait(60)
    assert player.returncode == 128 + signal.SIGTERM
    assert 'messages played' in player.output[0]
    assert 'Ended by SIGTERM.' in player.output[1]
    assert 'Traceback' not in player.output[1]


def test_ctrl_c_ends_a_replay_in_a_loop(tmp_path):
    with started(tmp_path, 'play', BAGS / 'parts.mcap', '--loop', '--wait', '0', '--namespace', '/loop') as player:
        assert 'No node subscribes to' in player.stderr.readline()
    assert player.returncode == 0, player.output  # its normal end, as of a recording
    assert 'messages played' in player.output[0]
    assert 'Traceback' not in player.output[1]


def test_the_demo_names_the_reason_why_a_stack_was_refused(run):
    done = run('demo', BAGS / 'stack.mcap')
    assert done.code == 0, done.err
    assert 'stack (stack) was refused: A frame was refused: stack.pitch_x is not set' in done.err
