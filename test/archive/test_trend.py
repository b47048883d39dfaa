# SPDX-License-Identifier: Apache-2.0
"""Measurements over time, and their page."""

import re
import sys
from contextlib import contextmanager
from dataclasses import replace
from datetime import date, timedelta

import numpy as np
import pytest
from browser import TIMEOUT_MS, browser
from measurements.row_examples import row

from socialcircle_ros.archive.ledger import Ledger, LedgerEntry
from socialcircle_ros.archive.trend import MEASURES, Series, read_series
from socialcircle_ros.archive.trend_page import write_trend
from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.lengths import METRES
from socialcircle_ros.measurements import write_rows

for library in ('bokeh', 'pyarrow', 'duckdb'):
    pytest.importorskip(library)


@pytest.fixture(scope='module')
def example():
    return row()


def rows_of(example, cell, drift, *, count=120, recording='nights/a.mcap', **changes):
    generator = np.random.default_rng(sum(cell.encode()))
    for number in range(count):
        time = example.time + timedelta(minutes=number)
        sq = 1 + 0.05 * generator.standard_normal() + drift * max(0, number - 60)
        yield replace(
            example, cell=cell, time=time, day=time.date(), number=number, sq=sq, recording=recording, **changes
        )


@pytest.fixture
def out(tmp_path, example):
    rows = [*rows_of(example, 'cell1', 0), *rows_of(example, 'cell2', 0.02)]
    failed = replace(example, status='failed', cell='cell1', reason='It is <no> recording.', sq=None)
    write_rows(tmp_path / 'out', 'a', [*rows, failed])
    return tmp_path / 'out'


@contextmanager
def opened_page(path):
    """The page of trends in a browser, once its charts are drawn."""
    with browser() as chromium:
        page = chromium.new_page()
        page.set_default_timeout(TIMEOUT_MS)
        page.goto(path.as_uri())
        page.wait_for_function('Bokeh.documents.length && Bokeh.documents[0].is_idle')
        yield page


def test_what_drifts_is_found_and_what_does_not_is_not(out, tmp_path):
    one, two = read_series(out, tmp_path / 'trend.html')
    assert (one.title, two.title) == ('cell1, lid', 'cell2, lid')
    assert (one.drifting(), two.drifting()) == ([], ['sq'])
    limits = two.phases[0].limits['sq']
    assert limits.lower < 1 < limits.upper
    assert limits.sigma == pytest.approx(0.05, rel=0.3)
    assert one.refused == {date(2026, 9, 21): 1}
    assert one.reasons == {'It is <no> recording.': 1}
    assert len(one.times) == 120


def of_units(example, *units):
    """40 clouds of a part in each unit, all with an Sq of about 2 µm where the unit is known."""
    for place, unit in enumerate(units):
        for each in rows_of(example, 'cell1', 0, count=40):
            factor = 2e-6 / METRES[unit] if unit in METRES else 1.0
            later = each.time + timedelta(hours=place)
            yield replace(each, time=later, sa=None, sz=None, sq=each.sq * factor, unit=unit)


def test_lengths_of_known_units_are_converted_to_one(tmp_path, example):
    failed = replace(example, status='failed', reason='It is no recording.')
    write_rows(tmp_path, 'a', [*of_units(example, 'um', 'm', 'inch'), failed])
    (series,) = read_series(tmp_path, tmp_path / 'trend.html')
    assert series.reasons == {'It is no recording.': 1}
    assert (series.title, series.label('sq'), len(series.times)) == ('cell1, lid', 'Sq [µm]', 120)
    assert series.values['sq'] == pytest.approx(2.0, rel=0.2)
    assert series.phases[0].limits['sq'].centre == pytest.approx(2.0, rel=0.02)
    assert series.drifting() == []


