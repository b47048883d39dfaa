# SPDX-License-Identifier: Apache-2.0
"""Map, profile and histogram of a cloud as SVG, with axes, units and a scale bar. No viser."""

import base64
import io
import math
from collections.abc import Iterable, Sequence
from html import escape
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask
from socialcircle_ros.focus import FocusCurve
from socialcircle_ros.lengths import LengthScale, known_unit, length_scale, length_text
from socialcircle_ros.messages.image import NOT_MEASURED, OUTLIER
from socialcircle_ros.pictures.thinning import any_in_tile, thinned

from . import colours
from .display import Drawing, MapSide

_PIXELS = 400  # most pixels along the longer side of a picture
_HOVERED = 160  # most values along the longer side that the pointer can read
_WIDTH, _LEFT, _RIGHT, _TOP, _BOTTOM = 340, 44, 8, 6, 32
_TALLEST, _LOWEST = 300, 40  # of the plot of a map
_PLOT = 92  # height of the plots of profile and histogram
_BINS = 48
_MOST_POINTS = 600  # of a profile; of more, the lowest and the highest of each interval are drawn

_HOVER = (
    'const r=this.getBoundingClientRect(),d=this.dataset,w=+d.w,h=+d.h;'
    'this.v=this.v||new Float32Array(Uint8Array.from(atob(d.v),c=>c.charCodeAt(0)).buffer);'
    'const c=Math.min(w-1,Math.max(0,Math.floor((event.clientX-r.left)/r.width*w))),'
    'q=Math.min(h-1,Math.max(0,Math.floor((event.clientY-r.top)/r.height*h))),'
    't=(n,f,l)=>(+f+(l-f)*(n+.5)).toFixed(+d.k),z=this.v[q*w+c];'
    "this.closest('.sc').querySelector('.sc-value').textContent="
    "d.x+' '+t(c/w,d.x0,d.x1)+', '+d.y+' '+t(q/h,d.y0,d.y1)+' '+d.u+': '+"
    "(isNaN(z)?'not measured':z.toFixed(+d.n)+' '+d.e)"
)
"""Shows the value below the pointer, in the browser: no message goes to this program."""


def map_picture(drawing: Drawing) -> npt.NDArray[np.uint8]:
    """The values of kept points as colours (h, w, 3) uint8; outliers are marked, and none is lost by thinning."""
    values: npt.NDArray[np.floating] = thinned(drawing.values, _PIXELS)
    picture = colours.coloured(values, drawing.span, drawing.display.colour_map)
    picture[(thinned(drawing.mask, _PIXELS) == NOT_MEASURED) | ~np.isfinite(values)] = colours.NOT_MEASURED
    picture[any_in_tile(drawing.mask == OUTLIER, _PIXELS)] = colours.OUTLIER
    return picture


