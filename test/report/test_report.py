# SPDX-License-Identifier: Apache-2.0
"""`make_report`, called as from a notebook."""

import re
from pathlib import Path

import pytest
from examples import cloud

import socialcircle_ros
from socialcircle_ros.errors import RecordingError, SocialCircleError
from socialcircle_ros.messages import point_cloud
from socialcircle_ros.pipeline.clouds import filter_cloud
from socialcircle_ros.recording import RecordingWriter, ros_topic
from socialcircle_ros.report.entry import make_entry
from socialcircle_ros.report.report import measurements_table, report_page, settings_table, verdict_banner
from socialcircle_ros.settings import CircleSettings, LimitSettings, PipelineSettings
from socialcircle_ros.settings.files import read_parameter_file

pytest.importorskip('matplotlib')


@pytest.fixture
def recording(tmp_path):
    """Two clouds, and between them one that is not organized."""
    path = tmp_path / 'night.mcap'
    with RecordingWriter(path) as writer:
        writer.add_topic(ros_topic('/points', point_cloud.TYPE))
        for number, points in enumerate((cloud(), cloud(1, 9), cloud(seed=1))):
            writer.write('/points', points, number)
    return path


def test_a_notebook_gets_the_numbers_and_the_page(recording, tmp_path):
    settings = PipelineSettings(circle=CircleSettings(mode='paper', radius_scale=1.5))
    report = socialcircle_ros.make_report(recording, tmp_path / 'new/report.html', settings)
    assert [entry.name for entry in report.entries] == ['/points 0', '/points 2']
    assert [entry.measurement.outliers for entry in report.entries] == [26, 26]
    assert (report.measured, report.outliers) == (2 * 5594, 2 * 26)
    assert report.entries[0].circle['circle.radius_scale'] == '1.5'
    assert report.path == tmp_path / 'new/report.html'
    assert '/points 2, 1.000 s' in report.path.read_text()
    ((reason, count),) = report.refused.items()
    assert 'not organized' in reason
    assert count == 1
    assert report.damage is None


def test_a_stack_shows_its_frames_its_quality_and_its_picture(tmp_path):
    bags = Path(__file__).parents[2] / 'bags'
    values = read_parameter_file(bags / 'stack.yaml', 'social_circle')
    report = socialcircle_ros.make_report(
        bags / 'stack.mcap', tmp_path / 'report.html', PipelineSettings.from_ros(values)
    )
    (entry,) = report.entries
    rows = dict(entry.stack.table.rows)
    assert rows['frames'] == '32'
    assert rows['step of the focus measure'] == '2 pixels'
    assert float(rows['quality of at least 0.9'].split('%')[0]) > 50
    assert [picture.name for picture in entry.stack.pictures.pictures] == ['in_focus', 'quality']
    page = report.path.read_text()
    assert all(picture.source in page for picture in entry.stack.pictures.pictures)
    assert 'Focus stack' in page


def test_every_picture_has_words_for_those_who_do_not_see_it(tmp_path):
    bags = Path(__file__).parents[2] / 'bags'
    settings = PipelineSettings.from_ros(read_parameter_file(bags / 'stack.yaml', 'social_circle'))
    socialcircle_ros.make_report(bags / 'stack.mcap', tmp_path / 'stack.html', settings)
    alts = re.findall(r'<button class="enlarge"[^>]*><img alt="([^"]*)"', (tmp_path / 'stack.html').read_text())
    assert '/stack/points 0: picture in focus' in alts
    assert '/stack/points 0: heights without the outliers' in alts
    assert all(alts)
    assert len(set(alts)) == len(alts)


def test_paths_may_be_texts_and_settings_have_defaults(recording, tmp_path):
    report = socialcircle_ros.make_report(str(recording), str(tmp_path / 'report.html'))
    assert report.entries[0].circle['circle.radius_scale'] == '1.0'


def test_progress_counts_the_messages(recording, tmp_path):
    seen = []
    socialcircle_ros.make_report(
        recording, tmp_path / 'report.html', progress=lambda done, total: seen.append((done, total))
    )
    assert seen[:3] == [(1, 3), (2, 3), (3, 3)]
    assert set(seen[3:]) <= {(3, 3)}


def test_a_topic_can_be_chosen(recording, tmp_path):
    with pytest.raises(RecordingError, match='has no topic /other'):
        socialcircle_ros.make_report(recording, tmp_path / 'report.html', topics=['/other'])
    assert not (tmp_path / 'report.html').exists()


