# SPDX-License-Identifier: Apache-2.0
"""Pictures of one cloud: maps before and after the filter, what was removed, a profile and a histogram."""

import io
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Cloud, HeightMap, Mask, measured_points, nearest_grid
from socialcircle_ros.lengths import LengthScale, length_scale
from socialcircle_ros.metrics.deviation import deviation
from socialcircle_ros.storage import write_file

from . import style
from .frame import MapFrame, frame_of
from .ranges import deviation_range, height_range
from .thinning import any_in_tile, grown, over_tiles, thinned

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

_SIZE = (4.4, 3.2)  # of a map in inches, with its axes and its colour bar
_WIDE = (8.96, 2.1)  # of a profile
_PIXELS = 640  # along the longer side of a map: about one per dot of the picture
_TILES_SEEN = 200  # along the longer side of a map: of more, a single one is hardly seen
_BINS = 120
_BEYOND = 1.0  # colour ranges that the histogram extends on each side

_NO_POINT, _KEPT, _TRUE_POSITIVE, _FALSE_NEGATIVE, _FALSE_POSITIVE, _UNDECIDED = range(6)
_CLASSES = {
    _TRUE_POSITIVE: ('outlier, removed', style.OUTLIER),
    _FALSE_NEGATIVE: ('outlier, kept', style.FALSE_NEGATIVE),
    _FALSE_POSITIVE: ('good, removed', style.FALSE_POSITIVE),
    _KEPT: ('good, kept', style.KEPT),
    _UNDECIDED: ('undecided', style.UNDECIDED),
    _NO_POINT: ('not measured', style.NOT_MEASURED),
}


@dataclass(frozen=True)
class WorstOutlier:
    """The outlier farthest from the surface round it, and its height over that surface."""

    row: int
    column: int
    height: float


