# SPDX-License-Identifier: Apache-2.0
"""The demo without its node: a stand-in filters the clouds in this process."""

from pathlib import Path

import numpy as np
import pytest
import zstandard

pytest.importorskip('rclpy', reason='the demo needs ROS 2')
pytest.importorskip('matplotlib')

from examples import cloud

from socialcircle_ros.clients.cloud_client import Response
from socialcircle_ros.clients.demo import Demo, DemoCloud, RefusedCloud, play_into_node, run_demo
from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.interface import FILTERED, MASK
from socialcircle_ros.messages.point_cloud import TYPE as CLOUD
from socialcircle_ros.pipeline.clouds import filter_cloud
from socialcircle_ros.recording import RecordingWriter, open_recording, ros_topic
from socialcircle_ros.settings import CircleSettings, PipelineSettings

BAGS = Path(__file__).resolve().parents[2] / 'bags'


class StandIn:
    """A client with the offline filter in place of a node."""

    mode = 'adaptive'

    def clean(self, message):
        self.last = message
        found = filter_cloud(message, PipelineSettings(circle=CircleSettings(mode=self.mode)))
        status = found.measurement.status(timed=True)
        return Response(found.messages[FILTERED], found.messages[MASK], status, 250.0, None, None)

    def change(self, name, value, _timeout_s=1.0):
        assert name == 'circle.mode'
        self.mode = value
        return self.clean(self.last)


def played(recording, output):
    demo = Demo()
    play_into_node(recording, StandIn(), output, demo)
    return demo


def test_each_cloud_is_described_and_compared_with_the_truth(tmp_path):
    demo = played(BAGS / 'padded.mcap', tmp_path)
    assert [found.name for found in demo.clouds] == ['padded 0', 'padded 0', 'padded 1']
    assert [found.mode for found in demo.clouds] == ['adaptive', 'paper', 'adaptive']
    for found in demo.clouds:
        assert isinstance(found, DemoCloud)
        assert found.measurement.points == 10800
        assert found.latency_ms == 250.0
        assert found.total_ms > 0
        assert found.scores.recall > {'adaptive': 0.5, 'paper': 0.99}[found.mode]


def test_a_measurement_shows_both_modes_and_why_the_paper_s_removes_nothing(tmp_path):
    heights = 0.01 * np.random.default_rng(0).normal(0, 1, (60, 70))
    heights[20:24, 30:35] += 0.4
    np.savez(tmp_path / 'part.npz', z=heights, dx=1.0, dy=1.5)
    adaptive, paper = played(tmp_path / 'part.npz', tmp_path).clouds
    assert adaptive.measurement.outliers >= 20
    assert adaptive.warning == ''
    assert paper.measurement.outliers == 0
    assert 'no point can be an outlier' in paper.warning.lower()
    assert (tmp_path / 'part.png').exists()


def test_the_results_are_written_and_the_first_cloud_is_drawn(tmp_path):
    demo = played(BAGS / 'padded.mcap', tmp_path)
    assert demo.written == [tmp_path / 'padded_cleaned.mcap', tmp_path / 'padded.png']
    assert demo.written[1].stat().st_size > 10_000
    with open_recording(demo.written[0]) as reader:
        topics = [message.topic for message in reader.messages()]
    each = ['/points', '/points_filtered', '/outlier_mask', '/social_circle/measurement']
    assert sorted(topics) == sorted(2 * each)


def test_a_refused_cloud_is_named_with_the_reason_and_the_next_one_is_drawn(tmp_path):
    with RecordingWriter(tmp_path / 'mixed.mcap') as writer:
        writer.add_topic(ros_topic('/points', CLOUD))
        writer.write('/points', cloud(1, 9), 1)
        writer.write('/points', cloud(), 2)
    refused, found, _ = played(tmp_path / 'mixed.mcap', tmp_path).clouds
    assert isinstance(refused, RefusedCloud)
    assert 'not organized' in refused.reason
    assert found.scores is None
    assert (tmp_path / 'mixed.png').exists()


def test_a_damaged_recording_is_named(tmp_path):
    data = (BAGS / 'padded.mcap').read_bytes()
    (tmp_path / 'cut.mcap').write_bytes(data[: len(data) // 2])
    (sentence,) = played(tmp_path / 'cut.mcap', tmp_path).damage
    assert 'cut.mcap' in sentence


def test_a_compressed_recording_is_played(tmp_path):
    with RecordingWriter(tmp_path / 'night.mcap') as writer:
        writer.add_topic(ros_topic('/points', CLOUD))
        writer.write('/points', cloud(), 1)
    content = (tmp_path / 'night.mcap').read_bytes()
    (tmp_path / 'night.mcap.zstd').write_bytes(zstandard.compress(content))
    found, _ = played(tmp_path / 'night.mcap.zstd', tmp_path).clouds
    assert found.name == 'night 0'
    assert (tmp_path / 'night_cleaned.mcap').exists()


@pytest.mark.parametrize('name', ['nowhere.npz', 'nowhere.mcap'])
def test_what_cannot_be_read_is_told_before_the_node_starts(tmp_path, name):
    said = []
    with pytest.raises(SocialCircleError, match=name):
        run_demo([BAGS / 'parts.mcap', tmp_path / name], tmp_path, status=said.append)
    assert said == []
