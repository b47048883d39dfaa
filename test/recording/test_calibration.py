# SPDX-License-Identifier: Apache-2.0
"""Latency from a scan up and a scan down, and pitch from a grating."""

import numpy as np
import pytest

from socialcircle_ros.errors import StackError
from socialcircle_ros.messages import image, joint_state
from socialcircle_ros.messages.header import Header
from socialcircle_ros.recording.calibration import measure_latency, measure_pitch
from socialcircle_ros.recording.reader import open_recording
from socialcircle_ros.recording.topics import ros_topic
from socialcircle_ros.recording.writer import RecordingWriter
from socialcircle_ros.settings import PipelineSettings, StackSettings

PERIOD = 20_000_000
STEP = 1e-6
SETTINGS = PipelineSettings(stack=StackSettings(pitch_x=1e-6, z_source='joint_states'))


def scan_file(path, latency_s, directions=(1, -1), count=25):
    """Frames of a tilted, textured part, with stamps that are late by the latency."""
    rng = np.random.default_rng(0)
    texture, surface = rng.integers(0, 200, (40, 48)), np.linspace(9, 15, 48) * STEP
    with RecordingWriter(path) as writer:
        writer.add_topic(ros_topic('/stack/image', image.TYPE))
        writer.add_topic(ros_topic('/stack/joint_states', joint_state.TYPE))
        time, z = PERIOD, 0.0
        for direction in directions:
            for _ in range(count):
                for part in range(4):  # positions at 200 Hz
                    stamp = time + part * PERIOD // 4
                    state = joint_state.JointState(
                        Header.at(stamp, ''), ['stage'], [z + direction * STEP * part / 4]
                    )
                    writer.write('/stack/joint_states', state.encode(), stamp)
                pixels = texture * np.exp(-(((z - surface) / (2.5 * STEP)) ** 2)) + 20
                stamp = time + round(1e9 * latency_s)
                frame = image.encode_image(Header.at(stamp, ''), np.rint(pixels).astype(np.uint8))
                writer.write('/stack/image', frame, time + PERIOD - 1)
                time += PERIOD
                z += direction * STEP
    return path


@pytest.mark.parametrize('latency_s', [0.0, 0.004, -0.006])
def test_latency_is_found_from_a_scan_up_and_a_scan_down(tmp_path, latency_s):
    found = measure_latency(scan_file(tmp_path / 'scans.mcap', latency_s, (1, -1, 1)), SETTINGS)
    assert found.latency_s == pytest.approx(latency_s, abs=2e-4)
    assert found.pairs >= 2
    assert found.before_m == pytest.approx(2 * abs(latency_s) * STEP / (PERIOD * 1e-9), abs=2e-8)
    assert found.after_m < 2e-8


def with_damage(path):
    """The same recording with a frame and a joint state of 9 bytes before the others, and without its end."""
    damaged = path.with_name('damaged.mcap')
    with open_recording(path) as reader, RecordingWriter(damaged) as writer:
        for topic in reader.topics.values():
            writer.add_topic(topic)
            writer.write(topic.name, bytes(9), 1)
        for message in reader.messages():
            writer.write(message.topic, message.data, message.log_time)
    damaged.write_bytes(damaged.read_bytes()[:-20])
    return damaged


def test_what_is_left_out_is_told(tmp_path):
    sound = scan_file(tmp_path / 'scans.mcap', 0.004)
    whole, found = measure_latency(sound, SETTINGS), measure_latency(with_damage(sound), SETTINGS)
    assert whole.damage is None
    assert found.latency_s == whole.latency_s
    more = found.refused - whole.refused
    assert sorted(reason.partition(':')[0] for reason in more) == [
        'A frame was refused',
        'A joint state was refused',
    ]
    assert set(more.values()) == {1}
    assert 'damaged.mcap has a damaged or cut-off index' in found.damage


def test_where_scans_lack_the_damage_is_told_as_well(tmp_path):
    path = with_damage(scan_file(tmp_path / 'up.mcap', 0.0, (1,)))
    with pytest.raises(StackError, match=r'has 1 scan, .* A frame was refused: .* cut-off index'):
        measure_latency(path, SETTINGS)


def test_a_scan_in_one_direction_has_no_latency(tmp_path):
    path = scan_file(tmp_path / 'up.mcap', 0.0, (1,))
    with pytest.raises(StackError, match='has 1 scan, and no scan up next to a scan down'):
        measure_latency(path, SETTINGS)


def test_latency_needs_the_positions_of_the_stage(tmp_path):
    counted = PipelineSettings(stack=StackSettings(pitch_x=1e-6, z_step=STEP))
    with pytest.raises(StackError, match='stack.z_source to joint_states'):
        measure_latency(tmp_path / 'none.mcap', counted)


@pytest.mark.parametrize(('period', 'angle'), [(7.31, 0.0), (12.7, 90.0), (9.4, 23.0), (17.9, -61.0), (4.07, 2.0)])
@pytest.mark.parametrize('sharp', [False, True])
def test_pitch_is_found_from_a_grating(period, angle, sharp):
    y, x = np.mgrid[:190, :260]
    phase = (x * np.cos(np.radians(angle)) + y * np.sin(np.radians(angle))) / period
    lines = np.cos(2 * np.pi * phase)
    lines = np.where(lines > 0.2, 1.0, 0.0) if sharp else lines
    noise = np.random.default_rng(1).normal(0, 8, x.shape)
    shown = np.clip(np.rint(90 + 60 * lines + 0.2 * x + noise), 0, 255).astype(np.uint8)
    found = measure_pitch(shown, 10e-6)
    assert found.pitch_m == pytest.approx(10e-6 / period, rel=1e-3)
    assert abs((found.angle_deg - angle + 90) % 180 - 90) < 0.2
    along, across = 260 * np.cos(np.radians(angle)), 190 * np.sin(np.radians(angle))
    assert found.periods == pytest.approx(np.hypot(along, across) / period, abs=0.5)


def test_an_image_without_a_grating_is_refused():
    noise = np.random.default_rng(0).integers(0, 255, (100, 120))
    with pytest.raises(StackError, match='no grating'):
        measure_pitch(noise, 1e-5)