def test_clouds_of_an_unknown_unit_are_a_series_of_their_own(tmp_path, example):
    rows = list(of_units(example, 'um', None, 'px', 'm'))
    failed = replace(example, status='failed', reason='It is no recording.')
    refused = replace(failed, status='refused', reason='It is not organized.', unit='px')
    write_rows(tmp_path, 'a', [*rows, failed, refused])
    metres, pixels, unknown = read_series(tmp_path, tmp_path / 'trend.html')
    assert (metres.title, metres.label('sq'), len(metres.times)) == ('cell1, lid, in m', 'Sq [µm]', 80)
    assert (pixels.title, pixels.label('sz'), len(pixels.times)) == ('cell1, lid, in px', 'Sz [px]', 40)
    assert (unknown.title, unknown.label('sa')) == ('cell1, lid, unit not known', 'Sa [unit not known]')
    assert unknown.values['sq'] == pytest.approx(1.0, rel=0.2)
    assert (metres.reasons, pixels.reasons) == ({}, {'It is not organized.': 1})
    assert unknown.reasons == {'It is no recording.': 1}


def test_one_large_value_does_not_change_the_prefix(tmp_path, example):
    first, *rows = of_units(example, 'm')
    write_rows(tmp_path, 'a', [replace(first, sq=1.0), *rows])
    (series,) = read_series(tmp_path, tmp_path / 'trend.html')
    assert series.label('sq') == 'Sq [µm]'


def test_the_charts_show_the_unit_of_the_chosen_series(tmp_path, example):
    write_rows(tmp_path, 'a', list(of_units(example, 'm', 'px')))
    write_trend(tmp_path, tmp_path / 'trend.html')
    with opened_page(tmp_path / 'trend.html') as page:
        for series, title, value in (('in px', 'Sq [px]', 1), ('in m', 'Sq [µm]', 2)):
            page.get_by_role('combobox').select_option(f'cell1, lid, {series}')
            page.wait_for_function(SHOWN, arg=[title, value])  # the chart is drawn a moment later
            assert page.evaluate(SHOWN, [title, value])


SHOWN = """([title, value]) => {
  const below = (view) => [view, ...[...(view.children?.() ?? [])].flatMap(below)]
  const plot = [...Bokeh.index.roots].flatMap(below).find((view) => view.model.title?.text === title)
  if (!plot) { return false }
  const range = plot.model.y_range
  return range.start < value && value < range.end && range.end - range.start < value
}"""
"""Whether a chart has the title, and its axis lies round the value."""


def test_limits_begin_anew_after_a_change_which_is_told(tmp_path, example):
    first = list(rows_of(example, 'cell1', 0))
    later = [
        replace(
            each, time=each.time + timedelta(days=1), sq=each.sq + 5, settings_hash='other', version='2.0.0',
            settings='{"circle.window": 5}',
        )
        for each in first
    ]  # fmt: skip
    write_rows(tmp_path, 'a', [*first, *later])
    (series,) = read_series(tmp_path, tmp_path / 'trend.html')
    assert [phase.change for phase in series.phases] == ['', 'version 1.2.3 to 2.0.0, circle.window default to 5']
    assert series.phases[1].limits['sq'].centre > 5
    assert series.drifting() == []


def test_a_lesson_that_was_taught_again_is_told_as_a_change(tmp_path, example):
    first = list(rows_of(example, 'cell1', 0, count=9, settings='{"circle.lesson": "lid.json"}'))
    later = [replace(each, time=each.time + timedelta(days=1), settings_hash='other') for each in first]
    write_rows(tmp_path, 'a', [*first, *later])
    (series,) = read_series(tmp_path, tmp_path / 'trend.html')
    assert [phase.change for phase in series.phases] == ['', 'circle.lesson taught again']


@pytest.mark.parametrize(
    ('changed', 'told'),
    [({'version': '2.0.0'}, 'version 1.2.3 to 2.0.0'), ({'settings_hash': 'other'}, 'settings')],
)
def test_a_change_of_the_version_or_of_the_settings_alone_is_told(tmp_path, example, changed, told):
    first = list(rows_of(example, 'cell1', 0, count=9))
    later = [replace(each, time=each.time + timedelta(days=1), **changed) for each in first]
    write_rows(tmp_path, 'a', [*first, *later])
    (series,) = read_series(tmp_path, tmp_path / 'trend.html')
    assert [phase.change for phase in series.phases] == ['', told]