def test_a_recording_without_a_usable_cloud_is_an_error(tmp_path):
    with RecordingWriter(tmp_path / 'lines.mcap') as writer:
        writer.add_topic(ros_topic('/points', point_cloud.TYPE))
        writer.write('/points', cloud(1, 9), 0)
    with pytest.raises(RecordingError, match='has no cloud that can be filtered. The cloud is not organized'):
        socialcircle_ros.make_report(tmp_path / 'lines.mcap', tmp_path / 'report.html')


def test_a_folder_is_no_page(recording, tmp_path):
    with pytest.raises(SocialCircleError, match='is a directory; give the name of a page'):
        socialcircle_ros.make_report(recording, tmp_path)


def test_settings_with_an_effect_are_shown_and_changed_ones_marked():
    settings = PipelineSettings(circle=CircleSettings(mode='paper', window=5), limits=LimitSettings(sq_max=2.0))
    rows = {row[0]: row[1:] for row in settings_table(settings, []).rows}
    assert rows['circle.window'] == ['5 points', '3 points', 'changed']
    assert rows['circle.radius_scale'] == ['1.0', '1.0', '']
    assert rows['limits.sq_max'] == ['2', 'none', 'changed']
    assert not any(name.startswith(('focus.', 'stack.', 'repair.', 'output.')) for name in rows)
    assert 'circle.depth_of_field' not in rows
    for judge, provider in (('rules', []), ('network', ['circle.provider'])):
        adaptive = settings_table(PipelineSettings(circle=CircleSettings(judge=judge)), [])
        shown = ['circle.depth_of_field', 'circle.lesson', 'circle.not_measured']
        assert [row[0] for row in adaptive.rows] == ['circle.mode', 'circle.judge', *provider, *shown]


def test_previews_of_unfinished_stacks_are_no_setting_of_a_report(tmp_path):
    bags = Path(__file__).parents[2] / 'bags'
    settings = PipelineSettings.from_ros(read_parameter_file(bags / 'stack.yaml', 'social_circle'))
    report = socialcircle_ros.make_report(bags / 'stack.mcap', tmp_path / 'stack.html', settings)
    names = [row[0] for row in settings_table(settings, report.entries).rows]
    assert 'stack.frames' in names
    assert 'stack.preview' not in names


def test_times_are_those_of_several_clouds_only_where_there_are_several():
    entry = make_entry('/points 0', cloud(), filter_cloud(cloud()))
    for entries, told in (([entry], False), ([entry, entry], True)):
        page = report_page('night', entries, PipelineSettings(), {}, None)
        assert ('several clouds filtered at once' in page) == told


def test_lengths_have_the_digits_of_their_column():
    entry = make_entry('/points 0', cloud(), filter_cloud(cloud()), unit='um')
    table = measurements_table([entry])
    shown = {column.name: text for column, text in zip(table.columns, table.texts()[0], strict=True)}
    sa = next(text for name, text in shown.items() if name.startswith('Sa ['))
    assert len(sa.replace('.', '').lstrip('0')) == 4


def test_the_verdict_counts_what_failed_and_names_it():
    def entry(name, **limits):
        settings = PipelineSettings(limits=LimitSettings(**limits))
        return make_entry(name, cloud(), filter_cloud(cloud(), settings))

    passed, failed = entry('good', outlier_share_max=0.5), entry('bad', outlier_share_max=0.001)
    assert verdict_banner([entry('any')], 0).state == 'none'
    assert verdict_banner([passed], 0).title == 'Passed: 1 of 1 measurements are within the limits.'
    banner = verdict_banner([passed, failed], 0)
    assert banner.title == 'Failed: 1 of 2 measurements are within the limits.'
    assert banner.reasons[0].startswith('bad: 0.46 % of the measured points')
    assert verdict_banner([passed], 2).state == 'failed'


def test_the_page_has_every_entry_and_all_refusals_and_the_damage():
    entry = make_entry('/points 0', cloud(), filter_cloud(cloud()))
    page = report_page('night', [entry], PipelineSettings(), {'too short': 2, 'odd': 1}, 'broken off')
    assert 'href="#measurement--points-0"' in page
    assert 'id="measurement--points-0"' in page
    for sentence in ('Refused, 2 times: too short', 'Refused: odd', 'broken off'):
        assert sentence in page