@dataclass(frozen=True, eq=False)
class CloudPictures:
    """Draws one cloud before and after the filter; all maps share one extent, and all heights one colour range.

    Attributes:
        xyz: (H, W, 3) the cloud as measured.
        outliers: (H, W) the removed points.
        unit: of the coordinates; None: not known.
        colours: heights of the first and the last colour; None: those of the kept points.
    """

    xyz: Cloud
    outliers: Mask
    unit: str | None = None
    colours: tuple[float, float] | None = None

    @cached_property
    def heights(self) -> HeightMap:
        """(H, W), NaN where not measured."""
        return np.where(measured_points(self.xyz), self.xyz[..., 2], np.nan)

    @cached_property
    def colour_range(self) -> tuple[float, float]:
        """The heights of the first and the last colour: the kept heights without their outer 1 %."""
        if self.colours is not None:
            return self.colours
        heights, outliers = thinned(self.heights, _PIXELS), thinned(self.outliers, _PIXELS)
        grid = nearest_grid(self.xyz, measured_points(self.xyz))
        pitch = None if grid is None else grid.pitch
        return height_range(heights, outliers, pitch[0] if pitch else 1.0)

    @cached_property
    def deviations(self) -> npt.NDArray[np.float64]:
        """(H, W) height of each outlier over the surface round it; NaN elsewhere."""
        return deviation(self.heights, self.outliers)

    @cached_property
    def worst(self) -> WorstOutlier | None:
        """The outlier farthest from the surface; None if there is none."""
        size = np.abs(np.nan_to_num(self.deviations))
        if not size.any():
            return None
        row, column = (int(place) for place in np.unravel_index(int(size.argmax()), size.shape))
        return WorstOutlier(row, column, float(self.deviations[row, column]))

    def before(self) -> bytes:
        """The heights as measured; a thinned tile shows its highest outlier."""
        return self._map(self._with_outliers(), 'before: as measured')

    def after(self) -> bytes:
        """The kept heights; removed points look like points that are not measured."""
        return self._map(self._kept(), 'after: outliers removed')

    def against(self, other: 'CloudPictures') -> bytes:
        """Where this result and another one of the same cloud, A and B, differ."""
        names = {
            _TRUE_POSITIVE: 'removed by both',
            _FALSE_NEGATIVE: 'by B only',
            _FALSE_POSITIVE: 'by A only',
            _KEPT: 'kept by both',
        }
        return self._against(other.outliers, np.isfinite(self.heights), 'points removed by A and by B', names)

    def repaired(self, heights: HeightMap) -> bytes:
        """The heights with filled holes.

        Args:
            heights: (H, W), NaN where nothing was filled or measured.
        """
        return self._map(thinned(heights, _PIXELS), 'after: holes filled')

    def difference(self) -> bytes:
        """What the filter changed: kept points gray, outliers by their height over the surface round them."""
        far = np.where(self.outliers, self.deviations, -np.inf)
        near = np.where(self.outliers, self.deviations, np.inf)
        highest, lowest = over_tiles(np.maximum, far, _PIXELS), over_tiles(np.minimum, near, _PIXELS)
        shown = np.where(np.abs(highest) >= np.abs(lowest), highest, lowest)
        seen = grown(np.where(np.isfinite(shown), shown, np.nan), max(shown.shape) // _TILES_SEEN)
        ends = deviation_range(self.deviations, self.colour_range[1] - self.colour_range[0])

        def draw(figure: 'Figure') -> None:
            axes, bar_axes = _map_axes(figure, self._frame.ratio_drawn)
            self._ground(axes)
            image = self._image(axes, seen, style.differences(), ends)
            axes.set_title('difference: what was removed')
            bar = figure.colorbar(image, cax=bar_axes, extend='both')
            length_scale(ends, self.unit).label_axis(bar.ax.yaxis, 'over the surface')

        return style.picture(*_SIZE, draw)

    def against_truth(self, truth: Mask, counted: Mask) -> bytes:
        """The mask against the truth.

        Args:
            truth: (H, W) the outliers.
            counted: (H, W) the points with a certain truth; others are undecided.
        """
        return self._against(truth, counted, 'removed points against the truth', {})

    def _against(self, others: Mask, counted: Mask, title: str, names: Mapping[int, str]) -> bytes:
        classes = _classes(self.outliers, others, counted, np.isfinite(self.heights))

        def draw(figure: 'Figure') -> None:
            axes, _ = _map_axes(figure, self._frame.ratio_drawn, bar=False)
            self._class_image(axes, classes)
            axes.set_title(title)
            _legend(figure, classes, names)

        return style.picture(*_SIZE, draw)

    def profile(self) -> bytes:
        """The row of the worst outlier: kept points as a line, outliers as points."""
        worst = self.worst
        row = worst.row if worst else self.heights.shape[0] // 2
        z, out = self.heights[row], self.outliers[row]
        frame = self._frame
        left, right, _, _ = frame.extent
        x = left + (np.arange(len(z)) + 0.5) * (right - left) / len(z)

        def draw(figure: 'Figure') -> None:
            axes = figure.add_axes((0.075, 0.23, 0.915, 0.63))
            axes.plot(x, np.where(out, np.nan, z), color=style.SURFACE, lw=1, label='kept')
            axes.plot(x[out], z[out], 'o', color=style.OUTLIER, ms=3, label='outlier')
            if worst:
                at = x[worst.column], z[worst.column]
                axes.plot(*at, 'o', mfc='none', mec='black', ms=8, label='worst outlier')
            axes.set_xlim(min(left, right), max(left, right))
            finite = z[np.isfinite(z)]
            self._height_scale(finite).label_axis(axes.yaxis, 'z')
            if frame.scale is None:
                axes.set_xlabel('column')
            else:
                frame.scale.label_axis(axes.xaxis, frame.names[0])
            axes.set_title(
                f'profile along row {row}, through the worst outlier' if worst else f'profile along row {row}',
                loc='left',
            )
            axes.grid(alpha=0.3)
            axes.legend(loc='lower right', bbox_to_anchor=(1, 0.99), ncols=3, frameon=False, borderpad=0.1)

        return style.picture(*_WIDE, draw)

    def histogram(self) -> bytes:
        """The number of kept points and of outliers at each height, with a logarithmic axis."""
        low, high = self.colour_range
        reach = _BEYOND * (high - low)
        edges = np.linspace(low - reach, high + reach, _BINS + 1)
        measured = np.isfinite(self.heights)
        kept, removed = (
            np.histogram(np.clip(self.heights[where].astype(np.float64), edges[0], edges[-1]), edges)[0]
            for where in (measured & ~self.outliers, measured & self.outliers)
        )

        def draw(figure: 'Figure') -> None:
            axes = figure.add_axes((0.14, 0.15, 0.83, 0.75))
            axes.stairs(kept, edges, fill=True, color=style.SURFACE, label='kept')
            axes.stairs(kept + removed, edges, baseline=kept, fill=True, color=style.OUTLIER, label='outlier')
            axes.set_yscale('log', nonpositive='clip')
            axes.set_ylim(0.5, 3.0 * max(1, int((kept + removed).max())))
            axes.set_xlim(edges[0], edges[-1])
            self._height_scale([edges[0], edges[-1]]).label_axis(axes.xaxis, 'z')
            axes.locator_params(axis='x', nbins=6)
            axes.set(ylabel='points', title='heights; the outer bars hold all that lies beyond')
            axes.grid(alpha=0.3)
            axes.legend(loc='upper right')

        return style.picture(*_SIZE, draw)

    def quality(self, values: npt.NDArray[np.floating]) -> bytes:
        """Map the quality of each point, (H, W) 0 to 1."""

        def draw(figure: 'Figure') -> None:
            axes, bar_axes = _map_axes(figure, self._frame.ratio_drawn)
            image = self._image(axes, thinned(values, _PIXELS), style.HEIGHTS, (0.0, 1.0))
            axes.set_title('quality')
            figure.colorbar(image, cax=bar_axes)

        return style.picture(*_SIZE, draw)

    def in_focus(self, picture: npt.NDArray[np.integer]) -> bytes:
        """Show the picture in focus, (H, W) gray or (H, W, 3) red, green, blue, on the map."""

        def draw(figure: 'Figure') -> None:
            axes, bar_axes = _map_axes(figure, self._frame.ratio_drawn)
            if bar_axes is not None:
                bar_axes.set_axis_off()  # the map is as large as the one beside it
            shown = thinned(picture, _PIXELS)
            axes.imshow(shown, cmap='gray', extent=self._frame.extent, interpolation='nearest')
            self._frame.put_on(axes)
            axes.set_title('picture in focus')

        return style.picture(*_SIZE, draw)

    @cached_property
    def _frame(self) -> MapFrame:
        return frame_of(self.xyz, np.isfinite(self.heights), self.unit)

    def _height_scale(self, values: npt.ArrayLike) -> LengthScale:
        return length_scale(values, self.unit)

    def _kept(self) -> HeightMap:
        kept: HeightMap = np.where(thinned(self.outliers, _PIXELS), np.nan, thinned(self.heights, _PIXELS))
        return kept

    def _with_outliers(self) -> HeightMap:
        highest = over_tiles(np.maximum, np.where(self.outliers, self.heights, -np.inf), _PIXELS)
        shown: HeightMap = np.where(np.isfinite(highest), highest, thinned(self.heights, _PIXELS))
        return shown

    def _map(self, heights: HeightMap, title: str) -> bytes:
        def draw(figure: 'Figure') -> None:
            axes, bar_axes = _map_axes(figure, self._frame.ratio_drawn)
            image = self._height_image(axes, heights)
            axes.set_title(title)
            bar = figure.colorbar(image, cax=bar_axes, extend='both')
            self._height_scale(self.colour_range).label_axis(bar.ax.yaxis, 'z')

        return style.picture(*_SIZE, draw)

    def _height_image(self, axes: 'Axes', heights: HeightMap) -> 'AxesImage':
        image = self._image(axes, heights, style.HEIGHTS, self.colour_range)
        axes.set_facecolor(style.NOT_MEASURED)
        return image

    def _image(
        self,
        axes: 'Axes',
        values: npt.NDArray[np.floating],
        colours: 'str | Colormap',
        limits: tuple[float, float],
    ) -> 'AxesImage':
        image = axes.imshow(
            values,
            cmap=colours,
            vmin=limits[0],
            vmax=limits[1],
            extent=self._frame.extent,
            interpolation='nearest',
        )
        self._frame.put_on(axes)
        return image

    def _ground(self, axes: 'Axes') -> None:
        """Kept points gray, points that are not measured orange."""
        measured = thinned(np.isfinite(self.heights), _PIXELS)
        axes.set_facecolor(style.NOT_MEASURED)
        gray = np.where(measured, 0.87, np.nan)
        axes.imshow(gray, cmap='gray', vmin=0, vmax=1, extent=self._frame.extent, interpolation='nearest')

    def _class_image(self, axes: 'Axes', classes: npt.NDArray[np.uint8]) -> None:
        from matplotlib.colors import ListedColormap  # noqa: PLC0415 - an extra

        colours = ListedColormap([_CLASSES[number][1] for number in sorted(_CLASSES)])
        axes.imshow(
            classes, cmap=colours, vmin=-0.5, vmax=len(_CLASSES) - 0.5, extent=self._frame.extent,
            interpolation='nearest',
        )  # fmt: skip
        self._frame.put_on(axes)

    def side_by_side(
        self, title: str, by_mode: Mapping[str, Mask] | None = None, undecided: Mask | None = None
    ) -> 'Figure':
        """Draw maps in one figure: as measured, with the outliers of each mode marked, and filtered.

        Args:
            title: one line at the top.
            by_mode: (H, W) the outliers by the name of the mode; None: those of this object alone.
            undecided: (H, W) the points that the truth leaves undecided; None without a truth.
        """
        found = by_mode or {'': self.outliers}
        measured: Mask = np.isfinite(self.heights)
        unclear = np.zeros_like(measured) if undecided is None else measured & undecided
        ratio = min(max(self._frame.ratio_drawn, 0.5), 3.0)
        figure = style.new_figure(5 * (len(found) + 2), 15 / 3.4 / ratio + 1.4)
        figure.suptitle(textwrap.fill(title, 130))
        panels = figure.subplots(1, len(found) + 2, sharex=True, sharey=True)
        left, *marked, right = panels
        self._height_image(left, self._with_outliers())
        left.set_title('as measured')
        for axes, (name, outliers) in zip(marked, found.items(), strict=True):
            classes = _classes(outliers, outliers, outliers, measured, kept=_KEPT)
            classes[any_in_tile(unclear, _PIXELS)] = _UNDECIDED
            self._class_image(axes, classes)
            axes.set_title(f'{name and name + ": "}{_colours_told(outliers, unclear)}')
        image = self._height_image(right, self._kept())
        shown = next((name for name, outliers in found.items() if outliers is self.outliers), '')
        right.set_title(f'filtered{shown and ", " + shown}; orange: no point')
        bar = figure.colorbar(image, ax=list(panels), shrink=0.9, extend='both')
        self._height_scale(self.colour_range).label_axis(bar.ax.yaxis, 'z')
        return figure


def before_and_after(
    path: Path,
    xyz: Cloud,
    outliers: Mask,
    title: str,
    unit: str | None = None,
    by_mode: Mapping[str, Mask] | None = None,
    undecided: Mask | None = None,
) -> None:
    """Draw height maps side by side: as measured, with the outliers of each mode marked, and filtered.

    All share one colour range, taken from the kept points, so that the outliers do not flatten the rest.
    Large clouds are thinned for display; outliers are always drawn.

    Args:
        path: the PNG file to write; its folder is created.
        xyz: (H, W, 3) the cloud as measured.
        outliers: (H, W) the removed points.
        title: one line at the top.
        unit: of the coordinates; None: not known.
        by_mode: (H, W) the removed points by the name of the mode; None: `outliers` alone.
        undecided: (H, W) the points that the truth leaves undecided; None without a truth.

    Raises:
        SocialCircleError: matplotlib is not installed.
    """
    figure = CloudPictures(xyz, outliers, unit).side_by_side(title, by_mode, undecided)
    path.parent.mkdir(parents=True, exist_ok=True)
    out = io.BytesIO()
    figure.savefig(out, format='png')
    write_file(path, out.getvalue())


def _colours_told(outliers: Mask, undecided: Mask) -> str:
    """How many outliers a panel shows, and in which colours."""
    count, unclear = np.count_nonzero(outliers), np.count_nonzero(outliers & undecided)
    if not undecided.any():
        return f'{count:,} outliers in red'
    told = f'{count:,} outliers, {count - unclear:,} in red'
    return f'{told};\nviolet: undecided by the truth, with {unclear:,} outliers'


def _map_axes(figure: 'Figure', ratio: float, *, bar: bool = True) -> tuple['Axes', 'Axes | None']:
    """The axes of a map with some ratio of width to height, and of its colour bar beside it."""
    width, height = figure.get_size_inches()
    left, right, below, above = 0.62, 0.85 if bar else 0.1, 0.46 if bar else 0.68, 0.28
    room_across, room_up = width - left - right, height - below - above
    across = min(room_across, ratio * room_up)
    up = min(room_up, across / ratio)
    left += (room_across - across) / 2
    below += (room_up - up) / 2
    axes = figure.add_axes((left / width, below / height, across / width, up / height))
    if not bar:
        return axes, None
    return axes, figure.add_axes(((left + across + 0.1) / width, below / height, 0.11 / width, up / height))


def _classes(
    found: Mask, truth: Mask, counted: Mask, measured: Mask, kept: int = _UNDECIDED
) -> npt.NDArray[np.uint8]:
    """The class of each tile; `kept`: of kept points without a certain truth."""
    classes = np.where(thinned(measured, _PIXELS), np.uint8(_KEPT), np.uint8(_NO_POINT))
    classes[thinned(measured & ~counted, _PIXELS)] = kept
    # Errors are drawn last, because a thinned tile shows what was drawn last, and readers look for errors.
    for where, number in (
        (found & ~counted, _UNDECIDED),
        (counted & found & truth, _TRUE_POSITIVE),
        (counted & ~found & truth, _FALSE_NEGATIVE),
        (counted & found & ~truth, _FALSE_POSITIVE),
    ):
        classes[any_in_tile(where, _PIXELS)] = number
    return classes


def _legend(figure: 'Figure', classes: npt.NDArray[np.uint8], names: Mapping[int, str]) -> None:
    from matplotlib.patches import Patch  # noqa: PLC0415 - an extra

    present = set(np.unique(classes))
    handles = [
        Patch(facecolor=colour, edgecolor='gray', lw=0.3, label=names.get(number, name))
        for number, (name, colour) in _CLASSES.items()
        if number in present
    ]
    figure.legend(handles=handles, loc='lower center', ncols=3, frameon=False, fontsize=6)
