# SPDX-License-Identifier: Apache-2.0
"""Axes of the scene."""

import itertools

import numpy as np
import pytest
from examples import surface

from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.image import KEPT
from socialcircle_ros.messages.point_cloud import PointCloud, encode_point_cloud
from socialcircle_ros.panel.axes import axes_of
from socialcircle_ros.panel.display import Display, drawing_of
from socialcircle_ros.panel.view import SIDE, view_of


@pytest.mark.parametrize(('rows', 'columns'), [(40, 50), (50, 40), (20, 120), (90, 30)])
@pytest.mark.parametrize('stretch', [0.2, 1.0, 5.0])
def test_no_label_covers_one_of_another_axis(rows, columns, stretch):
    xyz = surface(120, 130)[:rows, :columns]
    cloud = PointCloud.decode(encode_point_cloud(Header.at(1, 'part'), xyz))
    mask = np.full((rows, columns), KEPT, np.uint8)
    labels = axes_of(view_of(drawing_of(cloud, mask, Display(), 'm')), stretch).labels
    places = np.array([place for _, place in labels])
    names = [next(index for index, (text, _) in enumerate(labels) if text.startswith(axis)) for axis in 'xyz']
    assert len(set(names)) == 3
    heights = places[:, 0] > places[names[0], 0] + SIDE / 40  # labels of z stand right of the cloud
    of_z, others = places[heights & (places[:, 0] > places[:, 0].max() - 1e-6)], places[~heights]
    assert len(of_z) > 1
    # Seen from the front or from above, a number is about SIDE / 20 wide.
    for first, second in itertools.product(of_z, others):
        assert np.hypot(*(first - second)[:2]) > SIDE / 20