def series_of(values, signals):
    values = np.array(values, float)
    known = {'sq': values}, {'sq': np.array(signals, np.uint8)}
    return Series('cell1', 'lid', 'um', 'µm', False, np.arange(float(values.size)), *known, [], [], [])


@pytest.mark.parametrize(
    ('values', 'signals', 'drifts'),
    [
        ([1] * 20, [0] * 9 + [1] * 11, True),
        ([1] * 20, [0] * 10 + [1] * 10, False),
        ([1] * 40, [1] * 20 + [0] * 20, False),
        ([1] * 19, [1] * 19, False),
        ([1, np.nan] * 20, [1, 0] * 20, True),
    ],
    ids=['eleven of the last twenty', 'ten', 'twenty before them', 'nineteen in all', 'every second is known'],
)
def test_a_series_drifts_by_its_last_twenty_known_values(values, signals, drifts):
    assert series_of(values, signals).drifting() == ['sq'] * drifts


def test_the_time_of_the_filter_is_held_to_limits_for_live_clouds_only(tmp_path, example):
    slower = [replace(each, total_ms=1.0 + number) for number, each in enumerate(rows_of(example, 'cell1', 0))]
    live = [replace(each, cell='cell2', recording=None, latency_ms=each.total_ms) for each in slower]
    write_rows(tmp_path, 'a', [*slower, *live])
    one, two = read_series(tmp_path, tmp_path / 'trend.html')
    assert (one.drifting(), two.drifting()) == ([], ['time_ms'])


def test_values_that_are_not_known_are_left_out(tmp_path, example):
    rows = [replace(each, sa=None) for each in rows_of(example, 'cell1', 0, count=30)]
    write_rows(tmp_path, 'a', rows)
    (series,) = read_series(tmp_path, tmp_path / 'trend.html')
    assert np.isnan(series.values['sa']).all()
    assert not series.signals['sa'].any()
    assert 'sa' not in series.phases[0].limits


def test_a_measure_that_does_not_change_is_not_drawn_as_if_it_were_zero(tmp_path, example):
    rows = [replace(each, outlier_share=0.004) for each in rows_of(example, 'cell1', 0, count=30)]
    write_rows(tmp_path, 'a', rows)
    write_trend(tmp_path, tmp_path / 'trend.html')
    spans = re.findall(r'"default_span":([\d.e-]+)', (tmp_path / 'trend.html').read_text(encoding='utf-8'))
    assert 0 < min(map(float, spans)) < 0.4  # in percent


def test_a_cloud_links_to_its_report_where_there_is_one(out, tmp_path):
    (out / 'reports').mkdir()
    (out / 'reports/a b.mcap.html').write_text('')
    Ledger(out).record('abc', LedgerEntry('nights/a.mcap', 1, '1', 'd', name='a b.mcap'))
    one, _ = read_series(out, tmp_path / 'pages/trend.html')
    assert one.links[7] == '../out/reports/a%20b.mcap.html#measurement--cell1-points-7'


def test_a_report_that_the_last_run_did_not_make_is_not_linked(out, tmp_path):
    (out / 'reports').mkdir()
    (out / 'reports/a.mcap.html').write_text('')
    for made, is_linked in (((), False), (('reports/a.mcap.html',), True)):
        Ledger(out).record('abc', LedgerEntry('nights/a.mcap', 1, '1', 'd', name='a.mcap', outputs=made))
        assert bool(read_series(out, tmp_path / 'trend.html')[0].links[7]) is is_linked


