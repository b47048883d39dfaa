# SPDX-License-Identifier: Apache-2.0
"""Clouds that are written, as another program reads them."""

import numpy as np
import pytest

from socialcircle_ros.formats import MeasuredSurface, write_surface

HEIGHTS = np.array([[1.1, 2.2, 3.3], [4.4, np.nan, 6.6]])


@pytest.mark.parametrize('kind', ['f4', 'f8'])
@pytest.mark.parametrize('suffix', ['.ply', '.pcd'])
def test_open3d_reads_the_points(tmp_path, suffix, kind):
    open3d = pytest.importorskip('open3d', reason='Open3D, which reads ply and pcd, is not installed')
    surface = MeasuredSurface(HEIGHTS.astype(kind), (0.5, 0.25), 'm')
    write_surface(tmp_path / f'a{suffix}', surface)
    read = open3d.t.io.read_point_cloud(str(tmp_path / f'a{suffix}'), remove_nan_points=False)
    np.testing.assert_array_equal(read.point['positions'].numpy(), surface.cloud().points.reshape(-1, 3))
    if suffix == '.pcd' and kind == 'f8':
        return  # read as zeros by the older function of Open3D, as are its own files
    old = open3d.io.read_point_cloud(str(tmp_path / f'a{suffix}'), remove_nan_points=False)
    np.testing.assert_array_equal(np.asarray(old.points), surface.cloud().points.reshape(-1, 3))
