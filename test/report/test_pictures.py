"""The picture of a cloud before and after the filter."""

import numpy as np
import pytest
from examples import surface

from socialcircle_ros.report.pictures import before_and_after

matplotlib_image = pytest.importorskip('matplotlib.image')


@pytest.mark.parametrize('shape', [(70, 80), (1700, 300)])
def test_outliers_are_red_even_in_a_thinned_picture(tmp_path, shape):
    xyz = surface(*shape)
    outliers = np.zeros(shape, bool)
    outliers[11:13, 13:17] = True
    before_and_after(tmp_path / 'new' / 'picture.png', xyz, outliers, 'a title', 'um')
    pixels = matplotlib_image.imread(tmp_path / 'new' / 'picture.png')[..., :3]
    red = (pixels[..., 0] > 0.9) & (pixels[..., 1] < 0.1) & (pixels[..., 2] < 0.1)
    assert red.any()


def test_a_cloud_without_a_kept_point_can_be_drawn(tmp_path):
    xyz = surface()
    before_and_after(tmp_path / 'picture.png', xyz, np.isfinite(xyz[..., 2]), 'nothing left')
    assert (tmp_path / 'picture.png').stat().st_size > 0
