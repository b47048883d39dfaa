"""The pictures of the experiments, as PNG bytes."""

import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask
from socialcircle_ros.report.pictures import any_in_tile, new_figure, thinned

from .labelled_clouds import LabelledCloud

Heights = npt.NDArray[Any]
Answers = Sequence[tuple[str, Mask]]
"""Names of filters, and what each called outliers, (H, W) bool."""

_KEPT, _REMOVED, _MISSED, _LOST, _UNCOUNTED = '#e4e4e4', '#7db4d8', '#d00000', '#111111', '#ffffff'
_WORDS = {
    _KEPT: 'good, kept',
    _REMOVED: 'outlier, removed',
    _MISSED: 'outlier, missed',
    _LOST: 'good, removed',
    _UNCOUNTED: 'ambiguous or not measured',
}
_COLOURS = ('black', '#0072b2', '#d55e00', '#009e73')


def removal_maps(cloud: LabelledCloud, answers: Answers) -> bytes:
    """Heights that each filter leaves, and, where outliers are densest, what was right and wrong about it."""
    z = cloud.points[..., 2]
    low, high = _range(cloud.z_true)
    box = densest_box(cloud.outlier)
    count = len(answers) + 1
    figure = new_figure(3.9 * count, 6.8)
    axes = figure.subplots(2, count)
    shown: dict[str, Any] = {'cmap': 'viridis', 'vmin': low, 'vmax': high, 'interpolation': 'nearest'}
    everything = [('as measured', np.zeros_like(cloud.outlier)), *answers]
    for axis, (name, found) in zip(axes[0], everything, strict=True):
        image = axis.imshow(thinned(np.where(found, np.nan, z)), extent=_extent(z.shape, cloud.pitch), **shown)
        axis.set_title(name)
        _frame(axis, box, cloud.pitch)
    axes[0, 0].set_ylabel('what remains')
    figure.colorbar(image, ax=axes[0], label='z [µm]', shrink=0.8)
    part: dict[str, Any] = {'extent': _box_extent(box, cloud.pitch), 'interpolation': 'nearest'}
    axes[1, 0].imshow(z[box], **(shown | part))
    axes[1, 0].set_ylabel('the framed part')
    for axis, (_, found) in zip(axes[1, 1:], answers, strict=True):
        axis.imshow(_judged_colours(cloud, found, box), **part)
    for axis in axes[1]:
        axis.set_xlabel('x, y [µm]')
    _legend(figure, axes[1, -1], _WORDS)
    return _png(figure)


