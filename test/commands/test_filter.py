# SPDX-License-Identifier: Apache-2.0
"""`socialcircle filter`."""

import contextlib
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from examples import cloud
from storage.disks import small_disk

from socialcircle_ros import interface
from socialcircle_ros.messages.point_cloud import TYPE as CLOUD
from socialcircle_ros.recording import RecordingWriter, open_recording, ros_topic
from socialcircle_ros.recording.create import record_clouds
from socialcircle_ros.settings import OutputSettings

BAGS = Path(__file__).resolve().parents[2] / 'bags'


def test_it_filters_and_prints_the_counts(run, tmp_path):
    done = run('filter', BAGS / 'parts.mcap', '-o', 'cleaned.mcap')
    assert done.code == 0, done.err
    assert '8 clouds filtered, ' in done.out
    assert 'of 153600 measured points are outliers' in done.out
    with open_recording(tmp_path / 'cleaned.mcap') as reader:
        assert '/points_filtered' in reader.topics


def test_notes_on_islands_and_on_points_that_are_not_measured_are_counted_apart(run, tmp_path):
    rng = np.random.default_rng(0)
    for number in range(6):
        heights = rng.normal(0, 0.02, (150, 210))
        heights[40 : 50 + number, 60:72] += 5
        heights[100 : 110 + number, :100] = 0  # a mark of what is not measured
        np.savez(tmp_path / f'{number}.npz', z=heights, dx=1.0, dy=1.0)
    record_clouds([tmp_path / f'{number}.npz' for number in range(6)], tmp_path / 'islands.mcap', unit='um')
    done = run('filter', 'islands.mcap', '-o', 'cleaned.mcap', '-p', "circle.not_measured:='0'")
    notes = [line for line in done.err.splitlines() if line.startswith('Note: ')]
    assert sum('points have exactly the height 0, ' in note for note in notes) == 3, done.err
    assert sum('far off a plain surface was removed, though' in note for note in notes) == 3
    assert 'Note: 3 other clouds with such points; ~/measurement says which.' in notes
    assert 'Note: 3 other clouds with such islands; ~/measurement says which.' in notes


def test_a_missing_folder_is_created_and_a_directory_is_named_as_such(run, tmp_path):
    one = run('filter', BAGS / 'padded.mcap', '-o', 'new/folder/cleaned.MCAP')
    assert one.out.rstrip().endswith('written to new/folder/cleaned.MCAP.'), one.err
    assert (tmp_path / 'new/folder/cleaned.MCAP').is_file()
    several = run('filter', BAGS / 'padded.mcap', '-o', 'night.2026-11-29')
    assert several.out.rstrip().endswith('written to the directory night.2026-11-29.')
    assert (tmp_path / 'night.2026-11-29/metadata.yaml').is_file()


def test_parameters_come_from_a_file_and_from_the_command_line(run, tmp_path):
    (tmp_path / 'wide.yaml').write_text(
        '/**:\n  ros__parameters:\n    circle:\n      mode: paper\n      radius_scale: 100\n'
    )
    wide = run('filter', BAGS / 'parts.mcap', '-o', 'wide.mcap', '--params-file', 'wide.yaml')
    assert ' 0 of 153600' in wide.out
    both = run(
        'filter',
        BAGS / 'parts.mcap',
        '-o',
        'both.mcap',
        '--params-file',
        'wide.yaml',
        '-p',
        'circle.radius_scale:=1',
    )
    assert ' 0 of 153600' not in both.out


def test_the_help_names_the_topics_that_are_written_by_default(run):
    text = run('filter', '--help').out
    for topic in interface.outputs_of('paper', OutputSettings()):
        assert f'\n  {topic.within("")[1:]} ' in text


