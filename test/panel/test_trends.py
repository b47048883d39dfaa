# SPDX-License-Identifier: Apache-2.0
"""The page of trends, as the tuning page serves it."""

import pytest
from archive.test_trend import rows_of
from measurements.row_examples import row

from socialcircle_ros.archive.ledger import Ledger, LedgerEntry
from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.measurements import write_rows
from socialcircle_ros.panel.trends import PAGE, Trends

for library in ('bokeh', 'pyarrow', 'duckdb'):
    pytest.importorskip(library)


@pytest.fixture
def folder(tmp_path):
    """Measurements that drift, with a report; and a page beside them that is none of the reports."""
    out = tmp_path / 'out'
    write_rows(out, 'a', list(rows_of(row(), 'cell2', 0.02)))
    (out / 'reports/cell 1').mkdir(parents=True)
    (out / 'reports/a b.mcap.html').write_text('<h1>The report of it</h1>')
    (out / 'reports/cell 1/lid.mcap.html').write_text('in a folder')
    (out / 'reports/out.html').symlink_to(tmp_path / 'secret.html')
    (out / 'reports/notes.html').symlink_to(out / 'reports/notes.txt')
    (out / 'reports/up').symlink_to(tmp_path)
    (out / 'reports/circle.html').symlink_to(out / 'reports/circle.html')
    (tmp_path / 'reports of others').mkdir()
    (tmp_path / 'reports of others/secret.html').write_text('secret')
    (out / 'reports/notes.txt').write_text('secret')
    (tmp_path / 'secret.html').write_text('secret')
    Ledger(out).record('abc', LedgerEntry('nights/a.mcap', 1, '1', 'd', name='a b.mcap'))
    return out


def test_the_page_and_its_reports_are_read_and_nothing_else(folder):
    trends = Trends()
    assert trends.read(PAGE) is None
    before = sorted(folder.rglob('*'))
    trends.make(str(folder))
    assert sorted(folder.rglob('*')) == before
    assert trends.drifts == ('cell2, lid drifts: Sq.',)
    assert b'reports/a%20b.mcap.html#measurement--cell1-points-7' in trends.read(PAGE)
    assert trends.read('reports/a%20b.mcap.html') == b'<h1>The report of it</h1>'
    assert trends.read('reports/cell%201/lid.mcap.html') == b'in a folder'
    for path in (
        'reports/notes.txt', 'reports/../../secret.html', 'reports/..%2F..%2Fsecret.html', '../secret.html',
        f'reports/{folder.parent}/secret.html', 'reports/', 'reports', '', 'reports/none.html', 'reports/%00.html',
        f'reports/%2F{folder.parent}/secret.html', 'reports/cell%201/%2E%2E/../../secret.html', 'reports/out.html',
        'reports/notes.html', 'reports/up/secret.html', 'reports/circle.html', 'reports/cell%201',
        'reports/../../reports%20of%20others/secret.html',
    ):  # fmt: skip
        assert trends.read(path) is None


def test_a_folder_without_measurements_leaves_the_last_one(folder, tmp_path):
    trends = Trends()
    trends.make(str(folder))
    page = trends.read(PAGE)
    with pytest.raises(SocialCircleError):
        trends.make(str(tmp_path / 'empty'))
    assert (trends.folder, trends.read(PAGE)) == (str(folder), page)


def test_a_visitor_names_a_folder_sees_what_drifts_and_opens_page_and_report(tuning, folder):
    visitor = tuning.visitor
    visitor.open_tab('Trends')
    visitor.field('measurements').fill(str(folder.parent / 'nowhere'))
    visitor.press('Show the trends')
    assert visitor.sees('nowhere')
    visitor.field('measurements').fill(str(folder))
    visitor.press('Show the trends')
    assert visitor.sees('cell2, lid drifts: Sq.')
    with visitor.page.expect_popup() as opened:
        visitor.page.get_by_role('link', name='Open the page of trends').click()
    page = opened.value
    assert page.get_by_role('heading', name='Trends of out').is_visible()
    assert page.goto(page.url.replace('trend.html', 'reports/cell%201/lid.mcap.html')).text() == 'in a folder'
    page.goto(page.url.replace('cell%201/lid.mcap.html', 'a%20b.mcap.html'))
    assert page.get_by_role('heading', name='The report of it').is_visible()
    answer = page.goto(page.url.replace('/trends/', '/trends/none/'))
    assert answer.status == 404
    page.close()
