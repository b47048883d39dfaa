"""Pictures of clouds with axes, drawn with matplotlib (extra `pictures`), and the thinning of large clouds.

`thumbnails` draws small pictures without axes, in milliseconds.
"""

import io
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Cloud, HeightMap, Mask
from socialcircle_ros.errors import SocialCircleError, install_command
from socialcircle_ros.storage import write_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

_PIXELS = 800  # along the longer side of one panel
_PERCENTILES = (0.5, 99.5)  # of the kept heights: the range of the colours

Scalar = TypeVar('Scalar', bound=np.generic)
Extent = tuple[float, float, float, float]
"""Left, right, bottom and top of a picture, in the unit of the cloud; row 0 is at the top."""


def no_matplotlib() -> SocialCircleError:
    """The error where matplotlib is not installed."""
    return SocialCircleError(f'Pictures need matplotlib: {install_command("pictures")}.')


def new_figure(width: float, height: float) -> 'Figure':
    """Create an empty matplotlib figure.

    Args:
        width: width in inches.
        height: height in inches.

    Raises:
        SocialCircleError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415 - an extra
    except ImportError:
        raise no_matplotlib() from None
    return Figure(figsize=(width, height), dpi=110, layout='constrained')


def before_and_after(path: Path, xyz: Cloud, outliers: Mask, title: str, unit: str = '') -> None:
    """Draw three height maps side by side: as measured, with the outliers marked, and filtered.

    The three share one colour range, taken from the kept points, so that the outliers do not flatten the rest.
    Large clouds are thinned for display; outliers are always drawn.

    Args:
        path: the PNG file to write; its folder is created.
        xyz: (H, W, 3) the cloud as measured.
        outliers: (H, W) the removed points.
        title: one line at the top.
        unit: unit of the coordinates, for the axes; empty where unknown.

    Raises:
        SocialCircleError: matplotlib is not installed.
    """
    measured = _measured(xyz)
    heights = np.where(measured, xyz[..., 2], np.nan).astype(np.float64)
    kept = np.where(outliers, np.nan, heights)
    low, high = np.nanpercentile(kept if np.isfinite(kept).any() else heights, _PERCENTILES)
    extent = _extent(xyz, measured)
    figure = new_figure(15, 15 / 3 / _aspect(extent) + 1.3)
    figure.suptitle(textwrap.fill(title, 130))
    left, middle, right = figure.subplots(1, 3, sharex=True, sharey=True)

    def draw(axes: 'Axes', values: HeightMap, colours: str, name: str) -> 'AxesImage':
        image = axes.imshow(
            thinned(values), cmap=colours, extent=extent, interpolation='nearest', vmin=low, vmax=high
        )
        axes.set_title(name)
        axes.set_xlabel(f'x [{unit}]' if unit else 'x')
        axes.ticklabel_format(scilimits=(-3, 4))  # labels in metres have many zeros and would overlap
        axes.set_facecolor('#ffd9b3')
        return image

    draw(left, heights, 'viridis', 'as measured')
    draw(middle, heights, 'gray', f'{np.count_nonzero(outliers)} outliers in red')
    image = draw(right, kept, 'viridis', 'filtered; orange: no point')
    left.set_ylabel(f'y [{unit}]' if unit else 'y')
    red = np.zeros((*thinned(outliers).shape, 4))
    red[any_in_tile(outliers)] = (1, 0, 0, 1)
    middle.imshow(red, extent=extent, interpolation='nearest')
    figure.colorbar(image, ax=[left, middle, right], label=f'z [{unit}]' if unit else 'z', shrink=0.9)
    path.parent.mkdir(parents=True, exist_ok=True)
    picture = io.BytesIO()
    figure.savefig(picture, format='png')
    write_file(path, picture.getvalue())


def thinned(values: npt.NDArray[Scalar], pixels: int = _PIXELS) -> npt.NDArray[Scalar]:
    """Every n-th row and column of an array, with the smallest n for which the result fits.

    Args:
        values: (H, W, ...) one value per point.
        pixels: most rows or columns of the result.

    Returns:
        A view of `values`.
    """
    step = _step(values.shape, pixels)
    return values[::step, ::step]


def any_in_tile(mask: Mask, pixels: int = _PIXELS) -> Mask:
    """Thin a mask so that no True point is lost.

    Args:
        mask: (H, W).
        pixels: most rows or columns of the result.

    Returns:
        A mask with the shape of `thinned(mask, pixels)`: True where any point of the n×n tile is True.
    """
    return over_tiles(np.logical_or, mask, pixels)


def over_tiles(reduce: np.ufunc, values: npt.NDArray[Scalar], pixels: int) -> npt.NDArray[Scalar]:
    """Reduce each tile of an array to one value.

    Args:
        reduce: a binary ufunc, such as `np.maximum`.
        values: (H, W).
        pixels: most rows or columns of the result.

    Returns:
        One value per tile, in the shape of `thinned(values, pixels)`.
    """
    step = _step(values.shape, pixels)
    rows, columns = (np.arange(0, extent, step) for extent in values.shape)
    by_row = reduce.reduceat(values, rows, axis=0)
    tiles: npt.NDArray[Scalar] = reduce.reduceat(by_row, columns, axis=1)
    return tiles


def aspect_of(xyz: Cloud) -> float:
    """Width of a cloud divided by its height, in its own coordinates.

    Args:
        xyz: (H, W, 3).

    Returns:
        The ratio, limited to 0.625 to 3.33, so that a narrow cloud can still be displayed.
    """
    step = _step(xyz.shape, _PIXELS)
    few: Cloud = xyz[::step, ::step]
    return _aspect(_extent(few, _measured(few)))


def _step(shape: tuple[int, ...], pixels: int) -> int:
    return max(1, -(-max(shape[:2]) // pixels))


def _measured(xyz: Cloud) -> Mask:
    measured: Mask = np.all(np.isfinite(xyz), axis=2)
    return measured


def _extent(xyz: Cloud, measured: Mask) -> Extent:
    x: HeightMap = xyz[..., 0][measured]
    y: HeightMap = xyz[..., 1][measured]
    if x.size and float(np.ptp(x)) > 0 and float(np.ptp(y)) > 0:
        return float(x.min()), float(x.max()), float(y.max()), float(y.min())
    return 0.0, float(xyz.shape[1]), float(xyz.shape[0]), 0.0


def _aspect(extent: Extent) -> float:
    left, right, bottom, top = extent
    return min(max((right - left) / (bottom - top), 1 / 1.6), 1 / 0.3)
