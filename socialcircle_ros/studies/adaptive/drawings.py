# SPDX-License-Identifier: Apache-2.0
"""Picture of the spikes of a measured surface, as PNG bytes."""

from typing import TYPE_CHECKING

import numpy as np

from socialcircle_ros.cloud import Cloud, Mask
from socialcircle_ros.pictures.style import new_figure, png_of
from socialcircle_ros.studies.comparison.plotting import CloudPanels, colour_range, densest_box

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def spikes(points: Cloud, unit: str, spikes: Mask, found: Mask) -> bytes:
    """Draw a measured surface, the part of it with most spikes, and there the spikes and the removed points.

    Args:
        points: (H, W, 3), NaN where not measured.
        unit: of the coordinates.
        spikes: (H, W) bool, points far from the median of their surroundings.
        found: (H, W) bool, removed points.
    """
    box = densest_box(spikes, 0.2)
    z = points[..., 2]
    limits, part_limits = colour_range(z), colour_range(z[box])
    figure: Figure = new_figure(17, 4.6)
    axes = figure.subplots(1, 4)
    whole = CloudPanels(points, unit)
    image = whole.heights(axes[0], z, limits)
    axes[0].set_title('as measured')
    whole.outline(axes[0], box)
    whole.bar(figure, image, [axes[0]], limits)
    part = whole.part(box)
    marked = [('the framed part', np.zeros_like(found)), ('spikes', spikes), ('removed', found)]
    for axis, (title, mask) in zip(axes[1:], marked, strict=True):
        image = part.heights(axis, z[box], part_limits, 'gray')
        part.mark(axis, mask[box])
        axis.set_title(f'{title}: {np.count_nonzero(mask[box]):,}' if mask.any() else title)
    part.bar(figure, image, list(axes[1:]), part_limits)
    return png_of(figure)
