# SPDX-License-Identifier: Apache-2.0
"""The charts of the page of trends, by Bokeh: one per measure, with a choice of cell and part."""

import html
import json
from collections.abc import Sequence
from datetime import datetime, timezone
from typing import TYPE_CHECKING, TypedDict

import numpy as np

from .trend import LENGTHS, MEASURES, SHARES, Phase, Series, short_label

if TYPE_CHECKING:
    from bokeh.models import CDSView, LayoutDOM
    from bokeh.plotting import figure

_SHOW = """
const chosen = JSON.parse(series)[select.value]
for (const view of views) { view.filter.indices = chosen.indices }
measures.forEach((measure, place) => {
  figures[place].title.text = chosen.labels[measure]
  figures[place].y_range.default_span = chosen.spans[measure]
  signal_views[place].filter.indices = chosen.signals[measure]
  limit_sources[place].data = chosen.limits[measure]
})
change_source.data = chosen.changes
refused_source.data = chosen.refused
notes.text = chosen.notes
clouds.change.emit()
"""

_SELECTED = """
const place = clouds.selected.indices[0]
if (place === undefined) { return }
const [name, link, unit] = JSON.parse(names)[place]
const escaped = (text) => text.replace(/&/g, '&amp;').replace(/</g, '&lt;')
const time = new Date(clouds.data.time[place]).toISOString()
const values = measures.map((measure, number) => {
  const value = `${labels[number]} ${clouds.data[measure][place].toPrecision(4)}`
  return `${value} ${lengths.includes(measure) ? escaped(unit) : units[measure]}`
})
const report = link ? `<a href="${link}" target="_blank">Report of this cloud</a>`
  : 'There is no report of this cloud: <code>socialcircle batch --reports</code> makes them.'
details.text = `<b>${escaped(name)}</b>, ${time}: ${values.join(', ')}. ${report}`
if (link) { window.open(link, '_blank') }
"""

_SHARE_TICK = "return tick < 0 || tick > 100 ? '' : String(Number(tick.toPrecision(6)))"
"""The text of a tick of an axis in percent; where all values are 100, the axis has room above them."""

_DAY_MS = 86_400_000
# Height of a chart relative to its values, where they do not change; with Bokeh's own a share looks like 0.
_LEAST_SPAN = 0.2
_POINT, _SIGNAL, _LINE, _CHANGE = '#2a6592', '#b3261e', '#666666', '#c77700'


class _ShownSeries(TypedDict):
    """What the charts show of one series, as JSON has it."""

    labels: dict[str, str]
    spans: dict[str, float]
    indices: list[int]
    signals: dict[str, list[int]]
    limits: dict[str, dict[str, list[float]]]
    changes: dict[str, list[float]]
    refused: dict[str, list[float]]
    notes: str


def charts(all_series: Sequence[Series]) -> 'LayoutDOM':
    """The choice of a series, and one chart for each measure.

    All points are in the page once; a choice changes which of them are drawn. Of the series with clouds, that with
    the most signals is shown first, and is what a print shows.
    """
    from bokeh.layouts import column  # noqa: PLC0415 - an extra
    from bokeh.models import CustomJS, Div, Select  # noqa: PLC0415

    shown, start = {}, 0
    for series in all_series:
        shown[series.title] = _shown(series, start)
        start += len(series.times)

    def signals(title: str) -> tuple[bool, int]:
        return bool(shown[title]['indices']), sum(map(len, shown[title]['signals'].values()))

    first = max(shown, key=signals)
    drawn = _Charts(all_series, shown[first])
    select = Select(title='Cell and part', value=first, options=sorted(shown), width=400)
    notes, details = Div(text=shown[first]['notes']), Div(text='Click a point.')
    arguments = {
        'series': json.dumps(shown), 'select': select, 'notes': notes, 'measures': list(MEASURES),
        'views': drawn.views, 'signal_views': drawn.signal_views, 'limit_sources': drawn.limit_sources,
        'change_source': drawn.change_source, 'refused_source': drawn.refused_source, 'clouds': drawn.clouds,
        'figures': drawn.figures,
    }  # fmt: skip
    select.js_on_change('value', CustomJS(args=arguments, code=_SHOW))
    names = [
        (name, link, series.length_unit)
        for series in all_series
        for name, link in zip(series.names, series.links, strict=True)
    ]
    labels = [short_label(measure) for measure in MEASURES]
    arguments = {
        'clouds': drawn.clouds, 'names': json.dumps(names), 'details': details, 'measures': list(MEASURES),
        'labels': labels, 'lengths': list(LENGTHS), 'units': {'time_ms': 'ms', **dict.fromkeys(SHARES, '%')},
    }  # fmt: skip
    drawn.clouds.selected.js_on_change('indices', CustomJS(args=arguments, code=_SELECTED))
    return column(select, details, *drawn.figures, notes, sizing_mode='stretch_width')


