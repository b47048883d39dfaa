"""Pictures of clouds, for people who would rather look than read (extra `pictures`: matplotlib)."""

import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from socialcircle_ros.errors import SocialCircleError

NEEDED = 'Pictures need matplotlib: pip install "socialcircle_ros[pictures]".'


def new_figure(width: float, height: float) -> Any:
    """An empty matplotlib Figure, inches wide and high.

    Raises:
        SocialCircleError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415 - an extra
    except ImportError:
        raise SocialCircleError(NEEDED) from None
    return Figure(figsize=(width, height), dpi=110, layout='constrained')


def before_and_after(
    path: Path, xyz: npt.NDArray[Any], outliers: npt.NDArray[np.bool_], title: str, unit: str = ''
) -> None:
    """Three height maps side by side: as measured, with the outliers marked, and cleaned.

    All share one colour scale, taken from the points that were kept, so that what was removed does not
    flatten what remains. Pixels of a large cloud that do not fit are skipped, except outliers: one that falls
    between two pixels is drawn on the nearer one.

    Args:
        path: the PNG to write.
        xyz: (H, W, 3) the cloud as measured.
        outliers: (H, W) what was removed.
        title: one line above.
        unit: of the coordinates, for the axes.

    Raises:
        SocialCircleError: matplotlib is not installed.
    """
    measured = np.isfinite(xyz).all(axis=2)
    heights = np.where(measured, xyz[..., 2], np.nan).astype(np.float64)
    kept = np.where(outliers, np.nan, heights)
    scale = kept if np.isfinite(kept).any() else heights
    low, high = np.nanpercentile(scale, [0.5, 99.5])
    extent = _extent(xyz, measured)
    figure = new_figure(15, 15 / 3 / _aspect(extent) + 1.3)
    figure.suptitle(textwrap.fill(title, 130))
    axes = figure.subplots(1, 3, sharex=True, sharey=True)
    shown: dict[str, Any] = {'extent': extent, 'interpolation': 'nearest', 'vmin': low, 'vmax': high}
    names = ('as measured', f'{np.count_nonzero(outliers)} outliers in red', 'cleaned; orange: nothing there')
    for axis, values, colours, name in zip(
        axes, (heights, heights, kept), ('viridis', 'gray', 'viridis'), names, strict=True
    ):
        image = axis.imshow(thinned(values), cmap=colours, **shown)
        axis.set_title(name)
        axis.set_xlabel(f'x [{unit}]' if unit else 'x')
        axis.ticklabel_format(scilimits=(-3, 4))  # metres: their zeros would run into each other
        axis.set_facecolor('#ffd9b3')
    axes[0].set_ylabel(f'y [{unit}]' if unit else 'y')
    red = np.zeros((*thinned(outliers).shape, 4))
    red[any_in_tile(outliers)] = (1, 0, 0, 1)
    axes[1].imshow(red, extent=extent, interpolation='nearest')
    figure.colorbar(image, ax=axes, label=f'z [{unit}]' if unit else 'z', shrink=0.9)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


_PIXELS = 800  # along the longer side of one panel


def _step(shape: tuple[int, ...], pixels: int) -> int:
    return max(1, -(-max(shape[:2]) // pixels))


def thinned(values: npt.NDArray[Any], pixels: int = _PIXELS) -> npt.NDArray[Any]:
    """Every so many rows and columns, so that what remains fits into one panel of so many pixels."""
    step = _step(values.shape, pixels)
    return values[::step, ::step]


def any_in_tile(mask: npt.NDArray[np.bool_], pixels: int = _PIXELS) -> npt.NDArray[np.bool_]:
    """Thinned like the picture, True where any point of the tile is."""
    return over_tiles(np.logical_or, mask, pixels)


def over_tiles(reduce: np.ufunc, values: npt.NDArray[Any], pixels: int) -> npt.NDArray[Any]:
    """One value for each tile, of which the thinned picture has a corner."""
    step = _step(values.shape, pixels)
    rows, columns = (np.arange(0, extent, step) for extent in values.shape)
    by_row = reduce.reduceat(values, rows, axis=0)
    tiles: npt.NDArray[Any] = reduce.reduceat(by_row, columns, axis=1)
    return tiles


def _extent(xyz: npt.NDArray[Any], measured: npt.NDArray[np.bool_]) -> tuple[float, float, float, float]:
    """Left, right, bottom, top of the picture, row 0 on top."""
    x, y = (xyz[..., axis][measured] for axis in (0, 1))
    if x.size and np.ptp(x) > 0 and np.ptp(y) > 0:
        return float(x.min()), float(x.max()), float(y.max()), float(y.min())
    return 0.0, float(xyz.shape[1]), float(xyz.shape[0]), 0.0


def aspect_of(xyz: npt.NDArray[Any]) -> float:
    """Width of a cloud (H, W, 3) by its height, on the part; 0.6 to 3.3, so that it can be shown."""
    few = thinned(xyz)
    return _aspect(_extent(few, np.isfinite(few).all(axis=2)))


def _aspect(extent: tuple[float, float, float, float]) -> float:
    left, right, bottom, top = extent
    return min(max((right - left) / (bottom - top), 1 / 1.6), 1 / 0.3)
