# SPDX-License-Identifier: Apache-2.0
"""The clouds of a recording, one at a time, in any order."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from examples import cloud

from socialcircle_ros.errors import RecordingError
from socialcircle_ros.focus import count_reasons
from socialcircle_ros.interface import STACK_FRAMES, STACK_JOINT_STATES
from socialcircle_ros.messages.header import stamp_of
from socialcircle_ros.messages.image import TYPE as IMAGE
from socialcircle_ros.messages.point_cloud import TYPE as CLOUD
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.panel.recorded import RecordedClouds
from socialcircle_ros.pipeline.stacks import StackAssembler, StackCloud
from socialcircle_ros.recording import RecordingWriter, open_recording, ros_topic
from socialcircle_ros.settings import PipelineSettings
from socialcircle_ros.settings.files import read_parameter_file

BAGS = Path(__file__).resolve().parents[2] / 'bags'
SETTINGS = PipelineSettings.from_ros(read_parameter_file(BAGS / 'stack.yaml', 'social_circle'))


def test_clouds_can_be_read_in_any_order():
    with open_recording(BAGS / 'parts.mcap') as reader:
        recorded = [message.data for message in reader.messages(['/points'])]
    with RecordedClouds(BAGS / 'parts.mcap') as clouds:
        assert len(clouds) == len(recorded) == 8
        for number in (0, 7, 3, 3, 6, 0):
            assert clouds.message(number).data == recorded[number]
        with pytest.raises(IndexError):
            clouds[8]


def test_clouds_with_the_same_time_are_distinguished(tmp_path):
    with RecordingWriter(tmp_path / 'a.mcap') as writer:
        writer.add_topic(ros_topic('/points', CLOUD))
        for seed in range(3):
            writer.write('/points', cloud(9, 9 + seed), 5)
    with RecordedClouds(tmp_path / 'a.mcap') as clouds:
        assert [clouds.message(number).data for number in (2, 0, 1)] == [cloud(9, 9 + seed) for seed in (2, 0, 1)]


def test_clouds_before_the_damage_can_be_read(tmp_path):
    whole = (BAGS / 'parts.mcap').read_bytes()
    (tmp_path / 'cut.mcap').write_bytes(whole[: len(whole) // 2])
    with RecordedClouds(tmp_path / 'cut.mcap') as clouds:
        assert 0 < len(clouds) < 8
        assert 'damaged' in clouds.damage
        assert clouds.message(len(clouds) - 1).data


def test_a_recording_without_clouds_is_refused(tmp_path):
    with RecordingWriter(tmp_path / 'images.mcap') as writer:
        writer.add_topic(ros_topic('/camera', IMAGE))
    with pytest.raises(RecordingError, match='neither clouds nor frames'):
        RecordedClouds(tmp_path / 'images.mcap')
    with pytest.raises(RecordingError, match='gives no cloud: .*stack.pitch_x is not set'):
        RecordedClouds(BAGS / 'stack.mcap')
    with RecordingWriter(tmp_path / 'empty.mcap') as writer:
        writer.add_topic(ros_topic('/points', CLOUD))
    with pytest.raises(RecordingError, match='no message'):
        RecordedClouds(tmp_path / 'empty.mcap')


def test_a_recording_that_changed_after_opening_is_reported(tmp_path):
    (tmp_path / 'a.mcap').write_bytes((BAGS / 'parts.mcap').read_bytes())
    with RecordedClouds(tmp_path / 'a.mcap') as clouds:
        with (tmp_path / 'a.mcap').open('r+b') as file:
            file.truncate(3000)
        with pytest.raises(RecordingError, match='open it again'):
            clouds.message(7)


def assembled(messages):
    """The clouds that a node makes of messages."""
    assembler = StackAssembler()
    assembler.configure(SETTINGS.focus, SETTINGS.stack)
    add = {STACK_FRAMES: assembler.add_frame, STACK_JOINT_STATES: assembler.add_joint_state}
    events = [event for message in messages for event in add[message.topic](message.data)]
    return [event for event in [*events, *assembler.finish()] if isinstance(event, StackCloud)]


@pytest.fixture(scope='module')
def two_scans(tmp_path_factory):
    """A recording of the same scan twice, the second one a minute later, as a node's results lie beside them."""
    path = tmp_path_factory.mktemp('scans') / 'scans.mcap'
    with open_recording(BAGS / 'stack.mcap') as reader, RecordingWriter(path) as writer:
        inputs = ('/stack/image', '/stack/joint_states')
        for name in inputs:
            writer.add_topic(reader.topics[name], name)
        for name, kind in (('/stack/points', CLOUD), ('/points_filtered', CLOUD)):
            writer.add_topic(ros_topic(name, kind))
        for later in (0, 60_000_000_000):
            for message in reader.messages(inputs):
                writer.write(message.topic, restamped(message, later), message.log_time + later)
            writer.write('/stack/points', cloud(stamp=1 + later), message.log_time + later)
            writer.write('/points_filtered', cloud(stamp=1 + later), message.log_time + later)
    return path


def restamped(message, later):
    seconds = stamp_of(message.data) // 10**9
    old, new = (value.to_bytes(4, 'little') for value in (seconds, seconds + later // 10**9))
    return message.data.replace(old, new, 1)


@pytest.mark.parametrize('frames', [32, 0])  # a stack ends by its number of frames, or by time
def test_the_stacks_of_a_recording_of_frames_that_was_filtered_are_found_and_sent_alone(two_scans, frames):
    with RecordedClouds(two_scans, replace(SETTINGS, stack=replace(SETTINGS.stack, frames=frames))) as recorded:
        assert len(recorded) == 2
        clouds = [assembled(recorded.stack_messages(number)) for number in (1, 0)]
        for number, made in zip((1, 0), clouds, strict=True):
            assert [stamp_of(each.points) for each in made] == [recorded[number].stack.stamp]
            assert made[0].frames == recorded[number].stack.frames == 32
            assert count_reasons(made[0].reasons) == recorded[number].stack.reasons
        second, first = (PointCloud.decode(made[0].points).xyz() for made in clouds)
        np.testing.assert_array_equal(first, second)


def test_clouds_of_stacks_without_their_frames_are_opened(tmp_path):
    with RecordingWriter(tmp_path / 'results.mcap') as writer:
        writer.add_topic(ros_topic('/cell1/stack/points', CLOUD))
        writer.write('/cell1/stack/points', cloud(), 5)
    with RecordedClouds(tmp_path / 'results.mcap') as recorded:
        assert recorded.message(0).data == cloud()


def test_a_recording_of_results_only_is_refused(tmp_path):
    with RecordingWriter(tmp_path / 'results.mcap') as writer:
        writer.add_topic(ros_topic('/points_filtered', CLOUD))
    with pytest.raises(RecordingError, match='holds only results of the filter: /points_filtered'):
        RecordedClouds(tmp_path / 'results.mcap')
