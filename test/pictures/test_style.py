# SPDX-License-Identifier: Apache-2.0
"""The style of all pictures."""

import io

import numpy as np
import pytest

from socialcircle_ros.pictures.style import OUTLIER, few_colours

Image = pytest.importorskip('PIL.Image')
colormaps = pytest.importorskip('matplotlib').colormaps
to_rgb = pytest.importorskip('matplotlib.colors').to_rgb


def test_a_colour_of_few_dots_stays():
    ramp = np.linspace(0, 1, 300 * 200).reshape(200, 300)
    maps = [255 * colormaps[name](ramp)[..., :3] for name in ('viridis', 'magma', 'gray', 'RdBu_r')]
    dots = np.concatenate(maps, axis=1).astype(np.uint8)
    red = np.round(255 * np.array(to_rgb(OUTLIER)))
    dots[90:92, 40:42] = red
    png = io.BytesIO()
    Image.fromarray(dots).save(png, format='png')
    few = np.asarray(Image.open(io.BytesIO(few_colours(png.getvalue()))).convert('RGB'))
    assert np.abs(few[90, 40] - red).max() < 24
    assert len(np.unique(few.reshape(-1, 3), axis=0)) <= 256