ON_THE_SCREEN = """() => {
  const below = (view) => [view, ...[...(view.children?.() ?? [])].flatMap(below)]
  const plot = [...Bokeh.index.roots].flatMap(below).find((view) => view.model.title?.text?.startsWith('Sq'))
  const data = plot.model.renderers.find((each) => each.glyph?.type === 'Scatter').data_source.data
  plot.el.scrollIntoView()
  const box = plot.el.getBoundingClientRect()
  return [box.x + plot.frame.x_scale.compute(data.time[7]), box.y + plot.frame.y_scale.compute(data.sq[7])]
}"""
"""Gives where the chart of Sq shows its cloud 7."""


def test_a_click_on_a_point_opens_the_report_of_its_cloud(tmp_path, example):
    out = tmp_path / 'out'
    write_rows(out, 'a', list(rows_of(example, 'cell1', 0, count=30)))
    (out / 'reports').mkdir()
    (out / 'reports/a b.mcap.html').write_text('<h1>The report of it</h1>')
    Ledger(out).record('abc', LedgerEntry('nights/a.mcap', 1, '1', 'd', name='a b.mcap'))
    write_trend(out, tmp_path / 'trend.html')
    with opened_page(tmp_path / 'trend.html') as page:
        with page.expect_popup() as opened:
            page.mouse.click(*page.evaluate(ON_THE_SCREEN))
        report = opened.value
        assert report.url.endswith('/out/reports/a%20b.mcap.html#measurement--cell1-points-7')
        assert report.get_by_role('heading', name='The report of it').is_visible()
        assert page.get_by_role('link', name='Report of this cloud').is_visible()


def test_the_page_needs_no_other_file_and_names_are_escaped(tmp_path, example):
    rows = list(rows_of(example, '<b>cell</b>', 0.02, part='</script>'))
    failed = replace(example, status='failed', cell='<b>cell</b>', reason='It is <no> recording.')
    write_rows(tmp_path / 'out', 'a', [*rows, failed])
    Ledger(tmp_path / 'out').record('abc', LedgerEntry('a', 1, '1', 'd', damage='a.mcap is damaged.'))
    found = write_trend(tmp_path / 'out', tmp_path / 'pages/trend.html')
    page = (tmp_path / 'pages/trend.html').read_text()
    assert len(found) == 2
    assert not re.findall(r'<script[^>]*\ssrc=|<link', page)
    assert '<b>cell</b>' not in page
    assert '&lt;b&gt;cell&lt;/b&gt;' in page
    assert 'It is &lt;no&gt; recording.' in page
    assert 'a.mcap is damaged.' in page
    assert 'eight points on one side of the centre line' in page
    assert all(f'{label}' in page for label in MEASURES.values())
    assert 'Sq [unit not known]' in page


def test_the_page_opens_on_a_series_with_clouds(tmp_path, example):
    failed = replace(example, status='failed', cell='a', reason='It is no `recording`.', sq=None)
    write_rows(tmp_path, 'a', [failed, *rows_of(example, 'b', 0, count=10)])
    write_trend(tmp_path, tmp_path / 'trend.html')
    page = (tmp_path / 'trend.html').read_text(encoding='utf-8')
    assert 'a, lid, 1 failure: It is no <code>recording</code>.' in page
    assert 'a click on a point shows its values.' in page
    with opened_page(tmp_path / 'trend.html') as opened:
        assert opened.get_by_role('combobox').input_value() == 'b, lid'


def test_shares_are_in_percent(tmp_path, example):
    write_rows(tmp_path, 'a', list(rows_of(example, 'cell1', 0, count=10, outlier_share=0.02, measured_share=1.0)))
    (series,) = read_series(tmp_path, tmp_path / 'trend.html')
    assert set(series.values['outlier_share']) == {2.0}
    assert set(series.values['measured_share']) == {100.0}
    assert series.label('measured_share') == 'share of measured points [%]'


def test_without_bokeh_the_command_that_installs_it_is_told(out, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, 'bokeh.embed', None)
    with pytest.raises(SocialCircleError, match='needs Bokeh: pip install'):
        write_trend(out, tmp_path / 'trend.html')
