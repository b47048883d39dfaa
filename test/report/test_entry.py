"""The entry of one cloud in a report."""

import numpy as np
import pytest
from examples import cloud, surface

from socialcircle_ros.messages.diagnostics import Status
from socialcircle_ros.metrics.areal import texture
from socialcircle_ros.pipeline.clouds import filter_cloud
from socialcircle_ros.report.entry import make_entry, outliers_of, stamp_text
from socialcircle_ros.settings import CircleSettings, OutputSettings, PipelineSettings

pytest.importorskip('PIL')


def entry(points=None, circle=None, output=None, **more):
    points = points or cloud()
    settings = PipelineSettings(circle=circle or CircleSettings(), output=output or OutputSettings())
    return make_entry('/points 0', points, filter_cloud(points, settings), **more)


def texts(found):
    """The cells of the entry's tables: the first cell of each row, and the others."""
    beside = found.section().items[1]
    return {row[0]: row[1:] for table in beside.tables for row in table.texts()}


def test_the_numbers_are_those_of_the_filter_and_of_the_heights():
    found = entry()
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


def test_precision_and_recall_are_shown_where_the_truth_is_known():
    z = surface()[..., 2]
    truth = np.abs(z) > 20
    truth[0, 0] = True
    found = entry(truth=(truth, np.isfinite(z)))
    assert (found.scores.precision, found.scores.recall) == (1.0, pytest.approx(26 / 27))
    assert texts(found)['recall'] == ['96.3%']
    assert 'recall' not in texts(entry())


def test_a_repaired_cloud_is_shown_with_the_number_of_filled_points():
    found = entry(output=OutputSettings(repaired=True))
    assert [title for title, _ in found.panels.pictures][3] == 'repaired'
    assert int(texts(found)['repaired'][0]) > 0
    assert 'repaired' not in texts(entry())


def test_the_colour_bar_of_a_stack_is_in_metres():
    assert entry(is_stack=True).panels.scale[1].endswith(' m')
    assert ' ' not in entry().panels.scale[1]


def test_warnings_of_the_filter_are_shown():
    assert any('more than half' in warning for warning in entry(circle=CircleSettings(radius_scale=0.3)).warnings)
    assert not entry().warnings


@pytest.mark.parametrize(
    ('values', 'sentences'),
    [
        ({'circle.radius_scale': '2.0', 'outliers': '7'}, ['had circle.radius_scale 2.0 (here 1.0) and found 7']),
        ({'circle.radius_scale': '1.0', 'outliers': '7'}, ['found 7 outliers with the same circle parameters']),
        ({'circle.radius_scale': '1.0', 'outliers': '26'}, []),
        ({}, []),
        (
            {'outliers': 'many'},
            ["cannot be compared. The message is not a measurement of the node: its key 'outliers'"],
        ),
    ],
)
def test_differences_from_a_recorded_measurement_are_warnings(values, sentences):
    warnings = entry(recorded=Status(0, '', '', '', values)).warnings
    assert len(warnings) == len(sentences)
    assert all(sentence in warning for sentence, warning in zip(sentences, warnings, strict=True))


def test_a_result_without_a_mask_cannot_be_shown():
    with pytest.raises(ValueError, match=r'ask for it with OutputSettings\(mask=True\)'):
        outliers_of(filter_cloud(cloud(), PipelineSettings(output=OutputSettings(mask=False))))


def test_a_stamp_is_shown_as_a_date_if_it_counts_from_the_epoch():
    assert stamp_text(1_700_000_000_500_000_000) == '2023-11-14 22:13:20.500 UTC'
    assert stamp_text(12_034_000_000) == '12.034 s'
