# SPDX-License-Identifier: Apache-2.0
"""One row per cloud."""

import dataclasses
import json
from dataclasses import replace
from datetime import date, datetime, timezone

from examples import cloud
from measurements.row_examples import NOON, measurement, origin, row
from settings.test_lessons import PLAIN

from socialcircle_ros.measurements import MeasurementRow, SettingsText, refused_row, row_of
from socialcircle_ros.messages.header import Header
from socialcircle_ros.metrics.areal import Texture
from socialcircle_ros.pipeline.clouds import filter_cloud
from socialcircle_ros.settings import CircleSettings, LimitSettings, OutputSettings, PipelineSettings


def test_a_row_holds_what_the_filter_says_of_the_cloud():
    found = row()
    assert (found.status, found.reason) == ('ok', None)
    assert (found.points, found.measured, found.outliers, found.kept) == (5600, 5594, 26, 5568)
    assert found.outlier_share == 26 / 5594
    assert found.measured_share == 5594 / 5600
    assert (found.sa, found.sq, found.sz) == (0.1, 0.2, 3.0)
    assert (found.cell, found.part, found.topic, found.number) == ('cell1', 'lid', '/cell1/points', 3)
    assert (found.time, found.day) == (datetime(2026, 9, 21, 14, 13, 20, tzinfo=timezone.utc), date(2026, 9, 21))
    assert sum(found.stages_ms.values()) == found.total_ms
    assert 'total' not in found.stages_ms
    assert found.mode == 'adaptive'
    assert found.radius > 0


def test_the_unit_of_the_lengths_is_in_the_row():
    assert row().unit is None
    assert [row(unit=unit).unit for unit in ('m', 'µm', 'px')] == ['m', 'um', 'px']
    assert refused_row(origin(unit='mm'), 'It is not organized.').unit == 'mm'


def test_a_stamp_that_is_no_date_gives_way_to_the_time_of_the_recording():
    assert row(stamp=1_500_000_000).time == row().time
    assert row(stamp=1_500_000_000).stamp == '1.500000000'


def test_the_last_time_of_a_recording_is_a_day():
    assert row(stamp=1, time_ns=2**64 - 1).day == date(2554, 7, 21)


def test_limits_that_are_not_passed_are_in_the_row():
    limited = PipelineSettings(limits=LimitSettings(outlier_share_max=1e-6, sz_max=0.5))
    measured = filter_cloud(cloud(), limited).measurement
    for unit, end in ((None, ', above 0.5, in the unit of the cloud.'), ('mm', ' mm, above 500 µm.')):
        made = row_of(origin(unit=unit), measured)
        assert (made.status, made.limits_passed) == ('warning', False)
        assert 'are outliers, more than' in made.limits_reason
        assert made.limits_reason.endswith(end)
        assert made.limits_reason in made.reason
    passed = PipelineSettings(limits=LimitSettings(outlier_share_max=0.5))
    assert row_of(origin(), filter_cloud(cloud(), passed).measurement).limits_passed is True
    assert row().limits_passed is None


def test_a_warning_is_told():
    warned = replace(measurement(), level=1, message='Look at the mask.')
    assert (row_of(origin(), warned).status, row_of(origin(), warned).reason) == ('warning', 'Look at the mask.')


def test_a_texture_that_is_not_known_is_null():
    nan = float('nan')
    assert row_of(origin(), measurement(), Texture(nan, nan, nan)).sq is None


def test_a_refused_cloud_and_a_recording_that_cannot_be_read_are_rows_too():
    refused = refused_row(origin(), 'It is not organized.')
    assert (refused.status, refused.reason, refused.number) == ('refused', 'It is not organized.', 3)
    assert (refused.stamp, refused.frame, refused.day) == (None, None, date(2026, 9, 21))
    tomorrow = Header.at(NOON + 86_400_000_000_000, 'stage')
    refused = refused_row(origin(), 'It is not organized.', header=tomorrow)
    assert (refused.stamp, refused.frame) == (f'{NOON // 10**9 + 86_400}.000000000', 'stage')
    assert refused.day == date(2026, 9, 22)
    assert refused_row(origin(), 'No.', header=Header(5)).day == date(2026, 9, 21)  # no date
    failed = refused_row(origin(topic='', number=0), 'It is no recording.', 'failed')
    assert (failed.status, failed.topic, failed.number, failed.points) == ('failed', None, None, None)


def test_settings_are_told_by_what_differs_and_by_a_hash_of_what_has_an_effect():
    default = SettingsText.of(PipelineSettings())
    assert default.text == '{}'
    wide = SettingsText.of(PipelineSettings(circle=CircleSettings(radius_scale=2.0)))
    assert json.loads(wide.text) == {'circle.radius_scale': 2.0}
    assert wide.digest != default.digest
    assert SettingsText.of(PipelineSettings(output=OutputSettings(mask=False))) == default


def test_a_lesson_that_is_taught_again_under_its_name_has_another_hash(tmp_path):
    path, digests = tmp_path / 'lid.json', []
    for threshold in (0.5, 0.6, 0.5):
        path.write_text(replace(PLAIN, threshold=threshold).to_text())
        settings = SettingsText.of(PipelineSettings(circle=CircleSettings(lesson=str(path))))
        assert json.loads(settings.text) == {'circle.lesson': str(path)}
        digests.append(settings.digest)
    assert digests[0] == digests[2] != digests[1]


def test_every_column_is_described():
    for column in MeasurementRow.columns():
        assert column.sentence.endswith('.'), column
    assert [each.name for each in MeasurementRow.columns()] == [
        each.name for each in dataclasses.fields(MeasurementRow)
    ]
    assert row(time_ns=NOON).schema_version == 2