@pytest.mark.parametrize(
    ('arguments', 'sentence'),
    [
        (['nowhere.mcap', '-o', 'x.mcap'], 'nowhere.mcap'),
        (['broken.mcap', '-o', 'x.mcap'], 'broken.mcap'),
        ([BAGS / 'parts.mcap', '-o', 'there.mcap'], 'there.mcap'),
        ([BAGS / 'parts.mcap', '-o', '/proc/folder/x.mcap'], '/proc/folder cannot be written'),
        ([BAGS / 'parts.mcap', '-o', 'no/folder/x.png'], 'x.png cannot be a recording, because it ends in .png'),
        ([BAGS / 'parts.mcap', '-o', 'no/folder/x.x3p'], 'and a .x3p file holds one'),
        ([BAGS / 'parts.mcap', '-o', 'x.mcap', '-p', 'circle.window:=4'], 'circle.window must be odd, not 4'),
        ([BAGS / 'parts.mcap', '-o', 'x.mcap', '-p', 'circle.windw:=5'], 'There is no parameter circle.windw'),
        ([BAGS / 'parts.mcap', '-o', 'x.mcap', '-p', 'circle.window=5'], 'not of the form NAME:=VALUE'),
        ([BAGS / 'parts.mcap', '-o', 'x.mcap', '-p', 'circle.window:=[5'], 'it is not YAML'),
        ([BAGS / 'parts.mcap', '-o', 'x.mcap', '--params-file', 'nowhere.yaml'], 'nowhere.yaml cannot be read'),
        (
            [BAGS / 'parts.mcap', '-o', 'x.mcap', '--params-file', 'odd.yaml'],
            'line 1 has a value outside',
        ),
        (
            [BAGS / 'parts.mcap', '-o', 'x.mcap', '--params-file', 'bad.yaml'],
            'line 1 has a list where',
        ),
        ([BAGS / 'parts.mcap', '-o', 'x.mcap', '--topic', '/nowhere'], 'has no topic /nowhere'),
    ],
)
def test_an_error_is_one_sentence_and_leaves_no_file(run, tmp_path, arguments, sentence):
    (tmp_path / 'broken.mcap').write_bytes(b'not a recording')
    (tmp_path / 'there.mcap').write_bytes((BAGS / 'padded.mcap').read_bytes())
    (tmp_path / 'odd.yaml').write_text('circle: 1\n')
    (tmp_path / 'bad.yaml').write_text('circle: [1\n')
    before = sorted(tmp_path.iterdir())
    done = run('filter', *arguments)
    assert done.code == 1
    assert sentence in done.err
    assert 'Traceback' not in done.err
    assert sorted(tmp_path.iterdir()) == before


def test_a_recording_without_a_usable_cloud_is_an_error_and_leaves_what_was_there(run, tmp_path):
    (tmp_path / 'x.mcap').write_bytes((BAGS / 'parts.mcap').read_bytes())
    done = run('filter', BAGS / 'stack.mcap', '-o', 'x.mcap', '--overwrite')
    assert done.code == 1
    assert 'stack.pitch_x is not set' in done.err
    assert done.out == 'No cloud could be filtered, so nothing was written.\n'
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [(BAGS / 'parts.mcap').read_bytes()]


def test_results_of_an_earlier_run_are_replaced_only_by_new_ones(run):
    parameters = ('--params-file', BAGS / 'stack.yaml')
    assert run('filter', BAGS / 'stack.mcap', '-o', 'once.mcap', *parameters).code == 0
    assert 'Replaced' in run('filter', 'once.mcap', '-o', 'again.mcap', *parameters).err
    done = run('filter', 'once.mcap', '-o', 'twice.mcap')
    assert 'so nothing was written' in done.out
    assert 'Replaced' not in done.err


def test_more_than_half_outliers_is_a_warning(run):
    done = run(
        'filter', BAGS / 'parts.mcap', '-o', 'x.mcap', '-p', 'circle.mode:=paper', '-p', 'circle.radius_scale:=0.4'
    )
    assert done.code == 0
    assert 'more than half of the points' in done.err


@pytest.mark.parametrize('limit', [(), ('-p', 'limits.sq_max:=1e-9')])
def test_a_warning_of_many_clouds_is_told_once_also_where_limits_fail(run, limit):
    done = run('filter', BAGS / 'parts.mcap', '-o', 'x.mcap', '-p', 'circle.radius_scale:=2.0', *limit)
    assert done.code == (3 if limit else 0), done.err
    assert done.err.count('Warning: ') == 1
    assert 'Warning: circle.radius_scale has no effect in the adaptive mode' in done.err


def test_a_number_may_have_an_exponent(run):
    done = run(
        'filter', BAGS / 'parts.mcap', '-o', 'x.mcap', '-p', 'circle.mode:=paper', '-p', 'circle.radius:=1e2'
    )
    assert done.code == 0, done.err
    assert ' 0 of 153600' in done.out


