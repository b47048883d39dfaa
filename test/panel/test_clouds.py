"""The clouds of a recording, one at a time, in any order."""

from pathlib import Path

import pytest
from examples import cloud

from socialcircle_ros.errors import RecordingError
from socialcircle_ros.messages.image import TYPE as IMAGE
from socialcircle_ros.messages.point_cloud import TYPE as CLOUD
from socialcircle_ros.panel.clouds import RecordedClouds
from socialcircle_ros.recording import RecordingWriter, open_recording, ros_topic

BAGS = Path(__file__).resolve().parents[2] / 'bags'


def test_clouds_can_be_read_in_any_order():
    with open_recording(BAGS / 'parts.mcap') as reader:
        recorded = [message.data for message in reader.messages(['/points'])]
    with RecordedClouds(BAGS / 'parts.mcap') as clouds:
        assert len(clouds) == len(recorded) == 8
        for number in (0, 7, 3, 3, 6, 0):
            assert clouds[number].data == recorded[number]
        with pytest.raises(IndexError):
            clouds[8]


def test_clouds_with_the_same_time_are_distinguished(tmp_path):
    with RecordingWriter(tmp_path / 'a.mcap') as writer:
        writer.add_topic(ros_topic('/points', CLOUD))
        for seed in range(3):
            writer.write('/points', cloud(9, 9 + seed), 5)
    with RecordedClouds(tmp_path / 'a.mcap') as clouds:
        assert [clouds[number].data for number in (2, 0, 1)] == [cloud(9, 9 + seed) for seed in (2, 0, 1)]


def test_clouds_before_the_damage_can_be_read(tmp_path):
    whole = (BAGS / 'parts.mcap').read_bytes()
    (tmp_path / 'cut.mcap').write_bytes(whole[: len(whole) // 2])
    with RecordedClouds(tmp_path / 'cut.mcap') as clouds:
        assert 0 < len(clouds) < 8
        assert 'damaged' in clouds.damage
        assert clouds[len(clouds) - 1].data


def test_a_recording_without_clouds_is_refused(tmp_path):
    with RecordingWriter(tmp_path / 'images.mcap') as writer:
        writer.add_topic(ros_topic('/camera', IMAGE))
    with pytest.raises(RecordingError, match='has no clouds'):
        RecordedClouds(tmp_path / 'images.mcap')
    with pytest.raises(RecordingError, match='socialcircle filter'):
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
            clouds[7]