def map_svg(
    drawing: Drawing,
    picked: tuple[int, int] | None = None,
    region: Sequence[int] = (),
    of_interest: Sequence[int] = (),
) -> str:
    """The map with axes, a scale bar, the place that was clicked, the line of the profile and the regions.

    Args:
        drawing: the cloud.
        picked: row and column that were clicked.
        region: row, column, height and width of the vote region; empty: none is set.
        of_interest: row, column, height and width of the region of interest; empty: there is none.
    """
    across, down = drawing.across, drawing.down
    plot = _WIDTH - _LEFT - _RIGHT
    ratio = down.length / across.length if across.length > 0 and down.length > 0 else 1.0
    tall = min(max(plot * ratio, _LOWEST), _TALLEST)
    wide = min(plot, tall / ratio) if ratio > 0 else plot
    lengths = drawing.lengths

    def x(column: float) -> float:
        return _LEFT + wide * (column + 0.5) / across.count

    def y(row: float) -> float:
        return _TOP + tall * (row + 0.5) / down.count

    picture = _data(map_picture(drawing))
    size = f'width="{wide:.1f}" height="{tall:.1f}"'
    parts = [
        f'<image x="{_LEFT}" y="{_TOP}" {size} preserveAspectRatio="none" class="sc-pixels" href="{picture}"/>',
        *_side_axis(across, lengths, (_LEFT, wide), _TOP + tall, upright=False),
        *_side_axis(down, lengths, (_TOP, tall), _LEFT, upright=True),
        *_scale_bar(across.length, drawing.unit, lengths, (_LEFT, _TOP + tall, wide)),
    ]
    for kind, place in (('sc-region', region), ('sc-interest', of_interest)):
        if not (len(place) == 4 and place[2] > 0):
            continue
        row, column, height, width = place
        left, top = x(column - 0.5), y(row - 0.5)
        parts.append(
            f'<rect class="{kind}" x="{left:.1f}" y="{top:.1f}" width="{x(column + width - 0.5) - left:.1f}"'
            f' height="{y(row + height - 0.5) - top:.1f}"/>'
        )
    if picked is not None:
        row, column = picked
        line = (
            f'x1="{_LEFT}" x2="{_LEFT + wide:.1f}" y1="{y(row):.1f}" y2="{y(row):.1f}"'
            if drawing.display.along == 'row'
            else f'x1="{x(column):.1f}" x2="{x(column):.1f}" y1="{_TOP}" y2="{_TOP + tall:.1f}"'
        )
        parts.append(f'<line class="sc-cut" {line}/>')
        parts.append(f'<circle class="sc-picked" cx="{x(column):.1f}" cy="{y(row):.1f}" r="5"/>')
    parts.append(_hover(drawing, wide, tall))
    return (
        _svg(parts, _TOP + tall + _BOTTOM) + '<div class="sc-value sc-dim">Point at the map to read values.</div>'
    )


def profile_svg(drawing: Drawing, place: tuple[int, int]) -> str:
    """The heights along a row or a column through a place: kept points as a line, outliers as marks.

    Args:
        drawing: the cloud.
        place: row and column.
    """
    row, column = place
    along_row = drawing.display.along == 'row'
    side = drawing.across if along_row else drawing.down
    cut = (slice(row, row + 1), slice(None)) if along_row else (slice(None), slice(column, column + 1))
    heights = drawing.heights[cut].ravel()
    outliers = drawing.outliers[cut].ravel()
    scale = drawing.height_scale
    if not np.isfinite(heights).any():
        return ''
    low, high = _padded(heights[np.isfinite(heights)])
    wide = _WIDTH - _LEFT - _RIGHT

    def x(index: float) -> float:
        return _LEFT + wide * (index + 0.5) / side.count

    def y(height: float) -> float:
        return _TOP + _PLOT * (high - height) / (high - low)

    lines = [
        ' '.join(f'{x(index):.1f},{y(heights[index]):.1f}' for index in run)
        for run in _runs(heights, np.isfinite(heights) & ~outliers)
    ]
    marks = [
        f'<circle class="sc-outlier" cx="{x(index):.1f}" cy="{y(heights[index]):.1f}" r="2.4"/>'
        for index in np.flatnonzero(outliers).tolist()
    ]
    here = column if along_row else row
    parts = [
        f'<line class="sc-cut" x1="{x(here):.1f}" x2="{x(here):.1f}" y1="{_TOP}" y2="{_TOP + _PLOT}"/>',
        *(f'<polyline class="sc-line" points="{line}"/>' for line in lines),
        *marks,
        *_side_axis(side, drawing.lengths, (_LEFT, wide), _TOP + _PLOT, upright=False),
        *_height_axis(low, high, scale),
    ]
    return _svg(parts, _TOP + _PLOT + _BOTTOM)


