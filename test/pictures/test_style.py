# SPDX-License-Identifier: Apache-2.0
"""The style of all pictures."""

import io

import numpy as np
import pytest

from socialcircle_ros.pictures.style import OUTLIER, new_figure, png_of

Image = pytest.importorskip('PIL.Image')
colormaps = pytest.importorskip('matplotlib').colormaps
to_rgb = pytest.importorskip('matplotlib.colors').to_rgb


def test_a_colour_of_few_dots_stays():
    ramp = np.linspace(0, 1, 300 * 200).reshape(200, 300)
    maps = [255 * colormaps[name](ramp)[..., :3] for name in ('viridis', 'magma', 'gray', 'RdBu_r')]
    dots = np.concatenate(maps, axis=1).astype(np.uint8)
    red = np.round(255 * np.array(to_rgb(OUTLIER)))
    dots[90:92, 40:42] = red
    figure = new_figure(dots.shape[1] / 100, dots.shape[0] / 100)
    figure.set_layout_engine('none')
    figure.set_dpi(100)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    axes.imshow(dots, interpolation='nearest', aspect='auto')
    few = np.asarray(Image.open(io.BytesIO(png_of(figure))).convert('RGB'))
    assert few.shape == dots.shape
    assert np.abs(few[90, 40] - red).max() < 24
    assert len(np.unique(few.reshape(-1, 3), axis=0)) <= 256


def test_a_picture_shows_what_savefig_shows():
    figure = new_figure(3, 2)
    axes = figure.subplots()
    axes.plot([1, 2, 3], [5, 4, 6])
    axes.set_title('heights')
    png = io.BytesIO()
    figure.savefig(png, format='png')
    wanted = np.asarray(Image.open(png).convert('RGB')).astype(int)
    found = np.asarray(Image.open(io.BytesIO(png_of(figure))).convert('RGB')).astype(int)
    assert found.shape == wanted.shape
    assert np.abs(found - wanted).max() < 24
