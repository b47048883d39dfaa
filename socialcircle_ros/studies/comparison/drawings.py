# SPDX-License-Identifier: Apache-2.0
"""Pictures of what each filter keeps and removes, as PNG bytes."""

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Cloud, Mask
from socialcircle_ros.pictures import style

from .labelled_clouds import LabelledCloud
from .plotting import CloudPanels, FilterMasks, PlotRegion, colour_range, densest_box

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LEGEND = {
    'good, kept': style.KEPT,
    'outlier, removed': style.OUTLIER,
    'outlier, kept': style.FALSE_NEGATIVE,
    'good, removed': style.FALSE_POSITIVE,
    'undecided': style.UNDECIDED,
    'not measured': style.NOT_MEASURED,
}


def removal_maps(cloud: LabelledCloud, filters: FilterMasks) -> bytes:
    """Draw the heights that each filter keeps, and its decisions in the part with most outliers."""
    z = cloud.points[..., 2]
    limits = colour_range(cloud.z_true)
    box = densest_box(cloud.outlier)
    count = len(filters) + 1
    figure: Figure = style.new_figure(4.1 * count, 7.4)
    axes = figure.subplots(2, count)
    whole = CloudPanels(cloud.points, 'µm')
    part = whole.part(box)
    everything = [('as measured', np.zeros_like(cloud.outlier)), *filters]
    for axis, (name, found) in zip(axes[0], everything, strict=True):
        image = whole.heights(axis, np.where(found, np.nan, z), limits)
        axis.set_title(name)
        whole.outline(axis, box)
    whole.bar(figure, image, list(axes[0]), limits)
    image = part.heights(axes[1, 0], z[box], limits)
    axes[1, 0].set_title('the framed part')
    for axis, (name, found) in zip(axes[1, 1:], filters, strict=True):
        part.colours(axis, _decision_colours(cloud, found, box))
        axis.set_title(f'{name}: decisions')
    part.bar(figure, image, list(axes[1]), limits)
    _add_legend(figure)
    return style.png_of(figure)


def measured_surface(points: Cloud, unit: str, filters: FilterMasks) -> bytes:
    """Draw a measured surface, what each filter keeps of it, and what each removes in red below."""
    z = points[..., 2].astype(np.float64)
    limits = colour_range(z)
    height = 3.3 * min(max(z.shape[0] / z.shape[1], 0.4), 2.0)
    figure: Figure = style.new_figure(4.1 * (len(filters) + 1), 2 * height + 1.8)
    axes = figure.subplots(2, len(filters) + 1)
    maps = CloudPanels(points, unit)
    titled = [(f'{name}\n{np.count_nonzero(found):,} removed', found) for name, found in filters]
    everything = [('as measured\n', np.zeros(z.shape, np.bool_)), *titled]
    for (above, below), (name, found) in zip(axes.T, everything, strict=True):
        image = maps.heights(above, np.where(found, np.nan, z), limits)
        above.set_title(name)
        gray = maps.heights(below, z, limits, 'gray')
        maps.mark(below, found)
        below.set_title('removed, in red' if found.any() else '')
    maps.bar(figure, image, list(axes[0]), limits)
    maps.bar(figure, gray, list(axes[1]), limits)
    return style.png_of(figure)


def _decision_colours(cloud: LabelledCloud, found: Mask, box: PlotRegion) -> npt.NDArray[np.float64]:
    """(h, w, 3): the colour of the filter's decision at each point of a part."""
    from matplotlib.colors import to_rgb  # noqa: PLC0415 - an extra

    outlier, counted, found = cloud.outlier[box], cloud.counted[box], found[box]
    measured = np.isfinite(cloud.points[box][..., 2])
    colours = np.empty((*outlier.shape, 3))
    for where, name in (
        (~outlier & ~found, 'good, kept'),
        (outlier & found, 'outlier, removed'),
        (outlier & ~found, 'outlier, kept'),
        (~outlier & found, 'good, removed'),
        (~counted, 'undecided'),
        (~measured, 'not measured'),
    ):
        colours[where] = to_rgb(_LEGEND[name])
    return colours


def _add_legend(figure: 'Figure') -> None:
    from matplotlib.patches import Patch  # noqa: PLC0415 - an extra

    handles = [Patch(facecolor=colour, edgecolor='gray', lw=0.3, label=name) for name, colour in _LEGEND.items()]
    style.legend_below(figure, handles, len(handles))