class _Charts:
    """The figures, and the sources and views that a choice changes."""

    def __init__(self, all_series: Sequence[Series], first: _ShownSeries) -> None:
        from bokeh.models import ColumnDataSource, DataRange1d  # noqa: PLC0415 - an extra

        values = {
            measure: np.concatenate([series.values[measure] for series in all_series]) for measure in MEASURES
        }
        times = np.concatenate([series.times for series in all_series])
        self.clouds = ColumnDataSource({'time': times, **values})
        self.change_source = ColumnDataSource(first['changes'])
        self.refused_source = ColumnDataSource(first['refused'])
        self.limit_sources = [ColumnDataSource(first['limits'][measure]) for measure in MEASURES]
        self.views: list[CDSView] = []
        self.signal_views: list[CDSView] = []
        self._x_range = DataRange1d()
        self.figures = [self._of_measure(place, measure, first) for place, measure in enumerate(MEASURES)]
        self.figures.append(self._of_refusals())

    def _figure(self, title: str) -> 'figure':
        from bokeh.plotting import figure  # noqa: PLC0415 - an extra

        return figure(
            title=title,
            height=190,
            sizing_mode='stretch_width',
            x_axis_type='datetime',
            x_range=self._x_range,
            tools='xpan,xwheel_zoom,box_zoom,reset,save',
            active_scroll=None,
            output_backend='webgl',
        )

    def _of_measure(self, place: int, measure: str, first: _ShownSeries) -> 'figure':
        from bokeh.models import (  # noqa: PLC0415 - an extra
            CDSView,
            CustomJSTickFormatter,
            HoverTool,
            IndexFilter,
            TapTool,
        )  # fmt: skip

        chart = self._figure(first['labels'][measure])
        chart.y_range.default_span = first['spans'][measure]
        if measure in SHARES:
            chart.yaxis.formatter = CustomJSTickFormatter(code=_SHARE_TICK)
        limits = self.limit_sources[place]
        for line, dash in (('centre', 'solid'), ('lower', 'dashed'), ('upper', 'dashed')):
            chart.segment('x0', line, 'x1', line, source=limits, line_color=_LINE, line_dash=dash)
        chart.vspan(x='x', source=self.change_source, line_color=_CHANGE, line_dash='dotted', line_width=2)
        self.views.append(CDSView(filter=IndexFilter(first['indices'])))
        self.signal_views.append(CDSView(filter=IndexFilter(first['signals'][measure])))
        points = chart.scatter(
            'time', measure, source=self.clouds, view=self.views[-1], size=4, color=_POINT, nonselection_alpha=1
        )
        signals = chart.scatter(
            'time', measure, source=self.clouds, view=self.signal_views[-1], size=7, marker='triangle',
            color=_SIGNAL, nonselection_alpha=1,
        )  # fmt: skip
        unit = ' %' if measure in SHARES else ''
        hover = [('time', '@time{%F %T}'), (short_label(measure), f'@{measure}{{0.0000}}{unit}')]
        chart.add_tools(
            HoverTool(renderers=[points], tooltips=hover, formatters={'@time': 'datetime'}),
            TapTool(renderers=[points, signals]),
        )
        return chart

    def _of_refusals(self) -> 'figure':
        chart = self._figure('refused clouds and failed recordings per day')
        chart.vbar(x='day', top='count', width=0.8 * _DAY_MS, source=self.refused_source, color=_SIGNAL)
        chart.y_range.start = 0
        return chart


def _shown(series: Series, start: int) -> _ShownSeries:
    """What the charts show of a series whose first cloud is number `start` of all."""
    largest = {
        measure: float(np.abs(np.nan_to_num(values)).max(initial=0.0)) for measure, values in series.values.items()
    }
    limits: dict[str, dict[str, list[float]]] = {}
    for measure in MEASURES:
        found = [(phase, phase.limits[measure]) for phase in series.phases if measure in phase.limits]
        limits[measure] = {
            'x0': [phase.first for phase, _ in found],
            'x1': [phase.last for phase, _ in found],
            'centre': [each.centre for _, each in found],
            'lower': [each.lower for _, each in found],
            'upper': [each.upper for _, each in found],
        }
    changes = [phase for phase in series.phases if phase.change]
    days = [datetime(day.year, day.month, day.day, 12, tzinfo=timezone.utc) for day in series.refused]
    return {
        'labels': {measure: series.label(measure) for measure in MEASURES},
        'spans': {measure: _LEAST_SPAN * (each or 1.0) for measure, each in largest.items()},
        'indices': list(range(start, start + len(series.times))),
        'signals': {
            measure: (start + np.flatnonzero(found)).tolist() for measure, found in series.signals.items()
        },
        'limits': limits,
        'changes': {'x': [phase.first for phase in changes]},
        'refused': {'day': [day.timestamp() * 1000 for day in days], 'count': list(series.refused.values())},
        'notes': _notes(changes),
    }


def _notes(changes: Sequence[Phase]) -> str:
    if not changes:
        return '<p>No change of settings or version.</p>'
    lines = [
        f'<li>{datetime.fromtimestamp(phase.first / 1000, timezone.utc):%Y-%m-%d %H:%M:%S} UTC:'
        f' {html.escape(phase.change)}</li>'
        for phase in changes
    ]
    return f'<p>Changes, dotted in the charts:</p><ul>{"".join(lines)}</ul>'
