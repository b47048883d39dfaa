# SPDX-License-Identifier: Apache-2.0
"""The page of trends: one HTML file with charts by Bokeh, for the screen and for paper."""

import html
from collections.abc import Sequence
from datetime import datetime, timezone
from pathlib import Path

import numpy as np

from socialcircle_ros.errors import SocialCircleError, install_command
from socialcircle_ros.report.page import sentence_in_html
from socialcircle_ros.storage import folder_of_results, write_file

from .control_chart import RULES
from .ledger import Ledger
from .results import ResultFolder
from .trend import MEASURES, Series, read_series, short_label
from .trend_charts import charts

_TEMPLATE = """
{% block postamble %}
<style>
body { font: 16px/1.5 system-ui, sans-serif; color: #1a1a1a; max-width: 100rem; margin: 1.5rem auto;
  padding: 0 1rem; }
h1, h2 { line-height: 1.2; } p, ul { max-width: 60rem; }
.table { overflow-x: auto; }
table { border-collapse: collapse; font-size: .85rem; }
th, td { padding: .15rem .6rem; border-bottom: 1px solid #ddd; text-align: right; white-space: nowrap; }
th { border-bottom: 2px solid #888; }
.words { text-align: left; white-space: normal; }
.drifts { color: #b3261e; font-weight: 600; }
.warnings { background: #fff3dc; border-left: 4px solid #c77700; padding: .5rem 1rem .5rem 2rem; }
@media print {
  body { font-size: 10pt; max-width: none; margin: 0; }
  table { font-size: 8pt; } tr { break-inside: avoid; } h2 { break-after: avoid; }
}
</style>
{% endblock %}
{% block contents %}
{{ above }}
{{ super() }}
{% endblock %}
"""


def write_trend(folder: str | Path, output: str | Path, *, baseline: int = 50) -> list[Series]:
    """Write a page that shows the measurements of a folder over time.

    For each cell and part the page shows the share of outliers, the measured share, Sa, Sq and Sz, times and
    failures, as individuals charts with the Western Electric rules. The limits of a chart begin anew after a
    change of settings or version. A click on a point opens the report of its cloud, if `run_batch` wrote reports.

    Args:
        folder: output of a batch, or `measurements.folder` of nodes.
        output: the page; it needs no other file, except for the reports.
        baseline: number of clouds after each change that the control limits are computed from.

    Returns:
        What the page shows: one series for each cell and part.

    Raises:
        SocialCircleError: the folder has no measurements, the page cannot be written, or Bokeh is not installed.
    """
    output = Path(output)
    page, all_series = trend_page(folder, output, baseline=baseline)
    with folder_of_results(output.parent):
        write_file(output, page)
    return all_series


def trend_page(folder: str | Path, output: Path, *, baseline: int = 50) -> tuple[str, list[Series]]:
    """Make the page of `write_trend`, without writing it.

    Args:
        folder: output of a batch, or `measurements.folder` of nodes.
        output: where the page will lie; its links to reports are relative to it.
        baseline: number of clouds after each change that the control limits are computed from.

    Returns:
        The page, and what it shows.

    Raises:
        SocialCircleError: the folder has no measurements, or Bokeh is not installed.
    """
    try:
        from bokeh.embed import file_html  # noqa: PLC0415 - an extra
        from bokeh.resources import INLINE  # noqa: PLC0415
    except ImportError:
        raise SocialCircleError(f'The page needs Bokeh: {install_command("batch")}.') from None
    all_series = read_series(folder, output, baseline=baseline)
    page = file_html(
        charts(all_series),
        INLINE,
        title=f'Trends of {ResultFolder(folder).name}',
        template=_TEMPLATE,
        template_variables={'above': _above(ResultFolder(folder), all_series, baseline)},
    )
    return page, all_series


def _above(folder: ResultFolder, all_series: Sequence[Series], baseline: int) -> str:
    """The part of the page above the charts: what it shows, what drifts, and a table of all series."""
    now = datetime.now(timezone.utc)
    rows = []
    for series in all_series:
        drifting = series.drifting()
        counts = [int(np.count_nonzero(series.signals[measure])) for measure in MEASURES]
        cells = [len(series.times), sum(series.refused.values()), series.limits_failed, *counts]
        told = f'<span class="drifts">{", ".join(map(short_label, drifting))}</span>' if drifting else ''
        rows.append(
            f'<tr><td class="words">{html.escape(series.cell)}</td>'
            f'<td class="words">{html.escape(series.part)}</td>'
            f'<td class="words">{html.escape(series.length_unit)}</td><td class="words">{told}</td>'
            f'{"".join(f"<td>{cell:,}</td>" for cell in cells)}</tr>'
        )
    heads = ''.join(f'<th>{short_label(measure)}</th>' for measure in MEASURES)
    reasons = [
        f'<li>{html.escape(series.title)}, {"1 failure" if count == 1 else f"{count} failures"}:'
        f' {sentence_in_html(reason)}</li>'
        for series in all_series
        for reason, count in series.reasons.items()
    ]
    reasons += [f'<li>{sentence_in_html(entry.damage)}</li>' for entry in Ledger(folder).entries() if entry.damage]
    warnings = f'<ul class="warnings">{"".join(reasons)}</ul>' if reasons else ''
    linked = any(link for series in all_series for link in series.links)
    opens = 'opens the report of its cloud, if there is one' if linked else 'shows its values'
    rules = ''.join(f'<li>{rule}</li>' for rule in RULES)
    return (
        f'<h1>Trends of {html.escape(folder.name)}</h1>'
        f'<p>Made on {now:%Y-%m-%d %H:%M} UTC. Individuals charts: the centre line is the median of the first'
        f' {baseline} clouds after a change of settings or version, and sigma is their median moving range divided'
        ' by 0.954. A point is red if it completes a Western Electric rule:</p>'
        f'<ul>{rules}</ul>'
        '<p>A few red points are chance: of a process that is in control, about one point of 92 is red. A measure'
        ' drifts if more than half of its last 20 points are red.</p>'
        '<p>Sa, Sq and Sz of a series are in one unit. Clouds of an unknown unit are a series of their own.</p>'
        f'{warnings}'
        '<div class="table"><table><thead><tr><th class="words">cell</th><th class="words">part</th>'
        '<th class="words">unit</th>'
        '<th class="words">drifts</th><th>clouds</th><th>refused, failed</th><th>limits failed</th>'
        f'{heads}</tr></thead><tbody>{"".join(rows)}</tbody></table></div>'
        '<p>The columns on the right count red points. The charts below show the cell and part that is chosen; a'
        f' click on a point {opens}.</p>'
    )