def densest_box(outlier: Mask, share: float = 0.18) -> tuple[slice, slice]:
    """The part of the cloud, `share` of its sides, that holds most outliers."""
    rows, columns = (max(24, round(share * extent)) for extent in outlier.shape)
    starts = [
        (top, left)
        for top in range(0, outlier.shape[0] - rows + 1, max(1, rows // 2))
        for left in range(0, outlier.shape[1] - columns + 1, max(1, columns // 2))
    ]
    top, left = max(
        starts, key=lambda at: np.count_nonzero(outlier[at[0] : at[0] + rows, at[1] : at[1] + columns])
    )
    return slice(top, top + rows), slice(left, left + columns)


def contamination(
    shares: Sequence[float], curves: Mapping[tuple[str, str], Mapping[str, Sequence[float]]]
) -> bytes:
    """F1 over the share of outliers: a panel for each (scene, kind), a curve for each filter and variant."""
    scenes = list(dict.fromkeys(scene for scene, _ in curves))
    kinds = list(dict.fromkeys(kind for _, kind in curves))
    figure = new_figure(4.5 * len(kinds), 3.6 * len(scenes))
    axes = figure.subplots(len(scenes), len(kinds), sharex=True, sharey=True, squeeze=False)
    for (scene, kind), curve in curves.items():
        axis = axes[scenes.index(scene), kinds.index(kind)]
        filters = list(dict.fromkeys(name.rpartition(', ')[0] for name in curve))
        for name, values in curve.items():
            own, _, variant = name.rpartition(', ')
            number = filters.index(own)
            style = '-' if variant == 'best' else '--'
            axis.plot(
                [100 * share for share in shares], values, style, color=_COLOURS[number], label=name,
                marker='os^v'[number], markersize=4, linewidth=2.4 if number == 0 else 1.4,
            )  # fmt: skip
        axis.set_title(f'{scene}, {kind}')
        axis.grid(alpha=0.3)
        axis.set_ylim(-0.02, 1.03)
    for axis in axes[-1]:
        axis.set_xlabel('outliers [%]')
    for axis in axes[:, 0]:
        axis.set_ylabel('F1')
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc='outside lower center', ncols=4)
    return _png(figure)


def elections(panels: Sequence[tuple[str, LabelledCloud, tuple[slice, slice], tuple[int, int]]]) -> bytes:
    """Vote regions as point clouds, the elected seed in red: as the paper's figure 4.

    Args:
        panels: title, cloud, vote region, and row and column of the seed in the cloud.
    """
    figure = new_figure(5.2 * len(panels), 5.2)
    for number, (title, cloud, region, seed) in enumerate(panels, 1):
        axis = figure.add_subplot(1, len(panels), number, projection='3d')
        x, y, z = cloud.points[region].reshape(-1, 3).T
        bad = cloud.outlier[region].ravel()
        axis.scatter(x[~bad], y[~bad], z[~bad], s=3, color='#7d8b99', label='good', depthshade=False)
        axis.scatter(x[bad], y[bad], z[bad], s=3, color='#e69f00', label='outlier', depthshade=False)
        # Drawn over everything: the seed of a rough surface lies amid its neighbours.
        axis.scatter(
            *cloud.points[seed], s=110, color='#d00000', marker='o', label='seed', zorder=1000, depthshade=False
        )
        axis.computed_zorder = False
        axis.set(title=title, xlabel='x [µm]', ylabel='y [µm]', zlabel='z [µm]')
        axis.view_init(elev=18, azim=-60)
    figure.legend(*axis.get_legend_handles_labels(), loc='outside lower center', ncols=3, markerscale=1.5)
    return _png(figure)


def repaired_surfaces(cloud: LabelledCloud, repaired: Sequence[tuple[str, npt.NDArray[Any]]]) -> bytes:
    """Filtered and repaired surfaces under a slanting light, and below how far they are off the true one.

    Args:
        cloud: the cloud and its truth.
        repaired: title and heights (H, W), NaN where nothing is.
    """
    from matplotlib.colors import LightSource, LogNorm  # noqa: PLC0415 - an extra

    box = densest_box(cloud.outlier, 0.3)
    low, high = _range(cloud.z_true)
    light = LightSource(azdeg=315, altdeg=40)
    everything = [('as measured', cloud.points[..., 2]), *repaired]
    figure = new_figure(3.9 * len(everything), 6.8)
    axes = figure.subplots(2, len(everything), sharex=True, sharey=True)
    extent = _box_extent(box, cloud.pitch)
    nearest, furthest = 0.05 * cloud.pitch, 50 * cloud.pitch
    for (above, below), (name, heights) in zip(axes.T, everything, strict=True):
        z = heights[box].astype(np.float64)
        filled = np.where(np.isfinite(z), np.clip(z, low - 20 * cloud.pitch, high + 20 * cloud.pitch), np.nan)
        shaded = light.shade(
            np.ma.masked_invalid(filled), cmap=_colour_map(), vmin=low, vmax=high, blend_mode='soft',
            dx=cloud.pitch, dy=cloud.pitch,
        )  # fmt: skip
        shaded[~np.isfinite(z)] = 1.0
        above.imshow(shaded, extent=extent, interpolation='nearest')
        above.set_title(name)
        error = np.maximum(np.abs(z - cloud.z_true[box]), nearest)
        image = below.imshow(
            error, extent=extent, interpolation='nearest', cmap='magma_r', norm=LogNorm(nearest, furthest)
        )
    axes[0, 0].set_ylabel('lit from the upper left')
    axes[1, 0].set_ylabel('distance to the true surface')
    figure.colorbar(image, ax=axes, label='|z − true z| [µm]', shrink=0.7)
    return _png(figure)


def real_surface(points: npt.NDArray[Any], unit: str, answers: Answers) -> bytes:
    """A measured surface, and for each filter what it leaves, with what it removed in red below."""
    z = points[..., 2].astype(np.float64)
    low, high = _range(z)
    height = 3.1 * min(max(z.shape[0] / z.shape[1], 0.4), 2.0)
    figure = new_figure(3.7 * (len(answers) + 1), 2 * height + 1.6)
    axes = figure.subplots(2, len(answers) + 1)
    shown: dict[str, Any] = {'interpolation': 'nearest', 'vmin': low, 'vmax': high, 'aspect': 'auto'}
    titled = [(f'{name}\n{np.count_nonzero(found):,} removed', found) for name, found in answers]
    everything = [('as measured\n', np.zeros(z.shape, np.bool_)), *titled]
    for (above, below), (name, found) in zip(axes.T, everything, strict=True):
        image = above.imshow(thinned(np.where(found, np.nan, z)), cmap='viridis', **shown)
        above.set_title(name)
        below.imshow(thinned(z), cmap='gray', **shown)
        red = np.zeros((*thinned(found).shape, 4))
        red[any_in_tile(found)] = (0.85, 0, 0, 1)
        below.imshow(red, interpolation='nearest', aspect='auto')
        for axis in (above, below):
            axis.set_xticks([])
            axis.set_yticks([])
    axes[0, 0].set_ylabel('what remains')
    axes[1, 0].set_ylabel('what was removed, in red')
    figure.colorbar(image, ax=axes, label=f'z [{unit}]', shrink=0.7)
    return _png(figure)


def spikes(z: Heights, unit: str, spikes: Mask, found: Mask) -> bytes:
    """A measured surface; the part of it with most spikes, which of its points are, and what was removed there.

    Args:
        z: (H, W) heights, NaN where not measured.
        unit: of the heights.
        spikes: (H, W) bool, the points that stand out.
        found: (H, W) bool, what was removed.
    """
    box = densest_box(spikes, 0.2)
    low, high = _range(z)
    least, most = _range(z[box])
    figure = new_figure(15, 4.6)
    axes = figure.subplots(1, 4)
    shown: dict[str, Any] = {'cmap': 'gray', 'vmin': low, 'vmax': high, 'interpolation': 'nearest'}
    image = axes[0].imshow(thinned(z), extent=_extent(z.shape, 1.0), **shown)
    axes[0].set_title('as measured')
    _frame(axes[0], box, 1.0)
    part: dict[str, Any] = {'extent': _box_extent(box, 1.0), 'interpolation': 'nearest'}
    near = shown | part | {'vmin': least, 'vmax': most}
    marked = [('the framed part', np.zeros_like(found)), ('stand out', spikes), ('removed', found)]
    for axis, (title, mask) in zip(axes[1:], marked, strict=True):
        axis.imshow(z[box], **near)
        red = np.zeros((*mask[box].shape, 4))
        red[mask[box]] = (0.85, 0, 0, 1)
        axis.imshow(red, **part)
        axis.set_title(f'{title}: {np.count_nonzero(mask[box])}' if mask.any() else title)
    figure.colorbar(image, ax=axes, label=f'z [{unit}] of the whole; the part has its own range', shrink=0.7)
    return _png(figure)


def _colour_map() -> Any:
    from matplotlib import colormaps  # noqa: PLC0415 - an extra

    return colormaps['viridis']


def _judged_colours(cloud: LabelledCloud, found: Mask, box: tuple[slice, slice]) -> npt.NDArray[Any]:
    """(h, w, 3): each point of the part in the colour of what the filter did with it."""
    outlier, counted, found = cloud.outlier[box], cloud.counted[box], found[box]
    colours = np.empty((*outlier.shape, 3))
    for where, colour in (
        (~outlier & ~found, _KEPT),
        (outlier & found, _REMOVED),
        (outlier & ~found, _MISSED),
        (~outlier & found, _LOST),
        (~counted, _UNCOUNTED),
    ):
        colours[where] = _rgb(colour)
    return colours


def _rgb(colour: str) -> tuple[float, ...]:
    return tuple(int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))


def _range(heights: npt.NDArray[Any]) -> tuple[float, float]:
    low, high = np.nanpercentile(heights, [0.5, 99.5])
    return float(low), float(high)


def _extent(shape: tuple[int, ...], pitch: float) -> tuple[float, float, float, float]:
    return 0.0, shape[1] * pitch, shape[0] * pitch, 0.0


def _box_extent(box: tuple[slice, slice], pitch: float) -> tuple[float, float, float, float]:
    rows, columns = box
    return columns.start * pitch, columns.stop * pitch, rows.stop * pitch, rows.start * pitch


def _frame(axis: Any, box: tuple[slice, slice], pitch: float) -> None:
    """A rectangle round the part that is shown enlarged."""
    left, right, bottom, top = _box_extent(box, pitch)
    axis.plot([left, right, right, left, left], [top, top, bottom, bottom, top], color='#d00000', linewidth=1.5)


def _legend(figure: Any, axis: Any, words: Mapping[str, str]) -> None:
    handles = [
        axis.plot([], [], 's', color=colour, markeredgecolor='#888888', markersize=9, label=text)[0]
        for colour, text in words.items()
    ]
    figure.legend(handles=handles, loc='outside lower center', ncols=len(handles))


def _png(figure: Any) -> bytes:
    """The figure in 256 colours: a third of the size, in a page that holds all pictures itself."""
    from PIL import Image  # noqa: PLC0415 - comes with matplotlib

    drawn, out = io.BytesIO(), io.BytesIO()
    figure.savefig(drawn, format='png')
    with Image.open(drawn) as image:
        image.convert('RGB').quantize(256, dither=Image.Dither.NONE).save(out, format='png', optimize=True)
    return out.getvalue()
