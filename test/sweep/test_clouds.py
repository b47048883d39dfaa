# SPDX-License-Identifier: Apache-2.0
"""The clouds of a sweep."""

import numpy as np
import pytest
from examples import MARKS, NAN, cloud, marked
from hypothesis import given
from hypothesis import strategies as st
from sweep.sweep_examples import BASE, labelled, truth

from socialcircle_ros import FocusSettings
from socialcircle_ros.errors import MessageError, RecordingError
from socialcircle_ros.messages import image, point_cloud
from socialcircle_ros.messages.header import Header
from socialcircle_ros.recording import RecordingWriter, ros_topic
from socialcircle_ros.recording.named_clouds import evenly_spread
from socialcircle_ros.sweep.clouds import SweptRecording, cached, sweep_cloud


def test_the_criterion_takes_the_place_of_an_unknown_truth():
    found = sweep_cloud('/points 0', cloud(), None)
    assert not found.has_truth
    assert (found.outlier & truth()[0]).sum() == 26
    assert (found.counted == truth()[1]).all()


@pytest.mark.parametrize('mark', MARKS.values(), ids=MARKS)
def test_a_mark_of_what_is_not_measured_is_no_outlier_and_not_shown(mark):
    of_mark, of_nan = (
        sweep_cloud('/points 0', point_cloud.encode_point_cloud(Header(1, 0, 'm'), marked(each)), None)
        for each in (mark, NAN)
    )
    np.testing.assert_array_equal(of_mark.outlier, of_nan.outlier)
    np.testing.assert_array_equal(of_mark.counted, of_nan.counted)
    np.testing.assert_array_equal(of_mark.xyz, of_nan.xyz)


def test_a_cloud_that_is_not_organized_is_refused():
    with pytest.raises(MessageError, match='not organized'):
        sweep_cloud('/points 0', cloud(1, 9), None)


@given(st.integers(0, 300), st.integers(1, 20))
def test_the_chosen_items_are_spread_over_all(available, count):
    chosen = evenly_spread(iter(range(available)), count)
    assert chosen == sorted(set(chosen))
    assert len(chosen) == min(available, count)
    gaps = np.diff([*chosen, available])
    assert not len(gaps) or gaps.max() <= 4 * max(1, available / count)


def test_clouds_are_loaded_once_for_each_focus_setting():
    loaded = []

    def load(focus):
        loaded.append(focus)
        return [labelled()]

    clouds = cached(load)
    one, two, three = FocusSettings(), FocusSettings(step=1), FocusSettings(step=3)
    for focus in (one, one, two, one, two, three, two):
        clouds(focus)
    assert loaded == [one, two, three]


class TestRecordedClouds:
    @pytest.fixture
    def path(self, tmp_path):
        """Three clouds, the second one with its truth, and one that is not organized."""
        path = tmp_path / 'night.mcap'
        with RecordingWriter(path) as writer:
            writer.add_topic(ros_topic('/points', point_cloud.TYPE))
            writer.add_topic(ros_topic('/truth/outlier_mask', image.TYPE))
            for number in range(3):
                writer.write('/points', cloud(seed=number, stamp=number), number)
            outlier, counted = truth()
            mask = image.mask_pixels(counted & ~outlier, outlier)
            writer.write('/truth/outlier_mask', image.encode_image(Header.at(1, 'microscope'), mask), 4)
            writer.write('/points', cloud(1, 9), 5)
        return path

    def test_clouds_with_a_truth_are_preferred(self, path):
        recorded = SweptRecording(path, BASE, (), 10)
        (found,) = recorded.load(FocusSettings())
        assert found.name == '/points 1'
        assert found.has_truth
        assert (found.outlier == truth()[0]).all()

    def test_refusals_are_counted_once_per_load(self, path):
        recorded = SweptRecording(path, BASE, (), 10)
        for _ in range(2):
            recorded.load(FocusSettings())
        ((reason, count),) = recorded.refused.items()
        assert 'not organized' in reason
        assert count == 1

    def test_the_number_of_clouds_is_limited(self, path):
        (found,) = SweptRecording(path, BASE, (), 1).load(FocusSettings())
        assert found.name == '/points 0'

    def test_a_recording_without_a_usable_cloud_is_an_error(self, tmp_path):
        with RecordingWriter(tmp_path / 'lines.mcap') as writer:
            writer.add_topic(ros_topic('/points', point_cloud.TYPE))
            writer.write('/points', cloud(1, 9), 0)
        recorded = SweptRecording(tmp_path / 'lines.mcap', BASE, (), 10)
        with pytest.raises(RecordingError, match='no cloud that can be filtered. The cloud is not organized'):
            recorded.load(FocusSettings())
