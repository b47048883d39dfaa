# SPDX-License-Identifier: Apache-2.0
"""What the pictures of all experiments share: value ranges, and maps in the style of all pictures."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Cloud, HeightMap, Mask
from socialcircle_ros.lengths import length_scale
from socialcircle_ros.pictures import style
from socialcircle_ros.pictures.frame import MapExtent, MapFrame, frame_of
from socialcircle_ros.pictures.thinning import any_in_tile, thinned

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

PlotRegion = tuple[slice, slice]
"""A rectangular part of a cloud: its rows and its columns."""
FilterMasks = list[tuple[str, Mask]]
"""Names of filters, and the points (H, W) that each removes."""


def colour_range(heights: HeightMap) -> tuple[float, float]:
    """The 0.5 % and 99.5 % quantiles of the heights."""
    low, high = np.nanpercentile(heights, [0.5, 99.5])
    return float(low), float(high)


@dataclass(frozen=True, eq=False)
class CloudPanels:
    """Maps of one cloud, or of a part of it, in the style of all pictures: axes with units and a scale bar.

    Attributes:
        points: (H, W, 3).
        unit: of the coordinates.
    """

    points: Cloud
    unit: str

    def part(self, box: PlotRegion) -> 'CloudPanels':
        """Maps of a part of the cloud."""
        return CloudPanels(self.points[box], self.unit)

    def heights(
        self, axes: 'Axes', values: HeightMap, limits: tuple[float, float], colours: str = style.HEIGHTS
    ) -> 'AxesImage':
        """Map heights (H, W) between the first and the last colour; NaN has the colour of missing points."""
        image = axes.imshow(
            thinned(values),
            cmap=colours,
            vmin=limits[0],
            vmax=limits[1],
            interpolation='nearest',
            extent=self._extent,
        )
        axes.set_facecolor(style.NOT_MEASURED)
        self._frame.put_on(axes)
        return image

    def colours(self, axes: 'Axes', rgb: npt.NDArray[np.float64]) -> None:
        """Map colours, (H, W, 3) or (H, W, 4)."""
        axes.imshow(rgb, interpolation='nearest', extent=self._extent)
        self._frame.put_on(axes)

    def mark(self, axes: 'Axes', mask: Mask) -> None:
        """Mark points (H, W) of a map in the colour of outliers; none is lost where the map is thinned."""
        from matplotlib.colors import to_rgba  # noqa: PLC0415 - an extra

        marked = any_in_tile(mask)
        red = np.zeros((*marked.shape, 4))
        red[marked] = to_rgba(style.OUTLIER)
        axes.imshow(red, interpolation='nearest', extent=self._extent, zorder=2)

    def outline(self, axes: 'Axes', box: PlotRegion) -> None:
        """Draw a rectangle round the part that is shown enlarged."""
        left, right, bottom, top = self.part(box)._extent  # noqa: SLF001 - of its own class
        axes.plot(
            [left, right, right, left, left], [top, top, bottom, bottom, top], color=style.OUTLIER, linewidth=1.5
        )

    def bar(
        self,
        figure: 'Figure',
        image: 'ScalarMappable',
        axes: 'Sequence[Axes]',
        limits: tuple[float, float],
        name: str = 'z',
    ) -> None:
        """Draw the colour bar of heights beside some axes."""
        bar = figure.colorbar(image, ax=axes, shrink=0.8, extend='both')
        length_scale(limits, self.unit).label_axis(bar.ax.yaxis, name)

    @cached_property
    def _frame(self) -> MapFrame:
        return frame_of(self.points, np.isfinite(self.points[..., 2]), self.unit)

    @property
    def _extent(self) -> MapExtent:
        return self._frame.extent


def densest_box(outlier: Mask, share: float = 0.18) -> PlotRegion:
    """The part of the cloud that holds most outliers; its sides are `share` of the cloud's."""
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
