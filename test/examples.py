# SPDX-License-Identifier: Apache-2.0
"""A small cloud of known outliers, for tests of what lies above the filter."""

import numpy as np

from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.point_cloud import encode_point_cloud


def cloud(rows=70, columns=80, *, seed=0, stamp=1_000_000_000):
    """A serialized cloud of a gentle surface with a spike, a cluster and a hole: 26 outliers, 6 not measured."""
    return encode_point_cloud(Header.at(stamp, 'microscope'), surface(rows, columns, seed=seed))


def marked(mark, rows=70, columns=80):
    """The surface 100 higher. Its left sixth and the points left of a cluster are not measured: `mark`, (3,).

    None in the mark leaves a coordinate as it is.
    """
    xyz = surface(rows, columns)
    xyz[..., 2] += 100
    points = np.zeros((rows, columns), bool)
    points[:, : columns // 6] = True
    points[40:45, 48:50] = True
    for axis, value in enumerate(mark):
        if value is not None:
            xyz[points, axis] = value
    return xyz


MARKS = {'the origin': (0.0, 0.0, 0.0), 'a height': (None, None, 0.0)}
NAN = (np.nan, np.nan, np.nan)


def surface(rows=70, columns=80, *, seed=0):
    y, x = np.mgrid[:rows, :columns].astype(np.float32)
    z = np.sin(x / 9) + 0.1 * np.random.default_rng(seed).random((rows, columns)).astype(np.float32)
    z[10:11, 12:13], z[40:45, 50:55], z[20:22, :3] = 30, -25, np.nan
    return np.dstack([x, y, z])