def histogram_svg(drawing: Drawing) -> str:
    """How many points have which height: kept points, and outliers above them. Counts are logarithmic.

    The heights span those of the kept points and a quarter more on each side; an outlier beyond them is counted in
    the first or the last bar.
    """
    low, high = drawing.height_span
    low, high = low - (high - low) / 4, high + (high - low) / 4
    if not high > low:
        low, high = low - 0.5, high + 0.5
    edges = np.linspace(low, high, _BINS + 1)
    kept, outliers = (
        np.histogram(np.clip(drawing.heights[where], low, high), edges)[0]
        for where in (drawing.kept, drawing.outliers)
    )
    tallest = max(1.0, math.log10(1 + float((kept + outliers).max())))
    wide = (_WIDTH - _LEFT - _RIGHT) / _BINS
    parts = []
    for index, (below, above) in enumerate(zip(kept.tolist(), outliers.tolist(), strict=True)):
        base, top = (_PLOT * math.log10(1 + count) / tallest for count in (below, below + above))
        bars = (('sc-kept', 0.0, base), ('sc-outlier', base, max(top, base + 2.0) if above else base))
        parts += [
            f'<rect class="{kind}" x="{_LEFT + index * wide:.1f}" y="{_TOP + _PLOT - end:.1f}" width="{wide:.1f}"'
            f' height="{end - start:.1f}"/>'
            for kind, start, end in bars
            if end > start
        ]
    scale = drawing.height_scale
    ticks = nice_ticks(low * scale.factor, high * scale.factor, 5)
    parts += _ticks_below(
        [(_LEFT + (_WIDTH - _LEFT - _RIGHT) * (tick / scale.factor - low) / (high - low), tick) for tick in ticks],
        _TOP + _PLOT,
        scale.label('z'),
    )
    for count in (10**power for power in range(1, 1 + math.floor(tallest))):
        at = _TOP + _PLOT - _PLOT * math.log10(1 + count) / tallest
        parts.append(f'<text x="{_LEFT - 4}" y="{at + 3:.1f}" text-anchor="end">{count:,}</text>')
    return _svg(parts, _TOP + _PLOT + _BOTTOM)


def curve_svg(curve: FocusCurve) -> str:
    """The focus measure of a pixel over the z of the stage, with the depth that the fit found.

    Args:
        curve: of the pixel, with z in m.
    """
    low, high = float(curve.z[0]), float(curve.z[-1])
    top = float(curve.measure.max()) or 1.0
    wide = _WIDTH - _LEFT - _RIGHT
    scale = length_scale(curve.z, 'm')

    def x(z: float) -> float:
        return _LEFT + wide * (z - low) / (high - low)

    def y(measure: float) -> float:
        return _TOP + _PLOT * (1 - measure / top)

    places = [(x(z), y(measure)) for z, measure in zip(curve.z.tolist(), curve.measure.tolist(), strict=True)]
    found = [curve.depth] if low <= curve.depth <= high else []
    ticks, heights = nice_ticks(low * scale.factor, high * scale.factor, 5), nice_ticks(0.0, top, 3)
    middle = _TOP + _PLOT / 2
    parts = [
        *(
            f'<line class="sc-cut" x1="{x(z):.1f}" x2="{x(z):.1f}" y1="{_TOP}" y2="{_TOP + _PLOT}"/>'
            for z in found
        ),
        f'<polyline class="sc-line" points="{" ".join(f"{left:.1f},{up:.1f}" for left, up in places)}"/>',
        *(f'<circle class="sc-kept" cx="{left:.1f}" cy="{up:.1f}" r="1.6"/>' for left, up in places),
        *_ticks_below(
            [(x(tick / scale.factor), tick) for tick in ticks], _TOP + _PLOT, scale.label('z of the stage')
        ),
        *(
            f'<text x="{_LEFT - 6}" y="{y(tick) + 3:.1f}" text-anchor="end">{text}</text>'
            for tick, text in zip(heights, tick_texts(heights), strict=True)
        ),
        f'<text transform="translate(9 {middle:.1f}) rotate(-90)" text-anchor="middle">focus measure</text>',
    ]
    return _svg(parts, _TOP + _PLOT + _BOTTOM)


