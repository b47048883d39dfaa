# SPDX-License-Identifier: Apache-2.0
"""`socialcircle report`."""

import html
import re
from pathlib import Path

import pytest

pytest.importorskip('matplotlib')

from examples import cloud

from socialcircle_ros.messages import point_cloud
from socialcircle_ros.recording import RecordingWriter, open_recording, ros_topic

BAGS = Path(__file__).resolve().parents[2] / 'bags'


def text_of(path):
    return html.unescape(re.sub(r'<style>.*?</style>|<[^>]+>', ' ', path.read_text(), flags=re.DOTALL))


def test_the_page_shows_each_cloud_and_needs_no_other_file(run, tmp_path):
    done = run('report', BAGS / 'parts.mcap', '-o', 'new/folder/parts.html', '-p', 'circle.mode:=paper')
    assert done.code == 0, done.err
    assert '8 measurements, 14680 of 153600 measured points are outliers' in done.out
    page = (tmp_path / 'new/folder/parts.html').read_text()
    assert all(source.startswith('data:') for source in re.findall(r'src="([^"]*)"', page))
    for number in range(8):
        assert f'/points {number}, 2023-11-14' in page
    assert page.count('>precision<') == 8
    assert 'No limits are set' in page


def test_a_focus_stack_has_an_entry(run, tmp_path):
    done = run('report', BAGS / 'stack.mcap', '--params-file', BAGS / 'stack.yaml')
    assert done.code == 0, done.err
    assert '1 measurement,' in done.out
    text = text_of(tmp_path / 'report.html')
    assert '/stack/points 0' in text
    assert re.search(r'stack\.frames\s+32 frames\s+0 frames\s+changed', text)


def test_differences_from_a_recorded_measurement_are_shown(run, tmp_path):
    run('filter', BAGS / 'padded.mcap', '-o', 'cleaned.mcap', '-p', 'circle.radius_scale:=3.0')
    done = run('report', 'cleaned.mcap')
    assert done.code == 0, done.err
    assert '2 measurements with warnings' in done.err
    assert 'The recorded measurement had circle.radius_scale 3.0 (here 1.0)' in text_of(tmp_path / 'report.html')


def test_refused_clouds_are_named_and_the_others_shown(run, tmp_path):
    with RecordingWriter(tmp_path / 'mixed.mcap') as writer:
        writer.add_topic(ros_topic('/points', point_cloud.TYPE))
        for number, points in enumerate((cloud(1, 9), cloud(), cloud(1, 9))):
            writer.write('/points', points, number)
    done = run('report', 'mixed.mcap')
    assert done.code == 0, done.err
    assert re.search(r'1 measurement, .* measured points are outliers \(\d+\.\d\d %\)\.', done.out)
    assert 'Refused, 2 times: The cloud is not organized' in done.err
    text = text_of(tmp_path / 'report.html')
    assert 'Refused, 2 times: The cloud is not organized' in text
    assert '/points 1, 1.000 s' in text


@pytest.mark.parametrize(
    ('arguments', 'sentence'),
    [
        (['nowhere.mcap'], 'nowhere.mcap'),
        ([BAGS / 'stack.mcap'], 'stack.pitch_x is not set'),
        ([BAGS / 'parts.mcap', '-o', '.'], 'is a directory'),
        ([BAGS / 'parts.mcap', '-o', 'a.png'], 'a.png is not the name of a page: give one that ends in .html'),
        ([BAGS / 'parts.mcap', '-o', '/proc/nowhere/x.html'], '/proc/nowhere cannot be written'),
        ([BAGS / 'parts.mcap', '-o', BAGS / 'parts.mcap'], 'parts.mcap is not the name of a page'),
        ([BAGS, '-o', BAGS / 'page.html'], 'would be written into the recording that is read'),
        (['nowhere.mcap', '-o', '/proc/x.html'], '/proc/x.html cannot be written'),  # found first
        ([BAGS / 'parts.mcap', '-p', 'circle.window:=4'], 'circle.window must be odd'),
        ([BAGS / 'parts.mcap', '--topic', '/nowhere'], 'has no topic /nowhere'),
    ],
)
def test_an_error_is_one_sentence_and_leaves_no_file(run, tmp_path, arguments, sentence):
    done = run('report', *arguments)
    assert done.code == 1, done.err
    assert sentence in done.err
    assert 'Traceback' not in done.err
    assert not list(tmp_path.iterdir())


def test_filtered_clouds_of_an_earlier_run_have_no_entry(run, tmp_path):
    run('filter', BAGS / 'padded.mcap', '-o', 'cleaned.mcap')
    done = run('report', 'cleaned.mcap')
    assert done.code == 0, done.err
    assert '2 measurements,' in done.out
    with open_recording(tmp_path / 'cleaned.mcap') as reader:
        assert '/points_filtered' in reader.topics


def test_a_measurement_that_fails_its_limits_ends_with_3_and_is_on_the_page(run, tmp_path):
    done = run('report', BAGS / 'padded.mcap', '-p', 'limits.outlier_share_max:=0.0001')
    assert done.code == 3, done.err
    assert 'Failed: /points 0: ' in done.err
    assert '0 of 2 measurements passed the limits.' in done.out
    assert 'Failed: 0 of 2 measurements are within the limits.' in text_of(tmp_path / 'report.html')


def test_a_comparison_tells_damage_and_refusals(run, tmp_path):
    with RecordingWriter(tmp_path / 'whole.mcap') as writer:
        writer.add_topic(ros_topic('/points', point_cloud.TYPE))
        for number in range(6):
            message = cloud(1, 9) if number == 1 else cloud(seed=number, stamp=number)
            writer.write('/points', message, number)
    content = (tmp_path / 'whole.mcap').read_bytes()
    (tmp_path / 'cut.mcap').write_bytes(content[: len(content) * 2 // 3])
    (tmp_path / 'a.yaml').write_text('/**:\n  ros__parameters:\n    circle.judge: rules\n')
    (tmp_path / 'b.yaml').write_text('/**:\n  ros__parameters:\n    circle.mode: paper\n')
    done = run('report', 'cut.mcap', '--compare', 'a.yaml', 'b.yaml', '-o', 'ab.html')
    assert done.code == 0, done.err
    assert 'Warning: cut.mcap is damaged' in done.err
    assert 'Refused: /points 1: ' in done.err
    page = (tmp_path / 'ab.html').read_text()
    assert '<li>cut.mcap is damaged' in page
    assert '<li>Refused: /points 1: ' in page


def test_two_settings_are_compared_side_by_side(run, tmp_path):
    for name, scale in (('a', 0.6), ('b', 1.0)):
        values = f'circle.mode: paper\n    circle.radius_scale: {scale}'
        (tmp_path / f'{name}.yaml').write_text(f'/**:\n  ros__parameters:\n    {values}\n')
    done = run('report', BAGS / 'padded.mcap', '--compare', 'a.yaml', 'b.yaml', '-o', 'ab.html')
    assert done.code == 0, done.err
    assert '2 measurements compared' in done.out
    text = text_of(tmp_path / 'ab.html')
    assert 'A: a.yaml' in text
    assert re.search(r'circle\.radius_scale\s+0\.6\s+1\.0\s+1\.0', text)
    same = run('report', BAGS / 'padded.mcap', '--compare', 'a.yaml', 'a.yaml')
    assert same.code == 1
    assert 'The two settings to compare are equal' in same.err
    both = run('report', BAGS / 'padded.mcap', '--compare', 'a.yaml', 'b.yaml', '--params-file', 'a.yaml')
    assert both.code == 2
    assert '--compare takes two parameter files in place of --params-file' in both.err
