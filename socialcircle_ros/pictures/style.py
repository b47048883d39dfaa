# SPDX-License-Identifier: Apache-2.0
"""The style of all pictures: figures, colour maps, and the colours of kept, removed and missing points."""

import io
import threading
from typing import TYPE_CHECKING

from socialcircle_ros.errors import SocialCircleError, install_command

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from matplotlib import RcParams
    from matplotlib.artist import Artist
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure
    from PIL.Image import Image as PictureOfDots

COLOUR_MAPS = ('viridis', 'cividis', 'gray')
"""The colour maps for heights, by matplotlib's names; the first is the default.

All grow evenly in lightness, and outliers can be told apart on them with every colour vision.
"""

HEIGHTS = COLOUR_MAPS[0]
NOT_MEASURED = '#ffd9b3'
"""Points that are not measured, and removed points in a filtered map."""
KEPT, OUTLIER = '#dedede', '#d60000'
FALSE_POSITIVE, FALSE_NEGATIVE, UNDECIDED = '#141414', '#f09600', '#b8a1d9'
SURFACE = '#2a6592'
"""Lines and bars of the kept surface."""

FIGURE_DPI, PICTURE_DPI = 110, 200
"""Of figures of several plots, and of pictures for pages, which are printed and enlarged."""

_PALE = 0.2  # on each side of the middle of a colour map of differences
_NEARLY_WHITE = 252
_LEVELS = 255  # colours of a picture: the size of the file falls to a quarter
_drawing = threading.Lock()  # matplotlib's fonts are not made for threads, and drawing holds the GIL anyway


def differences() -> 'Colormap':
    """The colour map for differences: blue below 0, red above it.

    It has no pale colours in its middle, which would look like those of kept points.
    """
    import matplotlib as mpl  # noqa: PLC0415 - an extra
    from matplotlib.colors import ListedColormap  # noqa: PLC0415

    below = [(0.5 - _PALE) * place / 127 for place in range(128)]
    return ListedColormap(mpl.colormaps['RdBu_r']([*below, *(1 - place for place in reversed(below))]))


def new_figure(width: float, height: float) -> 'Figure':
    """Create an empty matplotlib figure, which arranges its axes by itself.

    Args:
        width: width in inches.
        height: height in inches.

    Raises:
        SocialCircleError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415 - an extra
    except ImportError:
        raise SocialCircleError(f'Pictures need matplotlib: {install_command("pictures")}.') from None
    return Figure(figsize=(width, height), dpi=FIGURE_DPI, layout='constrained')


def legend_below(figure: 'Figure', handles: 'Sequence[Artist]', columns: int, marker_scale: float = 1.0) -> None:
    """Add a legend below the axes of a figure of `new_figure`; matplotlib 3.6 knows no place outside of them.

    Args:
        figure: its axes are there.
        handles: what the legend explains, with its labels.
        columns: number of columns.
        marker_scale: size of the markers relative to those of the axes.
    """
    rows = -(-len(handles) // columns)
    height = (0.12 + 0.22 * rows) / float(figure.get_size_inches()[1])
    figure.set_layout_engine('constrained', rect=(0, height, 1, 1 - height))
    labels = [str(each.get_label()) for each in handles]
    figure.legend(handles, labels, loc='lower center', ncol=columns, markerscale=marker_scale)


def picture(width: float, height: float, draw: 'Callable[[Figure], None]') -> bytes:
    """Draw a picture for a page; several threads may call it.

    Args:
        width: width in inches.
        height: height in inches.
        draw: draws on the empty figure, whose axes have the small type of pictures.

    Returns:
        A PNG.

    Raises:
        SocialCircleError: matplotlib is not installed.
    """
    figure = new_figure(width, height)
    figure.set_layout_engine('none')
    figure.set_dpi(PICTURE_DPI)
    import matplotlib as mpl  # noqa: PLC0415 - an extra

    with _drawing, mpl.rc_context(_small_type()):
        draw(figure)
        return png_of(figure)


def png_of(figure: 'Figure') -> bytes:
    """A PNG of the figure, with few colours.

    `savefig` takes twice as long: it draws the figure twice, and its PNG would have to be read again.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415 - an extra
    from PIL import Image  # noqa: PLC0415 - comes with matplotlib

    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]
    dots = canvas.buffer_rgba()  # type: ignore[no-untyped-call]
    whole = Image.frombuffer('RGBA', canvas.get_width_height(), dots, 'raw', 'RGBA', 0, 1)
    return few_colours(whole.convert('RGB'))


def few_colours(whole: 'PictureOfDots') -> bytes:
    """A PNG of the picture, red, green and blue, with fewer colours, which is a quarter as large.

    A colour that few dots have stays, such as that of a single outlier: an octree keeps it apart, where a median
    cut would join it with others.
    """
    from PIL import Image  # noqa: PLC0415 - comes with matplotlib

    few = whole.quantize(_LEVELS, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    # The background becomes the mean of whites and near-whites, which shows on a white page.
    palette = few.getpalette() or []
    few.putpalette([255 if value >= _NEARLY_WHITE else value for value in palette])
    out = io.BytesIO()
    few.save(out, format='png')
    return out.getvalue()


def _small_type() -> 'RcParams':
    from matplotlib import RcParams  # noqa: PLC0415 - an extra

    small = {'xtick.labelsize': 7.0, 'ytick.labelsize': 7.0, 'legend.fontsize': 7.0}
    return RcParams({'font.size': 8.0, 'axes.titlesize': 9.0, 'axes.labelsize': 8.0, **small})