def nice_ticks(low: float, high: float, about: int) -> list[float]:
    """Multiples of 1, 2 or 5 times a power of ten between two values: about so many, and at least one."""
    if not (math.isfinite(low) and math.isfinite(high) and high > low):
        return [low]
    rough = (high - low) / about
    decade = 10.0 ** math.floor(math.log10(rough))
    steps = [factor * decade for factor in (0.5, 1.0, 2.0, 5.0, 10.0)]
    place = next(place for place, step in enumerate(steps) if place and step >= rough * (1 - 1e-9))
    # The step may be longer than the span; the one below it is shorter than half of that.
    return _multiples(steps[place], low, high) or _multiples(steps[place - 1], low, high)


def _multiples(step: float, low: float, high: float) -> list[float]:
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [step * number for number in range(first, last + 1)]


def tick_texts(ticks: Sequence[float]) -> list[str]:
    """Ticks with the decimals that tell them apart, and a true minus sign."""
    steps = [abs(second - first) for first, second in pairwise(ticks)]
    least = 1e-6 * min(steps, default=1e-6 * max((abs(tick) for tick in ticks), default=1.0))
    decimals = next((d for d in range(13) if all(abs(round(tick, d) - tick) <= least for tick in ticks)), 13)
    return [f'{round(tick, decimals) + 0.0:.{decimals}f}'.replace('-', '−') for tick in ticks]


def _side_axis(
    side: MapSide, scale: LengthScale, plot: tuple[float, float], at: float, *, upright: bool
) -> Iterable[str]:
    """Ticks along a side of the cloud, and its label.

    Args:
        side: the side.
        scale: how lengths are shown.
        plot: where the side begins on the page, and its length.
        at: where the axis lies in the other direction.
        upright: whether the axis is that of the rows.
    """
    start, length = plot
    first, last = side.first * scale.factor, side.last * scale.factor
    if first == last:
        return []
    ticks = nice_ticks(min(first, last), max(first, last), max(2, round(length / 60)))
    places = [(start + length * (tick - first) / (last - first), tick) for tick in ticks]
    if not upright:
        return _ticks_below(places, at, scale.label(side.name))
    texts = tick_texts(ticks)
    parts = [
        f'<line x1="{at - 4}" x2="{at}" y1="{place:.1f}" y2="{place:.1f}"/>'
        f'<text x="{at - 6}" y="{place + 3:.1f}" text-anchor="end">{text}</text>'
        for (place, _), text in zip(places, texts, strict=True)
    ]
    middle = start + length / 2
    label = escape(scale.label(side.name))
    return [*parts, f'<text transform="translate(9 {middle:.1f}) rotate(-90)" text-anchor="middle">{label}</text>']


def _ticks_below(places: Sequence[tuple[float, float]], at: float, label: str) -> list[str]:
    texts = tick_texts([tick for _, tick in places])
    parts = [
        f'<line x1="{place:.1f}" x2="{place:.1f}" y1="{at:.1f}" y2="{at + 4:.1f}"/>'
        f'<text x="{place:.1f}" y="{at + 14:.1f}" text-anchor="middle">{text}</text>'
        for (place, _), text in zip(places, texts, strict=True)
    ]
    middle = (_LEFT + _WIDTH - _RIGHT) / 2
    return [*parts, f'<text x="{middle:.1f}" y="{at + 27:.1f}" text-anchor="middle">{escape(label)}</text>']


def _height_axis(low: float, high: float, scale: LengthScale) -> list[str]:
    ticks = nice_ticks(low * scale.factor, high * scale.factor, 4)
    parts = []
    for tick, text in zip(ticks, tick_texts(ticks), strict=True):
        at = _TOP + _PLOT * (high - tick / scale.factor) / (high - low)
        parts.append(
            f'<line x1="{_LEFT - 4}" x2="{_LEFT}" y1="{at:.1f}" y2="{at:.1f}"/>'
            f'<text x="{_LEFT - 6}" y="{at + 3:.1f}" text-anchor="end">{text}</text>'
        )
    label = escape(scale.label('z'))
    middle = _TOP + _PLOT / 2
    return [*parts, f'<text transform="translate(9 {middle:.1f}) rotate(-90)" text-anchor="middle">{label}</text>']


