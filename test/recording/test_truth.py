# SPDX-License-Identifier: Apache-2.0
"""Known outliers of a recording."""

from pathlib import Path

import numpy as np
import pytest
from examples import cloud

from socialcircle_ros.messages import diagnostics, image, point_cloud
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.point_cloud import PointCloud, encode_point_cloud
from socialcircle_ros.recording import RecordingWriter, open_recording, ros_topic
from socialcircle_ros.recording.truth import truths_of

BAGS = Path(__file__).resolve().parents[2] / 'bags'
NAME = '/cell/truth/outlier_mask'


def truth_of(path, points, namespace=''):
    with open_recording(path) as reader:
        return truths_of(reader)(namespace, points)


def recorded_mask(path, mask, stamp):
    with RecordingWriter(path) as writer:
        writer.add_topic(ros_topic(NAME, image.TYPE))
        writer.write(NAME, image.encode_image(Header.at(stamp, ''), mask), stamp)
    return path


def test_a_mask_belongs_to_the_cloud_of_its_namespace_and_stamp(tmp_path):
    mask = np.zeros((70, 80), np.uint8)
    mask[10, 12], mask[20, 0] = 255, 127
    path = recorded_mask(tmp_path / 'night.mcap', mask, 5)
    truth = truth_of(path, cloud(stamp=5), '/cell')
    assert np.argwhere(truth.outlier).tolist() == [[10, 12]]
    assert np.argwhere(~truth.counted).tolist() == [[20, 0]]
    assert truth_of(path, cloud(stamp=6), '/cell') is None
    assert truth_of(path, cloud(stamp=5), '/other') is None


def test_a_mask_of_another_size_is_ignored(tmp_path):
    path = recorded_mask(tmp_path / 'night.mcap', np.zeros((7, 8), np.uint8), 5)
    assert truth_of(path, cloud(stamp=5), '/cell') is None


def test_a_simulated_stack_is_compared_with_its_true_surface():
    with open_recording(BAGS / 'stack.mcap') as reader:
        surface = next(message.data for message in reader.messages(['/truth/surface']))
    perfect = PointCloud.decode(surface).xyz().copy()
    perfect[20, 30, 2] += 1e-3
    truth = truth_of(BAGS / 'stack.mcap', encode_point_cloud(Header.at(1, ''), perfect))
    assert np.argwhere(truth.outlier).tolist() == [[20, 30]]
    assert truth.counted.all()


def test_a_recording_without_truth_gives_none(tmp_path):
    with RecordingWriter(tmp_path / 'night.mcap') as writer:
        writer.add_topic(ros_topic('/points', point_cloud.TYPE))
        writer.write('/points', cloud(), 1)
    assert truth_of(tmp_path / 'night.mcap', cloud()) is None


@pytest.mark.parametrize('kind', [diagnostics.TYPE, point_cloud.TYPE, image.TYPE])
def test_topics_of_other_programs_with_these_names_refuse_nothing(tmp_path, kind):
    with RecordingWriter(tmp_path / 'night.mcap') as writer:
        for name in (NAME, '/truth/surface', '/truth/description'):
            writer.add_topic(ros_topic(name, kind))
            writer.write(name, b'\0\1\0\0', 1)
    assert truth_of(tmp_path / 'night.mcap', cloud(), '/cell') is None


def test_a_description_without_bounds_gives_no_truth(tmp_path):
    with RecordingWriter(tmp_path / 'night.mcap') as writer:
        writer.add_topic(ros_topic('/truth/surface', point_cloud.TYPE))
        writer.add_topic(ros_topic('/truth/description', diagnostics.TYPE))
        writer.write('/truth/surface', cloud(), 1)
        writer.write('/truth/description', diagnostics.Status(diagnostics.OK, 'a', 'b', 'c', {}).encode(), 1)
    assert truth_of(tmp_path / 'night.mcap', cloud()) is None
