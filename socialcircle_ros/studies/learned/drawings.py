# SPDX-License-Identifier: Apache-2.0
"""Pictures of judged clouds and of learning curves, as PNG bytes."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from socialcircle_ros.cloud import Mask
from socialcircle_ros.pictures.style import new_figure
from socialcircle_ros.studies.adaptive.inserted_outliers import ContaminatedSurface
from socialcircle_ros.studies.comparison.plotting import as_png, box_extent, colour_range, densest_box, red_where

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def judged(surface: ContaminatedSurface, found: Mask) -> bytes:
    """Draw the part with most errors: heights, the truth, missed outliers, and removed good points.

    Args:
        surface: with inserted outliers.
        found: (H, W) bool, removed points.
    """
    missed: Mask = surface.outlier & surface.counted & ~found
    wrong: Mask = found & surface.counted & ~surface.outlier
    box = densest_box(missed | wrong, 0.25)
    heights = surface.points[..., 2]
    low, high = colour_range(heights[box])
    extent = box_extent(box, 1.0)
    figure: Figure = new_figure(15, 4.4)
    marked = [
        ('heights', np.zeros_like(found)), ('inserted outliers', surface.outlier), ('missed', missed),
        ('good points removed', wrong),
    ]  # fmt: skip
    for axis, (title, mask) in zip(figure.subplots(1, 4), marked, strict=True):
        axis.imshow(heights[box], cmap='gray', vmin=low, vmax=high, interpolation='nearest', extent=extent)
        axis.imshow(red_where(mask[box]), extent=extent, interpolation='nearest')
        axis.set_title(f'{title}: {np.count_nonzero(mask[box])}' if mask.any() else title)
    return as_png(figure)


def learning_curve(steps: Sequence[int], losses: Sequence[float]) -> bytes:
    """Draw the mean loss against the step, both logarithmic."""
    figure: Figure = new_figure(8, 4)
    axis = figure.subplots()
    axis.loglog(steps, losses)
    axis.set_xlabel('step')
    axis.set_ylabel('loss')
    axis.grid(visible=True, which='both', alpha=0.3)
    return as_png(figure)
