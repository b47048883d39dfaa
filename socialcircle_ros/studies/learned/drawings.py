# SPDX-License-Identifier: Apache-2.0
"""Pictures of judged clouds and of learning curves, as PNG bytes."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from socialcircle_ros.cloud import Mask
from socialcircle_ros.pictures.style import new_figure, png_of
from socialcircle_ros.studies.adaptive.inserted_outliers import ContaminatedSurface
from socialcircle_ros.studies.comparison.plotting import CloudPanels, colour_range, densest_box

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def judged(surface: ContaminatedSurface, unit: str, found: Mask) -> bytes:
    """Draw the part with most errors: heights, the truth, missed outliers, and removed good points.

    Args:
        surface: with inserted outliers.
        unit: of its coordinates.
        found: (H, W) bool, removed points.
    """
    missed: Mask = surface.outlier & surface.counted & ~found
    wrong: Mask = found & surface.counted & ~surface.outlier
    box = densest_box(missed | wrong, 0.25)
    part = CloudPanels(surface.points, unit).part(box)
    heights = surface.points[box][..., 2]
    limits = colour_range(heights)
    figure: Figure = new_figure(17, 4.6)
    axes = figure.subplots(1, 4)
    marked = [
        ('heights', np.zeros_like(found)), ('inserted outliers', surface.outlier), ('missed', missed),
        ('good points removed', wrong),
    ]  # fmt: skip
    for axis, (title, mask) in zip(axes, marked, strict=True):
        image = part.heights(axis, heights, limits, 'gray')
        part.mark(axis, mask[box])
        axis.set_title(f'{title}: {np.count_nonzero(mask[box]):,}' if mask.any() else title)
    part.bar(figure, image, list(axes), limits)
    return png_of(figure)


def learning_curve(steps: Sequence[int], losses: Sequence[float]) -> bytes:
    """Draw the mean loss against the step, both logarithmic."""
    figure: Figure = new_figure(8, 4)
    axis = figure.subplots()
    axis.loglog(steps, losses)
    axis.set_xlabel('step')
    axis.set_ylabel('loss')
    axis.grid(visible=True, which='both', alpha=0.3)
    return png_of(figure)
