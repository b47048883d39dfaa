# SPDX-License-Identifier: Apache-2.0
"""The entry of one cloud in a report."""

import numpy as np
import pytest
from examples import MARKS, NAN, cloud, marked, surface

from socialcircle_ros.digits import number_text
from socialcircle_ros.messages.diagnostics import Status
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.point_cloud import encode_point_cloud
from socialcircle_ros.metrics.areal import areal_texture
from socialcircle_ros.pipeline.clouds import filter_cloud
from socialcircle_ros.report.content import Banner
from socialcircle_ros.report.entry import date_text, make_entry, mask_of, value_text
from socialcircle_ros.settings import CircleSettings, LimitSettings, OutputSettings, PipelineSettings

pytest.importorskip('PIL')


def entry(points=None, circle=None, output=None, **more):
    points = points or cloud()
    settings = PipelineSettings(circle=circle or CircleSettings(mode='paper'), output=output or OutputSettings())
    return make_entry('/points 0', points, filter_cloud(points, settings), **more)


def texts(found):
    """The cells of the entry's tables: the first cell of each row, and the others."""
    beside = found.section().items[-1]
    return {row[0]: row[1:] for table in beside.tables for row in table.texts()}


def test_the_numbers_are_those_of_the_filter_and_of_the_heights():
    found = entry()
    xyz = surface()
    kept = np.ones(xyz.shape[:2], bool)
    kept[10, 12], kept[40:45, 50:55] = False, False
    assert (found.before, found.after) == (areal_texture(xyz), areal_texture(xyz, kept))
    shown = texts(found)
    assert shown['measured'] == ['5,594 (99.9 %)']
    assert shown['outliers'] == ['26 (0.46 %)']
    assert shown['kept'] == ['5,568']
    assert shown['Sz'][:2] == [number_text(each.sz, 4) for each in (found.before, found.after)]
    assert (shown['Sa'][2], shown['Sz'][2]) == ('−18.0 %', '−96.2 %')
    assert shown['circle.radius_scale'] == ['1.0']
    assert 'circle.depth_of_field' not in shown  # has no effect in this mode
    assert found.row(None)[:6] == ['/points 0', '1.000 s', '–', 5594 / 5600, 26, 26 / 5594]


@pytest.mark.parametrize('mark', MARKS.values(), ids=MARKS)
def test_a_mark_of_what_is_not_measured_is_no_height(mark):
    of_mark, of_nan = (entry(encode_point_cloud(Header(1, 0, 'm'), marked(each))) for each in (mark, NAN))
    assert of_mark.before == of_nan.before
    assert of_mark.after == of_nan.after
    assert of_mark.after.sz < 10
    assert of_mark.pictures == of_nan.pictures


def test_a_setting_of_a_judge_that_does_not_judge_is_not_shown():
    shown = texts(entry(circle=CircleSettings(judge='rules')))
    assert shown['circle.judge'] == ['rules']
    assert 'circle.provider' not in shown


def test_precision_and_recall_are_shown_where_the_truth_is_known():
    z = surface()[..., 2]
    truth = np.abs(z) > 20
    truth[0, 0] = True
    found = entry(truth=(truth, np.isfinite(z)))
    assert (found.scores.precision, found.scores.recall) == (1.0, pytest.approx(26 / 27))
    assert texts(found)['recall'] == ['96.3 %']
    assert 'recall' not in texts(entry())


def test_a_repaired_cloud_is_shown_with_the_number_of_filled_points():
    found = entry(output=OutputSettings(repaired=True))
    assert [each.name for row in found.pictures for each in row.pictures] == [
        'before', 'after', 'repaired', 'difference', 'histogram', 'profile',
    ]  # fmt: skip
    assert int(texts(found)['repaired'][0]) > 0
    assert 'repaired' not in texts(entry())


def test_lengths_have_their_unit_and_are_numbers_where_it_is_not_known():
    found = texts(entry(unit='mm'))
    assert found['Sz'][0].endswith(' mm')
    assert found['radius found'] == ['2.24 mm']
    assert found['worst outlier'][0] == '29 mm over the surface'
    unknown = texts(entry())
    assert unknown['worst outlier'][0] == '29 over the surface'
    assert unknown['unit of lengths'] == ['not known']


def test_a_verdict_stands_at_the_top():
    limits = LimitSettings(outlier_share_max=0.001)
    points = cloud()
    failed = make_entry('/points 0', points, filter_cloud(points, PipelineSettings(limits=limits)))
    assert failed.failed
    banner = failed.section().items[0]
    assert (banner.state, banner.title) == (
        'failed', 'Failed: 0.46 % of the measured points are outliers, more than 0.1 %.',
    )  # fmt: skip
    assert not entry().failed
    assert not any(isinstance(item, Banner) for item in entry().section().items)


def test_warnings_of_the_filter_are_shown():
    assert any(
        'more than half' in warning
        for warning in entry(circle=CircleSettings(mode='paper', radius_scale=0.3)).warnings
    )
    assert not entry().warnings


def test_warnings_do_not_repeat_the_counts_and_stay_where_limits_fail():
    settings = PipelineSettings(
        circle=CircleSettings(mode='paper', radius_scale=0.3), limits=LimitSettings(outlier_share_max=0.001)
    )
    found = make_entry('/points 0', cloud(), filter_cloud(cloud(), settings))
    assert found.failed
    assert len(found.warnings) == 1
    assert found.warnings[0].startswith('The outliers are more than half of the points')


def test_what_counts_as_not_measured_is_told_and_no_warning():
    found = entry(encode_point_cloud(Header(1, 0, 'm'), marked(MARKS['the origin'])))
    assert len(found.section().text) == 1
    assert 'not measured' in found.section().text[0]
    assert not found.warnings


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
        mask_of(filter_cloud(cloud(), PipelineSettings(output=OutputSettings(mask=False))))


def test_a_stamp_is_shown_as_a_date_if_it_counts_from_the_epoch():
    assert date_text(1_700_000_000_500_000_000) == '2023-11-14 22:13:20.500 UTC'
    assert date_text(12_034_000_000) == '12.034 s'
    assert not date_text(0)


@pytest.mark.parametrize(
    ('name', 'value', 'unit', 'text'),
    [
        ('circle.radius', '0.0', 'um', 'automatic'),
        ('circle.radius', '0.25', 'um', '250 nm'),
        ('circle.radius', '0.25', None, '0.25'),
        ('circle.window', '3', None, '3 points'),
        ('stack.z_step', '2e-06', None, '2 µm'),
        ('limits.sq_max', '0.0', 'm', 'none'),
        ('circle.lesson', '', None, 'none'),
        ('circle.lesson', 'lid.teach', None, 'lid.teach'),
    ],
)
def test_values_of_parameters_have_units(name, value, unit, text):
    assert value_text(name, value, unit) == text
