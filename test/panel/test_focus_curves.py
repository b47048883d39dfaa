# SPDX-License-Identifier: Apache-2.0
"""The focus curve of a pixel from the frames of a recording."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from panel.test_recorded import SETTINGS, assembled

from socialcircle_ros.errors import StackError
from socialcircle_ros.focus import count_reasons
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.panel.focus_curves import focus_curve
from socialcircle_ros.panel.recorded import RecordedClouds

BAGS = Path(__file__).resolve().parents[2] / 'bags'


@pytest.fixture(scope='module')
def stack():
    with RecordedClouds(BAGS / 'stack.mcap', SETTINGS) as recorded:
        return list(recorded.stack_messages(0))


@pytest.mark.parametrize('preview', [0, 5])
def test_the_curve_is_that_of_the_cloud_at_the_same_place(stack, preview):
    (cloud,) = assembled(stack)
    xyz = PointCloud.decode(cloud.points).xyz()
    row, column = np.argwhere(np.isfinite(xyz[..., 2]))[1000].tolist()
    settings = dataclasses.replace(SETTINGS, stack=dataclasses.replace(SETTINGS.stack, preview=preview))
    curve = focus_curve(stack, settings, (row, column))
    assert len(curve.z) == len(curve.measure) == 32
    assert np.float32(curve.depth) == xyz[row, column, 2]
    assert curve.z[0] < curve.depth < curve.z[-1]
    assert set(curve.reasons) == {
        name for name, count in count_reasons(cloud.reasons[row : row + 1, column : column + 1]).items() if count
    }


def test_frames_that_give_no_cloud_say_why(stack):
    with pytest.raises(StackError, match='no focus curve: .*three different z'):
        focus_curve(stack[:3], SETTINGS, (0, 0))
    with pytest.raises(StackError, match='they end before the stack does'):
        focus_curve([], SETTINGS, (0, 0))
