# SPDX-License-Identifier: Apache-2.0
"""Pictures of the paper's experiments, as PNG bytes."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from socialcircle_ros.cloud import HeightMap
from socialcircle_ros.pictures import style
from socialcircle_ros.pictures.style import legend_below, new_figure, png_of
from socialcircle_ros.studies.comparison.labelled_clouds import LabelledCloud
from socialcircle_ros.studies.comparison.plotting import (
    CloudPanels,
    PlotRegion,
    colour_range,
    densest_box,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COLOURS = ('black', '#0072b2', '#d55e00', '#009e73')
_MARKERS = 'os^v'


def contamination_curves(
    shares: Sequence[float], curves: Mapping[tuple[str, str], Mapping[str, Sequence[float]]]
) -> bytes:
    """Draw F1 against the share of outliers.

    Args:
        shares: of outliers, S.
        curves: for each scene and outlier kind (one panel each), by the label of a method: S values of F1.
    """
    scenes = list(dict.fromkeys(scene for scene, _ in curves))
    kinds = list(dict.fromkeys(kind for _, kind in curves))
    figure: Figure = new_figure(4.5 * len(kinds), 3.6 * len(scenes))
    axes = figure.subplots(len(scenes), len(kinds), sharex=True, sharey=True, squeeze=False)
    percent = [100 * share for share in shares]
    for (scene, kind), curve in curves.items():
        axis = axes[scenes.index(scene), kinds.index(kind)]
        filters = list(dict.fromkeys(label.rpartition(', ')[0] for label in curve))
        for label, values in curve.items():
            name, _, variant = label.rpartition(', ')
            number = filters.index(name)
            axis.plot(
                percent, values, '-' if variant == 'best' else '--', color=_COLOURS[number], label=label,
                marker=_MARKERS[number], markersize=4, linewidth=2.4 if number == 0 else 1.4,
            )  # fmt: skip
        axis.set_title(f'{scene}, {kind}')
        axis.grid(alpha=0.3)
        axis.set_ylim(-0.02, 1.03)
    for axis in axes[-1]:
        axis.set_xlabel('outliers [%]')
    for axis in axes[:, 0]:
        axis.set_ylabel('F1')
    legend_below(figure, axes[0, 0].get_legend_handles_labels()[0], 4)
    return png_of(figure)


def elections(panels: Sequence[tuple[str, LabelledCloud, PlotRegion, tuple[int, int]]]) -> bytes:
    """Draw vote regions as point clouds with the elected seed in black, as the paper's figure 4.

    Args:
        panels: title, cloud, vote region, and row and column of the seed in the cloud.
    """
    figure: Figure = new_figure(5.2 * len(panels), 5.2)
    for number, (title, cloud, region, seed) in enumerate(panels, 1):
        axis = figure.add_subplot(1, len(panels), number, projection='3d')
        x, y, z = cloud.points[region].reshape(-1, 3).T
        bad = cloud.outlier[region].ravel()
        axis.scatter(x[~bad], y[~bad], z[~bad], s=3, color=style.SURFACE, label='good', depthshade=False)
        axis.scatter(x[bad], y[bad], z[bad], s=3, color=style.OUTLIER, label='outlier', depthshade=False)
        # The neighbours of a seed on a rough surface would hide it: it is drawn last.
        axis.scatter(
            *cloud.points[seed], s=130, color='black', edgecolor='white', marker='o', label='seed', zorder=1000,
            depthshade=False,
        )  # fmt: skip
        axis.computed_zorder = False
        axis.set(title=title, xlabel='x [µm]', ylabel='y [µm]', zlabel='z [µm]')
        axis.view_init(elev=18, azim=-60)
        axis.set_box_aspect((4, 4, 3), zoom=0.85)  # the label of z is not cut off
    legend_below(figure, axis.get_legend_handles_labels()[0], 3, 1.5)
    return png_of(figure)


def repaired_surfaces(cloud: LabelledCloud, repaired: Sequence[tuple[str, HeightMap]]) -> bytes:
    """Draw filtered and repaired surfaces under oblique light, and their distance to the true surface below.

    Args:
        cloud: the cloud and its truth.
        repaired: title and heights (H, W), NaN where there is no height.
    """
    from matplotlib import colormaps  # noqa: PLC0415 - an extra
    from matplotlib.cm import ScalarMappable  # noqa: PLC0415 - an extra
    from matplotlib.colors import LightSource, LogNorm, Normalize, to_rgba  # noqa: PLC0415 - an extra

    box = densest_box(cloud.outlier, 0.3)
    low, high = colour_range(cloud.z_true)
    light = LightSource(azdeg=315, altdeg=40)
    everything = [('as measured', cloud.points[..., 2]), *repaired]
    figure: Figure = new_figure(4.1 * len(everything), 7.4)
    axes = figure.subplots(2, len(everything))
    part = CloudPanels(cloud.points, 'µm').part(box)
    nearest, furthest = 0.05 * cloud.pitch, 50 * cloud.pitch
    for (above, below), (name, heights) in zip(axes.T, everything, strict=True):
        z = heights[box].astype(np.float64)
        filled = np.where(np.isfinite(z), np.clip(z, low - 20 * cloud.pitch, high + 20 * cloud.pitch), np.nan)
        shaded = light.shade(
            np.ma.masked_invalid(filled), cmap=colormaps[style.HEIGHTS], vmin=low, vmax=high, blend_mode='soft',
            dx=cloud.pitch, dy=cloud.pitch,
        )  # fmt: skip
        shaded[~np.isfinite(z)] = to_rgba(style.NOT_MEASURED)
        part.colours(above, shaded)
        above.set_title(name)
        error = np.maximum(np.abs(z - cloud.z_true[box]), nearest)
        image = part.heights(below, error, (nearest, furthest), 'magma_r')
        image.set_norm(LogNorm(nearest, furthest))
        below.set_title('distance to the true surface')
    ground = ScalarMappable(Normalize(low, high), style.HEIGHTS)
    part.bar(figure, ground, list(axes[0]), (low, high), 'lit from the upper left: z')
    figure.colorbar(image, ax=list(axes[1]), label='|z − true z| [µm]', shrink=0.8, extend='both')
    return png_of(figure)
