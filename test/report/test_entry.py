"""What a report says of a cloud."""

import numpy as np
import pytest
from examples import cloud, surface

from socialcircle_ros.messages.diagnostics import Status
from socialcircle_ros.metrics.areal import texture
from socialcircle_ros.pipeline.clouds import filter_cloud
from socialcircle_ros.report.entry import make_entry, report_page, settings_table, when
from socialcircle_ros.settings import CircleSettings, OutputSettings

pytest.importorskip('PIL')


def seen(points=None, circle=None, output=None, **more):
    points = points or cloud()
    return make_entry('/points 0', points, filter_cloud(points, circle, output), **more)


def texts(measurement):
    beside = measurement.section().items[1]
    return {row[0]: row[1:] for table in beside.tables for row in table.texts()}


def test_numbers_are_those_of_the_filter_and_of_the_heights():
    found = seen()
    z = surface()[..., 2]
    kept = z.copy()
    kept[10, 12], kept[40:45, 50:55] = np.nan, np.nan
    assert (found.before, found.after) == (texture(z), texture(kept))
    shown = texts(found)
    assert shown['measured'] == ['5,594 (99.9%)']
    assert shown['outliers'] == ['26 (0.46%)']
    assert shown['kept'] == ['5,568']
    assert shown['Sz'][:2] == [f'{found.before.sz:.4g}', f'{found.after.sz:.4g}']
    assert shown['circle.radius_scale'] == ['1.0']
    assert found.row()[:5] == ['/points 0', '1.000\N{NO-BREAK SPACE}s', 5594, 26, 26 / 5594]


def test_a_truth_is_scored():
    z = surface()[..., 2]
    truth = np.abs(z) > 20
    truth[0, 0] = True
    found = seen(truth=(truth, np.isfinite(z)))
    assert (found.scores.precision, found.scores.recall) == (1.0, pytest.approx(26 / 27))
    assert texts(found)['recall'] == ['96.3%']


def test_holes_that_were_filled_are_shown():
    found = seen(output=OutputSettings(repaired=True))
    assert [title for title, _ in found.panels.pictures][3] == 'repaired'
    assert int(texts(found)['repaired'][0]) > 0


def test_what_the_filter_warns_of_is_told():
    assert any('more than half' in warning for warning in seen(circle=CircleSettings(radius_scale=0.3)).warnings)
    assert not seen().warnings


@pytest.mark.parametrize(
    ('values', 'sentences'),
    [
        ({'circle.radius_scale': '2.0', 'outliers': '7'}, ['had circle.radius_scale 2.0 (here 1.0), and found 7']),
        ({'circle.radius_scale': '1.0', 'outliers': '7'}, ['found 7 outliers with the same settings']),
        ({'circle.radius_scale': '1.0', 'outliers': '26'}, []),
        ({}, []),
    ],
)
def test_what_a_node_once_said_is_compared(values, sentences):
    warnings = seen(recorded=Status(0, '', '', '', values)).warnings
    assert len(warnings) == len(sentences)
    assert all(sentence in warning for sentence, warning in zip(sentences, warnings, strict=True))


def test_settings_that_are_not_the_default_stand_out():
    rows = {row[0]: row[1:] for row in settings_table([CircleSettings(window=5)]).rows}
    assert rows['circle.window'] == ['5', '3', 'points', 'changed']
    assert rows['circle.radius_scale'] == ['1.0', '1.0', '', '']


def test_a_stamp_is_a_date_where_it_can_be_one():
    assert when(1_700_000_000_500_000_000) == '2023-11-14 22:13:20.500 UTC'
    assert when(12_034_000_000) == '12.034 s'


def test_the_page_has_every_measurement_and_all_that_went_wrong():
    page = report_page('night', [seen()], [CircleSettings()], {'too short': 2, 'odd': 1}, 'broken off')
    assert 'href="#measurement--points-0"' in page
    assert 'id="measurement--points-0"' in page
    for sentence in ('Refused, 2 times: too short', 'Refused: odd', 'broken off'):
        assert sentence in page
