# SPDX-License-Identifier: Apache-2.0
"""The shipped recordings: make_bags.py reproduces them, and they hold what the demo and other tests need."""

import runpy
from pathlib import Path

import numpy as np
import pytest

from socialcircle_ros.messages.image import NOT_MEASURED, OUTLIER, Image, decode_mono8
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.recording import open_recording

BAGS = Path(__file__).resolve().parents[2] / 'bags'


@pytest.fixture(scope='module')
def made(tmp_path_factory):
    program = runpy.run_path(str(BAGS / 'make_bags.py'))
    folder = tmp_path_factory.mktemp('bags')
    program['main'].__globals__['HERE'] = folder
    program['main']()
    return folder


def messages(path):
    with open_recording(path) as reader:
        return list(reader.messages())


@pytest.mark.parametrize('name', ['metal_groove.mcap', 'parts.mcap', 'padded.mcap'])
def test_the_program_reproduces_the_recordings(made, name):
    """Heights may differ by the rounding step, because versions of NumPy add in different orders."""
    for new, shipped in zip(messages(made / name), messages(BAGS / name), strict=True):
        assert (new.topic, new.log_time, len(new.data)) == (shipped.topic, shipped.log_time, len(shipped.data))
        if new.topic == '/points':
            here, there = PointCloud.decode(new.data).xyz(), PointCloud.decode(shipped.data).xyz()
            np.testing.assert_allclose(here, there, atol=0.02)
        else:
            different = decode_mono8(new.data) != decode_mono8(shipped.data)
            assert np.count_nonzero(different) <= 0.001 * different.size


def test_the_recordings_are_small():
    assert sum(path.stat().st_size for path in BAGS.glob('*.mcap')) < 8e6


def test_the_groove_is_large_and_has_isolated_outliers_and_clusters():
    points, truth = messages(BAGS / 'metal_groove.mcap')
    cloud = PointCloud.decode(points.data)
    assert cloud.height >= 480
    assert cloud.width >= 640
    outlier = decode_mono8(truth.data) == OUTLIER
    steps = [(row, column) for row in (-1, 0, 1) for column in (-1, 0, 1) if (row, column) != (0, 0)]
    neighbours = sum(np.roll(outlier, step, (0, 1)) for step in steps)
    assert np.count_nonzero(outlier & (neighbours == 0)) > 1000
    assert np.count_nonzero(outlier & (neighbours == 8)) > 1000


def test_the_parts_have_several_clouds():
    assert sum(message.topic == '/points' for message in messages(BAGS / 'parts.mcap')) == 8


def test_the_padded_clouds_have_padding_more_fields_and_holes():
    points, truth = messages(BAGS / 'padded.mcap')[:2]
    cloud = PointCloud.decode(points.data)
    assert cloud.row_step > cloud.width * cloud.point_step
    assert {'x', 'y', 'z'} < {field.name for field in cloud.fields}
    assert np.isnan(cloud.xyz()).any()
    assert np.any(decode_mono8(truth.data) == NOT_MEASURED)


def test_the_simulator_reproduces_the_stack(made):
    new, shipped = messages(made / 'stack.mcap'), messages(BAGS / 'stack.mcap')
    assert [message.topic for message in new] == [message.topic for message in shipped]
    for here, there in zip(new, shipped, strict=True):
        if here.topic == '/stack/image':
            frames = [Image.decode(message.data).pixels().astype(int) for message in (here, there)]
            assert np.mean(abs(frames[0] - frames[1]) > 1) < 0.001
    assert (made / 'stack.yaml').read_text() == (BAGS / 'stack.yaml').read_text()
