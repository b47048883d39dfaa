"""`make_report`, called as from a notebook."""

import pytest
from examples import cloud

import socialcircle_ros
from socialcircle_ros.errors import RecordingError, SocialCircleError
from socialcircle_ros.messages import point_cloud
from socialcircle_ros.pipeline.clouds import filter_cloud
from socialcircle_ros.recording import RecordingWriter, ros_topic
from socialcircle_ros.report.entry import make_entry
from socialcircle_ros.report.report import report_page, settings_table
from socialcircle_ros.settings import CircleSettings, PipelineSettings

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
    settings = PipelineSettings(circle=CircleSettings(radius_scale=1.5))
    report = socialcircle_ros.make_report(recording, tmp_path / 'new/report.html', settings)
    assert [entry.name for entry in report.entries] == ['/points 0', '/points 2']
    assert [entry.measurement.outliers for entry in report.entries] == [26, 26]
    assert (report.measured, report.outliers) == (2 * 5594, 2 * 26)
    assert report.entries[0].circle['circle.radius_scale'] == '1.5'
    assert report.path == tmp_path / 'new/report.html'
    assert '/points 2 – ' in report.path.read_text()
    ((reason, count),) = report.refused.items()
    assert 'not organized' in reason
    assert count == 1
    assert report.damage is None


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


def test_changed_settings_are_marked():
    rows = {row[0]: row[1:] for row in settings_table([CircleSettings(window=5)]).rows}
    assert rows['circle.window'] == ['5', '3', 'points', 'changed']
    assert rows['circle.radius_scale'] == ['1.0', '1.0', '', '']


def test_the_page_has_every_entry_and_all_refusals_and_the_damage():
    entry = make_entry('/points 0', cloud(), filter_cloud(cloud()))
    page = report_page('night', [entry], [CircleSettings()], {'too short': 2, 'odd': 1}, 'broken off')
    assert 'href="#measurement--points-0"' in page
    assert 'id="measurement--points-0"' in page
    for sentence in ('Refused, 2 times: too short', 'Refused: odd', 'broken off'):
        assert sentence in page