def _scale_bar(
    length: float, unit: str | None, scale: LengthScale, place: tuple[float, float, float]
) -> list[str]:
    """A bar of a round length, about a quarter of the map, with that length.

    Args:
        length: of the side across.
        unit: of the length; where it is not known, only the axes name it.
        scale: how lengths are shown.
        place: left, bottom and width of the map on the page.
    """
    if not length > 0:
        return []
    left, bottom, wide = place
    rough = length / 4
    decade = 10.0 ** math.floor(math.log10(rough))
    bar = max(factor * decade for factor in (1.0, 2.0, 5.0) if factor * decade <= rough * (1 + 1e-9))
    end = left + 8 + wide * bar / length
    text = length_text(bar, unit) if known_unit(unit) else tick_texts([bar * scale.factor])[0]
    line = f'x1="{left + 8}" x2="{end:.1f}" y1="{bottom - 9:.1f}" y2="{bottom - 9:.1f}"'
    return [
        f'<line class="sc-bar-back" {line}/>',
        f'<line class="sc-bar-line" {line}/>',
        f'<text class="sc-bar-text" x="{left + 8}" y="{bottom - 14:.1f}">{escape(text)}</text>',
    ]


def _hover(drawing: Drawing, wide: float, tall: float) -> str:
    """A rectangle that shows the value below the pointer."""
    values = np.asarray(thinned(drawing.values, _HOVERED), np.float64)
    lengths = drawing.lengths
    is_height = drawing.display.values == 'heights'
    heights = drawing.height_scale
    factor, unit, decimals = (heights.factor, heights.name, heights.decimals) if is_height else (1.0, '', 2)
    shown = (values * factor).astype('<f4')
    ends = {
        'x0': drawing.across.first, 'x1': drawing.across.last, 'y0': drawing.down.first, 'y1': drawing.down.last,
    }  # fmt: skip
    data = {
        **{name: repr(value * lengths.factor) for name, value in ends.items()},
        'x': drawing.across.name, 'y': drawing.down.name, 'u': lengths.name, 'k': str(lengths.decimals),
        'e': unit, 'n': str(decimals), 'w': str(values.shape[1]), 'h': str(values.shape[0]),
        'v': base64.b64encode(shown.tobytes()).decode(),
    }  # fmt: skip
    attributes = ' '.join(f'data-{name}="{escape(value)}"' for name, value in data.items())
    return (
        f'<rect x="{_LEFT}" y="{_TOP}" width="{wide:.1f}" height="{tall:.1f}" fill="transparent"'
        f' onmousemove="{escape(_HOVER)}" {attributes}/>'
    )


def _runs(heights: npt.NDArray[np.float64], kept: Mask) -> Iterable[list[int]]:
    """The indices of neighbouring kept points, run by run; a long run is thinned to its extremes."""
    places = np.flatnonzero(kept)
    step = max(1, math.ceil(2 * len(heights) / _MOST_POINTS))
    for run in np.split(places, np.flatnonzero(np.diff(places) > 1) + 1):
        if step == 1 or len(run) <= 2:
            yield run.tolist()
            continue
        chosen: list[int] = []
        for first in range(0, len(run), step):
            part = run[first : first + step]
            chosen += sorted({int(part[np.argmin(heights[part])]), int(part[np.argmax(heights[part])])})
        yield chosen


def _padded(heights: npt.NDArray[np.float64]) -> tuple[float, float]:
    low, high = float(heights.min()), float(heights.max())
    margin = 0.05 * (high - low) or max(abs(low), 1.0) * 1e-3
    return low - margin, high + margin


def _data(picture: npt.NDArray[np.uint8]) -> str:
    from PIL import Image  # noqa: PLC0415 - comes with viser

    out = io.BytesIO()
    Image.fromarray(picture).save(out, format='png', compress_level=3)
    return f'data:image/png;base64,{base64.b64encode(out.getvalue()).decode()}'


def _svg(parts: Iterable[str], height: float) -> str:
    return f'<svg class="sc-chart" viewBox="0 0 {_WIDTH} {height:.0f}" width="100%">{"".join(parts)}</svg>'