def test_a_damaged_recording_is_filtered_up_to_the_damage_with_a_warning(run, tmp_path):
    data = (BAGS / 'parts.mcap').read_bytes()
    (tmp_path / 'cut.mcap').write_bytes(data[: len(data) // 2])
    done = run('filter', 'cut.mcap', '-o', 'x.mcap')
    assert done.code == 0
    assert 'clouds filtered' in done.out
    assert 'Warning: ' in done.err
    assert 'cut.mcap' in done.err


def long_recording(path):
    """A recording that takes some seconds to filter."""
    with RecordingWriter(path) as writer:
        writer.add_topic(ros_topic('/points', CLOUD))
        message = cloud(300, 300)
        for number in range(200):
            writer.write('/points', message, number + 1)


@contextlib.contextmanager
def filtering(folder):
    """A process that filters a long recording and has begun to write."""
    long_recording(folder / 'long.mcap')
    command = [sys.executable, '-m', 'socialcircle_ros.commands.main', 'filter', 'long.mcap', '-o', 'x.mcap']
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        while not list(folder.glob('x.mcap.*.partial')):
            assert process.poll() is None, process.communicate()
            time.sleep(0.01)
        yield process
    finally:
        process.kill()
        process.communicate()


@pytest.mark.parametrize('ending', [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_a_signal_ends_it_and_leaves_nothing_behind(tmp_path, ending):
    with filtering(tmp_path) as process:
        process.send_signal(ending)
        _, err = process.communicate(timeout=300)
    assert process.returncode == 128 + ending
    assert err.strip() == ('Stopped.' if ending == signal.SIGINT else f'Ended by {ending.name}.')
    assert [path.name for path in tmp_path.iterdir()] == ['long.mcap']


def test_what_a_killed_run_left_is_removed_by_the_next_with_a_word(run, tmp_path):
    with filtering(tmp_path) as process:
        process.kill()
        process.wait()
    (left,) = tmp_path.glob('x.mcap.*.partial')
    done = run('filter', BAGS / 'parts.mcap', '-o', 'x.mcap')
    assert done.code == 0
    assert f'{left} was left by a process that was killed; it is removed.' in done.err
    assert sorted(path.name for path in tmp_path.iterdir()) == ['long.mcap', 'x.mcap']


def test_a_full_disk_is_told_and_leaves_nothing_behind(run, tmp_path):
    with small_disk(tmp_path / 'disk', 1 << 20) as disk:
        for name in ('x.mcap', 'x'):
            done = run('filter', BAGS / 'parts.mcap', '-o', disk / name)
            assert done.code == 1
            assert f'{disk / name} cannot be written (No space left on device): check the space' in done.err
            assert 'Traceback' not in done.err
            assert list(disk.iterdir()) == []


def test_a_measurement_that_fails_its_limits_is_told_and_ends_with_its_exit_code(run, tmp_path):
    done = run('filter', BAGS / 'padded.mcap', '-o', 'cleaned.mcap', '-p', 'limits.outlier_share_max:=0.0001')
    assert done.code == 3, done.err
    assert [line.partition(': ')[2].partition(':')[0] for line in done.err.splitlines() if 'Failed' in line] == [
        f'/points {number}' for number in range(2)
    ]
    assert 'of the measured points are outliers, more than 0.01 %.' in done.err
    assert '0 of 2 measurements passed the limits.' in done.out
    assert (tmp_path / 'cleaned.mcap').exists()
    done = run('filter', BAGS / 'padded.mcap', '-o', 'passed.mcap', '-p', 'limits.outlier_share_max:=0.99')
    assert done.code == 0, done.err
    assert '2 of 2 measurements passed the limits. Limits: at most 99 % outliers.' in done.out


def test_limits_on_lengths_are_told_with_their_unit(run, tmp_path):
    np.savez(tmp_path / 'part.npz', z=np.random.default_rng(0).normal(size=(40, 50)), dx=1.0, dy=1.0)
    limits = ('-p', 'limits.sq_max:=2.0', '-p', 'limits.sa_min:=1e-9', '-p', 'limits.measured_share_min:=0.5')
    done = run('filter', 'part.npz', '-o', 'cleaned.mcap', *limits)
    assert done.code == 0, done.err
    assert 'Limits: at least 50 % measured; Sa at least 1 nm; Sq at most 2 m.' in done.out
    done = run('filter', BAGS / 'parts.mcap', '-o', 'other.mcap', '-p', 'limits.sz_max:=1e3')
    assert 'Limits: Sz at most 1 mm.' in done.out
    assert '; 16 messages of the recording kept; written to other.mcap.' in done.out
    done = run('filter', 'part.npz', '-o', 'failed.mcap', '-p', 'limits.sq_max:=5e-7')
    assert re.search(r'Failed: part\.npz: Sq is \S+ (nm|µm), above 500 nm\.', done.err), done.err


def test_a_refused_cloud_fails_where_limits_are_set(run, tmp_path):
    with RecordingWriter(tmp_path / 'mixed.mcap') as writer:
        writer.add_topic(ros_topic('/points', CLOUD))
        for number, points in enumerate((cloud(), cloud(1, 9), cloud(1, 9), b'')):
            writer.write('/points', points, number)
    done = run('filter', 'mixed.mcap', '-o', 'cleaned.mcap', '-p', 'limits.sz_max:=5.0')
    assert done.code == 3, done.err
    assert 'Refused, 2 times, first /points 1: The cloud is not organized' in done.err
    assert 'Refused, /points 3: The message' in done.err
    assert 'Failed: 3 refused clouds or frames.' in done.err
