# SPDX-License-Identifier: Apache-2.0
"""Legends below the axes, with every matplotlib that is supported."""

import pytest

pytest.importorskip('matplotlib')
from matplotlib.backends.backend_agg import FigureCanvasAgg

from socialcircle_ros.pictures.style import legend_below, new_figure


@pytest.mark.parametrize(('count', 'columns'), [(3, 3), (5, 2)])
def test_a_legend_below_covers_no_axes(count, columns):
    figure = new_figure(8, 4)
    axes = figure.subplots(1, 2)
    for axis in axes:
        for number in range(count):
            axis.plot([0, 1], [0, number], label=f'filter {number}')
        axis.set_xlabel('outliers [%]')
    legend_below(figure, axes[0].get_legend_handles_labels()[0], columns)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    below = figure.legends[0].get_window_extent(canvas.get_renderer())
    assert below.y0 >= 0
    assert all(below.y1 <= axis.get_tightbbox(canvas.get_renderer()).y0 + 1 for axis in axes)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [f'filter {n}' for n in range(count)]
