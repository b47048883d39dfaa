# SPDX-License-Identifier: Apache-2.0
"""Pictures of what each filter keeps and removes, as PNG bytes."""

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Cloud, Mask
from socialcircle_ros.pictures.style import new_figure
from socialcircle_ros.pictures.thinning import any_in_tile, thinned

from .labelled_clouds import LabelledCloud
from .plotting import (
    FilterMasks,
    PlotRegion,
    as_png,
    box_extent,
    colour_range,
    densest_box,
    extent_of,
    outline,
    red_where,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_KEPT, _REMOVED, _MISSED, _LOST, _UNCOUNTED = '#e4e4e4', '#7db4d8', '#d00000', '#111111', '#ffffff'
_LEGEND = {
    _KEPT: 'good, kept',
    _REMOVED: 'outlier, removed',
    _MISSED: 'outlier, missed',
    _LOST: 'good, removed',
    _UNCOUNTED: 'ambiguous or not measured',
}


def removal_maps(cloud: LabelledCloud, filters: FilterMasks) -> bytes:
    """Draw the heights that each filter keeps, and its decisions in the part with most outliers."""
    z = cloud.points[..., 2]
    low, high = colour_range(cloud.z_true)
    box = densest_box(cloud.outlier)
    count = len(filters) + 1
    figure: Figure = new_figure(3.9 * count, 6.8)
    axes = figure.subplots(2, count)
    everything = [('as measured', np.zeros_like(cloud.outlier)), *filters]
    for axis, (name, found) in zip(axes[0], everything, strict=True):
        heights = thinned(np.where(found, np.nan, z))
        image = axis.imshow(
            heights, cmap='viridis', vmin=low, vmax=high, interpolation='nearest',
            extent=extent_of(z.shape, cloud.pitch),
        )  # fmt: skip
        axis.set_title(name)
        outline(axis, box, cloud.pitch)
    axes[0, 0].set_ylabel('what remains')
    figure.colorbar(image, ax=axes[0], label='z [µm]', shrink=0.8)
    show_part = {'extent': box_extent(box, cloud.pitch), 'interpolation': 'nearest'}
    axes[1, 0].imshow(z[box], cmap='viridis', vmin=low, vmax=high, **show_part)
    axes[1, 0].set_ylabel('the framed part')
    for axis, (_, found) in zip(axes[1, 1:], filters, strict=True):
        axis.imshow(_decision_colours(cloud, found, box), **show_part)
    for axis in axes[1]:
        axis.set_xlabel('x, y [µm]')
    _add_legend(figure, axes[1, -1])
    return as_png(figure)


def measured_surface(points: Cloud, unit: str, filters: FilterMasks) -> bytes:
    """Draw a measured surface, what each filter keeps of it, and what each removes in red below."""
    z = points[..., 2].astype(np.float64)
    low, high = colour_range(z)
    height = 3.1 * min(max(z.shape[0] / z.shape[1], 0.4), 2.0)
    figure: Figure = new_figure(3.7 * (len(filters) + 1), 2 * height + 1.6)
    axes = figure.subplots(2, len(filters) + 1)
    titled = [(f'{name}\n{np.count_nonzero(found):,} removed', found) for name, found in filters]
    everything = [('as measured\n', np.zeros(z.shape, np.bool_)), *titled]
    for (above, below), (name, found) in zip(axes.T, everything, strict=True):
        image = above.imshow(
            thinned(np.where(found, np.nan, z)), cmap='viridis', vmin=low, vmax=high, interpolation='nearest',
            aspect='auto',
        )  # fmt: skip
        above.set_title(name)
        below.imshow(thinned(z), cmap='gray', vmin=low, vmax=high, interpolation='nearest', aspect='auto')
        below.imshow(red_where(any_in_tile(found)), interpolation='nearest', aspect='auto')
        for axis in (above, below):
            axis.set_xticks([])
            axis.set_yticks([])
    axes[0, 0].set_ylabel('what remains')
    axes[1, 0].set_ylabel('what was removed, in red')
    figure.colorbar(image, ax=axes, label=f'z [{unit}]', shrink=0.7)
    return as_png(figure)


def _decision_colours(cloud: LabelledCloud, found: Mask, box: PlotRegion) -> npt.NDArray[np.float64]:
    """(h, w, 3): the colour of the filter's decision at each point of a part."""
    from matplotlib.colors import to_rgb  # noqa: PLC0415 - an extra

    outlier, counted, found = cloud.outlier[box], cloud.counted[box], found[box]
    colours = np.empty((*outlier.shape, 3))
    for where, colour in (
        (~outlier & ~found, _KEPT),
        (outlier & found, _REMOVED),
        (outlier & ~found, _MISSED),
        (~outlier & found, _LOST),
        (~counted, _UNCOUNTED),
    ):
        colours[where] = to_rgb(colour)
    return colours


def _add_legend(figure: 'Figure', axis: 'Axes') -> None:
    handles = [
        axis.plot([], [], 's', color=colour, markeredgecolor='#888888', markersize=9, label=text)[0]
        for colour, text in _LEGEND.items()
    ]
    figure.legend(handles=handles, loc='outside lower center', ncols=len(handles))
