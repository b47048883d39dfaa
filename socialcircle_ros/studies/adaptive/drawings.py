# SPDX-License-Identifier: Apache-2.0
"""Picture of the spikes of a measured surface, as PNG bytes."""

from typing import TYPE_CHECKING

import numpy as np

from socialcircle_ros.cloud import HeightMap, Mask
from socialcircle_ros.pictures.style import new_figure
from socialcircle_ros.pictures.thinning import thinned
from socialcircle_ros.studies.comparison.plotting import (
    as_png,
    box_extent,
    colour_range,
    densest_box,
    extent_of,
    outline,
    red_where,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def spikes(z: HeightMap, unit: str, spikes: Mask, found: Mask) -> bytes:
    """Draw a measured surface, the part of it with most spikes, and there the spikes and the removed points.

    Args:
        z: (H, W) heights, NaN where not measured.
        unit: of the heights.
        spikes: (H, W) bool, points far from the median of their surroundings.
        found: (H, W) bool, removed points.
    """
    box = densest_box(spikes, 0.2)
    extent = box_extent(box, 1.0)
    low, high = colour_range(z)
    part_low, part_high = colour_range(z[box])
    figure: Figure = new_figure(15, 4.6)
    axes = figure.subplots(1, 4)
    image = axes[0].imshow(
        thinned(z), cmap='gray', vmin=low, vmax=high, interpolation='nearest', extent=extent_of(z.shape, 1.0)
    )
    axes[0].set_title('as measured')
    outline(axes[0], box, 1.0)
    marked = [('the framed part', np.zeros_like(found)), ('spikes', spikes), ('removed', found)]
    for axis, (title, mask) in zip(axes[1:], marked, strict=True):
        axis.imshow(z[box], cmap='gray', vmin=part_low, vmax=part_high, interpolation='nearest', extent=extent)
        axis.imshow(red_where(mask[box]), extent=extent, interpolation='nearest')
        axis.set_title(f'{title}: {np.count_nonzero(mask[box])}' if mask.any() else title)
    figure.colorbar(image, ax=axes, label=f'z [{unit}] of the whole; the part has its own range', shrink=0.7)
    return as_png(figure)
